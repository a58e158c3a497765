// The Gains tab: every parameter from the vehicle's own descriptions.

import { get, request } from "./api.js";
import { element, exact } from "./format.js";
import { GainRow } from "./gain_row.js";

const $ = (id) => document.getElementById(id);
const OPEN = ["control.position", "control.attitude"];

// Fires `read` when the parameters have been read anew.
export class Gains extends EventTarget {
  constructor(events, isOperator) {
    super();
    this.isOperator = isOperator;
    this.rows = new Map();
    this.groups = [];
    this.history = [];
    this.place = $("gains");
    events.on("hello", () => this.load());
    events.on("parameters", () => this.load());
    events.on("parameter", ({ name, value }) => this.rows.get(name)?.confirm(value));
    $("search").addEventListener("input", () => this.filter());
    $("modified").addEventListener("click", () => {
      $("modified").setAttribute("aria-pressed", String($("modified").getAttribute("aria-pressed") !== "true"));
      this.filter();
    });
    $("undo").addEventListener("click", () => this.undo());
  }

  async load() {
    const { parameters } = await get("/api/parameters").catch(() => ({ parameters: null }));
    if (parameters === null) return; // web is away; the hello of its return loads again
    if (parameters.length === 0) {
      this.place.replaceChildren(element("p", { className: "empty" }, "The vehicle's parameters have not been read yet. They appear here when it is connected."));
      return;
    }
    const known = parameters.length === this.rows.size && parameters.every(({ name }) => this.rows.has(name));
    if (known) for (const { name, value } of parameters) this.rows.get(name).confirm(value);
    else this.build(parameters);
    this.filter();
    this.dispatchEvent(new Event("read"));
  }

  // The confirmed value, undefined when there is no such parameter.
  value(name) { return this.rows.get(name)?.confirmed; }

  // Several at once, all or nothing.
  async set(values) {
    const { applied } = await request("PUT", "/api/parameters", { values });
    for (const [name, value] of Object.entries(applied)) this.rows.get(name)?.confirm(value);
  }

  build(parameters) {
    this.rows.clear();
    const groups = Map.groupBy ? Map.groupBy(parameters, groupOf) : groupBy(parameters, groupOf);
    this.groups = [...groups].map(([name, members]) => {
      const count = element("span", { className: "count" });
      const details = element("details", { open: OPEN.includes(name) }, element("summary", {}, element("b", {}, name), count));
      const rows = members.map((description) => {
        const row = new GainRow(description, this.isOperator, (value) => this.change(description.name, value), () => this.count());
        this.rows.set(description.name, row);
        details.append(row.place);
        return row;
      });
      return { details, rows, count };
    });
    this.place.replaceChildren(...this.groups.map(({ details }) => details));
  }

  async change(name, value) {
    const row = this.rows.get(name), before = row.confirmed;
    const { applied } = await request("PUT", "/api/parameters", { values: { [name]: value } });
    row.confirm(applied[name]);
    this.remember(name, before);
    return applied[name];
  }

  // One step of undo for each gesture, not for each of its 20 values a second.
  remember(name, before) {
    const now = performance.now(), last = this.history.at(-1);
    if (last?.name === name && now - last.time < 1500) last.time = now;
    else if (before !== this.rows.get(name).confirmed) this.history.push({ name, value: before, time: now });
    this.showUndo();
  }

  async undo() {
    const step = this.history.pop();
    this.showUndo();
    if (!step) return;
    const row = this.rows.get(step.name);
    try {
      const { applied } = await request("PUT", "/api/parameters", { values: { [step.name]: step.value } });
      row.confirm(applied[step.name]);
    } catch (error) { row.fail(error.message); }
  }

  showUndo() {
    const last = this.history.at(-1);
    $("undo").disabled = !last || !this.isOperator;
    $("undo").title = last ? `${last.name} back to ${exact(last.value)}` : "take back the last change";
  }

  filter() {
    const text = $("search").value.trim().toLowerCase(), only = $("modified").getAttribute("aria-pressed") === "true";
    for (const { details, rows } of this.groups) {
      let shown = 0;
      for (const row of rows) {
        const hit = (!text || row.text.includes(text)) && (!only || row.isModified);
        row.place.hidden = !hit;
        shown += hit;
      }
      details.hidden = shown === 0;
      if (text || only) details.open = true;
    }
    this.count();
  }

  count() {
    for (const { rows, count } of this.groups) {
      const modified = rows.filter((row) => row.isModified).length;
      count.textContent = modified ? `${modified} modified` : "";
    }
  }
}

const groupOf = ({ name }) => name.split(".").slice(0, -1).join(".");

function groupBy(items, key) {
  const groups = new Map();
  for (const item of items) groups.set(key(item), [...(groups.get(key(item)) ?? []), item]);
  return groups;
}
