// The checklist of the day: ticked by whoever did an item, on any page; it begins anew each morning.

import { get, request } from "/static/core/api.js";
import { attempt, element, setText } from "/static/core/dom.js";
import { clock } from "/static/core/format.js";

const LOOK = 5000; // ms between two looks at what others ticked

export function show(place, { isOperator }) {
  new Checklist(place, isOperator);
}

class Checklist {
  items = /** @type {{ text: string, by: string, stamp: number | null }[]} */ ([]);

  constructor(place, isOperator) {
    this.isOperator = isOperator;
    this.count = element("span");
    this.list = element("ul");
    this.reason = element("p", { className: "reason", hidden: true });
    this.edit = element(
      "button",
      { className: "link", hidden: !isOperator, onclick: () => this.toggle() },
      "Edit",
    );
    this.text = element("textarea", {
      hidden: true,
      rows: 6,
      ariaLabel: "items of the checklist, one a line",
    });
    place.append(
      element("h2", {}, "Checklist of the day ", this.count, this.edit),
      this.list,
      this.text,
      this.reason,
    );
    document.addEventListener("tab", (event) => {
      this.isOpen = /** @type {CustomEvent} */ (event).detail === "experiments";
      this.look();
    });
    setInterval(() => this.look(), LOOK);
  }

  look() {
    if (this.isOpen && !document.hidden) this.take(() => get("/api/checklist"));
  }

  /** @param {() => Promise<any>} ask */
  take(ask) {
    return attempt(this.reason, async () => {
      this.items = await ask();
      this.draw();
    });
  }

  draw() {
    const open = this.items.filter(({ stamp }) => stamp === null).length,
      all = this.items.length;
    setText(this.count, all ? `${all - open} of ${all}` : "");
    this.count.className = open ? "amber" : "";
    const state = JSON.stringify(this.items);
    if (state === this.drawn) return;
    this.drawn = state;
    this.list.replaceChildren(...this.items.map((item) => this.line(item)));
  }

  line({ text, by, stamp }) {
    const done = stamp !== null;
    const box = element("input", {
      type: "checkbox",
      checked: done,
      disabled: !this.isOperator,
      onchange: () => this.take(() => request("POST", "/api/checklist/tick", { item: text, done: !done })),
    });
    const said = done ? element("small", {}, `${by}, ${clock(stamp)}`) : "";
    return element("li", { className: done ? "done" : "" }, element("label", {}, box, text), said);
  }

  // The items as a text of lines, and back.
  async toggle() {
    const isEditing = !this.text.hidden;
    if (isEditing) {
      const items = this.text.value.split("\n").map((line) => line.trim());
      const isSaved = await this.take(() =>
        request("PUT", "/api/checklist", { items: items.filter(Boolean) }),
      );
      if (!isSaved) return; // the text stays
    } else this.text.value = this.items.map(({ text }) => text).join("\n");
    this.text.hidden = isEditing;
    this.list.hidden = !isEditing;
    setText(this.edit, isEditing ? "Edit" : "Save");
    if (!isEditing) this.text.focus();
  }
}
