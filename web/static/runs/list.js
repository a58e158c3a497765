// The list of runs, newest first: thousands of them, of which only those in sight are drawn.

import { element } from "../core/dom.js";
import { characterOf } from "../core/keys.js";
import { experiment, lasted, rms, startOf, state, verdict } from "./labels.js";

const PAGE = 100; // runs asked for at once
const ROW = 34; // px, as in runs.css
const BEYOND = 8; // rows drawn above and below
const COLUMNS = [
  ["", "mark"],
  ["start", "start"],
  ["title", "title"],
  ["verdict", "verdict"],
  ["rms error", "number"],
  ["duration", "number"],
  ["vehicle", "vehicle"],
  ["operator", "operator"],
  ["tags", "tags"],
  ["notes", "notes"],
  ["state", "state"],
];

export class RunList extends EventTarget {
  // page(offset, limit) answers { total, runs }; nothing() says why there is none.
  constructor(place, page, nothing) {
    super();
    this.page = page;
    this.nothing = nothing;
    this.runs = []; // by index, undefined while unknown
    this.total = 0;
    this.cursor = 0;
    this.chosenIds = new Map(); // id → run
    this.asked = new Set();
    this.generation = 0;
    this.problem = "";
    this.isRead = false; // whether the first answer is there
    this.rows = new Map(); // index → [run, node]
    const cells = COLUMNS.map(([text, name]) =>
      element(
        "th",
        { scope: "col", className: name },
        text || element("span", { className: "unseen" }, "chosen"),
      ),
    );
    this.above = element("tr", { ariaHidden: "true" });
    this.below = element("tr", { ariaHidden: "true" });
    this.body = element("tbody", {}, this.above, this.below);
    this.table = element(
      "table",
      {
        role: "grid",
        tabIndex: 0,
        ariaLabel: "runs; arrows move, space chooses, enter replays, delete deletes",
        "aria-multiselectable": "true",
      },
      element("thead", {}, element("tr", { role: "row", "aria-rowindex": "1" }, ...cells)),
      this.body,
    );
    this.empty = element("p", { className: "empty", hidden: true });
    this.frame = element("div", { className: "frame" }, this.table, this.empty);
    place.append(this.frame);
    this.frame.addEventListener("scroll", () => this.later(), { passive: true });
    new ResizeObserver(() => this.later()).observe(this.frame);
    this.table.addEventListener("keydown", (event) => this.key(event));
    this.body.addEventListener("click", (event) => this.click(event));
    this.body.addEventListener("dblclick", ({ target }) => {
      if (target?.closest("tr[data-index]") && !target.closest("input")) this.tell("open");
    });
  }

  get current() {
    return this.runs[this.cursor];
  }
  get chosen() {
    return [...this.chosenIds.values()];
  }
  // Ids of the chosen runs, or of the one under the cursor.
  get picked() {
    return this.chosenIds.size ? [...this.chosenIds.keys()] : this.current ? [this.current.id] : [];
  }

  tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }

  // Another search.
  async reset() {
    this.chosenIds.clear();
    this.cursor = 0;
    this.frame.scrollTop = 0;
    await this.load(true);
  }

  // The same search again: what is shown stays until the answer is there.
  async refresh() {
    await this.load(false);
  }

  async load(isNew) {
    const generation = ++this.generation;
    const first = isNew ? 0 : Math.floor(this.frame.scrollTop / ROW / PAGE) * PAGE;
    try {
      const answer = await this.page(first, PAGE);
      if (generation !== this.generation) return;
      const seen = this.current?.id; // now, not when it was asked: the cursor may have moved since
      this.problem = "";
      this.runs = [];
      this.asked = new Set([first]);
      this.take(first, answer);
      if (!isNew && seen) this.find(seen);
    } catch (error) {
      if (generation !== this.generation) return;
      this.problem = error.message;
      this.runs = [];
      this.total = 0;
    }
    this.isRead = true;
    this.draw();
    this.tell("loaded");
  }

  async more(first) {
    if (this.asked.has(first)) return;
    this.asked.add(first);
    const generation = this.generation;
    try {
      const answer = await this.page(first, PAGE);
      if (generation !== this.generation) return;
      this.take(first, answer);
      this.draw();
      this.tell("loaded");
    } catch {
      setTimeout(() => this.asked.delete(first), 1000);
    }
  }

  take(first, { total, runs }) {
    this.total = total;
    runs.forEach((run, i) => {
      this.runs[first + i] = run;
      if (this.chosenIds.has(run.id)) this.chosenIds.set(run.id, run);
    });
  }

  find(id) {
    const index = this.runs.findIndex((run) => run?.id === id);
    if (index >= 0) this.cursor = index;
    else this.cursor = Math.max(0, Math.min(this.cursor, this.total - 1));
  }

  unchoose(ids) {
    for (const id of ids) this.chosenIds.delete(id);
    this.drawChoice();
  }

  later() {
    if (this.frameDue) return;
    this.frameDue = requestAnimationFrame(() => {
      this.frameDue = 0;
      this.draw();
    });
  }

  draw() {
    this.empty.hidden = this.total > 0;
    this.empty.textContent = this.problem || (this.isRead ? this.nothing() : "Reading the list of runs …");
    this.table.setAttribute("aria-rowcount", String(this.total + 1));
    const height = this.frame.clientHeight || 600;
    const first = Math.max(0, Math.floor(this.frame.scrollTop / ROW) - BEYOND);
    const last = Math.min(this.total, Math.ceil((this.frame.scrollTop + height) / ROW) + BEYOND);
    for (let at = Math.floor(first / PAGE) * PAGE; at < last; at += PAGE)
      if (!this.asked.has(at)) this.more(at);
    for (const [index, [run, node]] of this.rows) {
      if (index >= first && index < last && this.runs[index] === run) continue;
      node.remove();
      this.rows.delete(index);
    }
    let next = this.above.nextSibling;
    for (let index = first; index < last; index++) {
      const known = this.rows.get(index);
      if (known) {
        next = known[1].nextSibling;
        continue;
      }
      const node = this.row(index, this.runs[index]);
      this.body.insertBefore(node, next);
      this.rows.set(index, [this.runs[index], node]);
    }
    this.above.style.height = `${first * ROW}px`;
    this.below.style.height = `${Math.max(0, this.total - last) * ROW}px`;
    this.above.hidden = first === 0;
    this.below.hidden = last >= this.total;
    this.drawChoice();
  }

  row(index, run) {
    const common = {
      role: "row",
      id: `run-${index}`,
      "aria-rowindex": String(index + 2),
      "data-index": String(index),
    };
    if (!run)
      return element(
        "tr",
        { ...common, className: "unknown" },
        element("td", { colSpan: COLUMNS.length }, "…"),
      );
    const [text, kind, why] = state(run);
    const box = element("input", { type: "checkbox", tabIndex: -1, ariaLabel: `choose ${run.id}` });
    const judged = verdict(run),
      chip = judged ? [element("span", { className: `chip ${run.verdict}` }, judged)] : [];
    const cell = (name, content, title = content) => element("td", { className: name, title }, content);
    return element(
      "tr",
      common,
      element("td", { className: "mark" }, box),
      cell("start", startOf(run).slice(0, 16), `${run.id}, ${startOf(run)}`),
      cell("title", run.title),
      element("td", { className: "verdict", title: experiment(run) }, ...chip),
      cell("number", rms(run), rms(run) && "rms position error of the flight that was judged"),
      cell("number", lasted(run)),
      cell("vehicle", run.vehicle),
      cell("operator", run.operator || "–"),
      element(
        "td",
        { className: "tags", title: run.tags.join(", ") },
        ...run.tags.map((tag) => element("span", { className: "tag" }, tag)),
      ),
      cell("notes", run.notes),
      element("td", { className: `state ${kind}`, title: why }, text),
    );
  }

  drawChoice() {
    for (const [index, [run, node]] of this.rows) {
      const isChosen = Boolean(run && this.chosenIds.has(run.id));
      node.setAttribute("aria-selected", String(isChosen));
      node.classList.toggle("current", index === this.cursor);
      const box = node.querySelector("input");
      if (box) box.checked = isChosen;
    }
    if (this.rows.has(this.cursor)) this.table.setAttribute("aria-activedescendant", `run-${this.cursor}`);
    else this.table.removeAttribute("aria-activedescendant");
  }

  move(index, isChoosing = false) {
    if (!this.total) return;
    const before = this.cursor;
    this.cursor = Math.max(0, Math.min(this.total - 1, index));
    if (isChoosing)
      for (let i = Math.min(before, this.cursor); i <= Math.max(before, this.cursor); i++)
        this.choose(i, true);
    const top = this.cursor * ROW,
      room = this.frame.clientHeight - 2 * ROW; // one is the head
    if (top < this.frame.scrollTop) this.frame.scrollTop = top;
    else if (top > this.frame.scrollTop + room) this.frame.scrollTop = top - room;
    this.draw();
    this.tell("choice");
  }

  /** @param {boolean | null} wanted */
  choose(index, wanted = null) {
    const run = this.runs[index];
    if (!run) return;
    if (wanted ?? !this.chosenIds.has(run.id)) this.chosenIds.set(run.id, run);
    else this.chosenIds.delete(run.id);
  }

  click(event) {
    const row = event.target.closest("tr[data-index]");
    if (!row) return;
    const index = Number(row.dataset.index);
    if (event.target.closest("td.mark") || event.ctrlKey || event.metaKey) this.choose(index);
    const isNotes = event.target.closest("td.notes") && !event.ctrlKey && !event.shiftKey;
    this.move(index, event.shiftKey);
    if (isNotes) this.tell("edit", "notes");
  }

  key(event) {
    const room = Math.max(1, Math.floor(this.frame.clientHeight / ROW) - 2);
    const steps = {
      ArrowDown: 1,
      ArrowUp: -1,
      PageDown: room,
      PageUp: -room,
      Home: -this.total,
      End: this.total,
    };
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key in steps) this.move(this.cursor + steps[event.key], event.shiftKey);
    else if (event.key === " ") {
      this.choose(this.cursor);
      this.move(this.cursor);
    } else if (event.key === "Enter") this.tell("open");
    else if (event.key === "Delete") this.tell("remove");
    else if (event.key === "Escape") {
      this.chosenIds.clear();
      this.move(this.cursor);
    } else if (characterOf(event) === "n") this.tell("edit", "notes");
    else if (characterOf(event) === "t") this.tell("edit", "tags");
    else return;
    event.preventDefault();
    event.stopPropagation();
  }
}
