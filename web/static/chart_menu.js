// The list of signals a chart can show, by group.

import { element } from "./format.js";

const MOST = 7;

export class ChartMenu {
  constructor(description, choose) {
    this.choose = choose;
    this.boxes = new Map();
    this.place = element("div", { className: "menu", hidden: true });
    for (const group of new Set(description.signals.map((signal) => signal.group))) {
      const members = description.signals.filter((signal) => signal.group === group);
      const unit = new Set(members.map((signal) => signal.unit)).size === 1 ? members[0].unit : "";
      this.place.append(element("fieldset", {}, element("legend", {}, unit ? `${group}, ${unit}` : group), ...members.map((signal) => this.box(signal))));
    }
    document.addEventListener("pointerdown", (event) => {
      if (!this.place.hidden && !this.place.parentElement.contains(event.target)) this.place.hidden = true;
    });
    this.place.addEventListener("keydown", (event) => { if (event.key === "Escape") this.place.hidden = true; });
  }

  box(signal) {
    const input = element("input", { type: "checkbox", onchange: () => this.changed() });
    this.boxes.set(signal.name, input);
    return element("label", {}, input, signal.label);
  }

  toggle(names) {
    for (const [name, box] of this.boxes) box.checked = names.includes(name);
    this.place.hidden = !this.place.hidden;
    this.limit();
  }

  changed() {
    this.limit();
    this.choose([...this.boxes].filter(([, box]) => box.checked).map(([name]) => name));
  }

  limit() {
    const full = [...this.boxes.values()].filter((box) => box.checked).length >= MOST;
    for (const box of this.boxes.values()) box.disabled = full && !box.checked;
    this.place.title = full ? `at most ${MOST} signals in one chart` : "";
  }
}
