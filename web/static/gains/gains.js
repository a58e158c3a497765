// The Gains tab: every parameter from the vehicle's own descriptions.

import { get } from "../core/api.js";
import { $, element } from "../core/dom.js";
import { TYPING } from "../core/keys.js";
import { exact } from "../core/format.js";
import { Parameters } from "./parameters.js";
import { GainRow } from "./row.js";
import { unfold } from "./detail.js";
import { ParameterPanel } from "./panel.js";
import { ParameterTree } from "./tree.js";

const KEYS = 1500; // ms between two values of keys that are held or pressed again

export class Gains extends Parameters {
  constructor(events, isOperator) {
    super(events, isOperator);
    this.rows = new Map();
    this.mine = []; // this page's own changes, for Undo
    this.acts = []; // the same and those undone: { name, from, to }, the revisions of its values
    this.tree = new ParameterTree($("gains"));
    this.panel = new ParameterPanel(this, $("parameter-panel"), [$("gains"), $("gains-search")]);
    this.addEventListener("read", () => this.showAll());
    this.addEventListener("confirmed", ({ detail }) => this.show(detail));
    events.on("summary", ({ status }) => this.status(status));
    $("search").addEventListener("input", () => this.filter());
    $("modified").addEventListener("change", () => this.filter());
    $("undo").addEventListener("click", () => this.undo());
    document.addEventListener("keydown", (event) => {
      if (
        event.key !== "z" ||
        event.shiftKey ||
        !(event.ctrlKey || event.metaKey) ||
        /** @type {any} */ (event.target)?.closest?.(TYPING) ||
        $("undo").disabled
      )
        return;
      event.preventDefault();
      this.undo();
    });
  }

  showAll() {
    const parameters = [...this.known.values()];
    if (parameters.length === 0) {
      $("gains").replaceChildren(
        element(
          "p",
          { className: "empty" },
          "The vehicle's parameters have not been read yet. They appear here when it is connected.",
        ),
      );
      this.rows.clear();
      return;
    }
    if (parameters.length !== this.rows.size || !parameters.every(({ name }) => this.rows.has(name)))
      this.build(parameters);
    for (const { name, value } of parameters) this.rows.get(name).confirm(value);
    this.filter();
    this.readFlight();
  }

  build(parameters) {
    this.rows = new Map(
      parameters.map((description) => [
        description.name,
        new GainRow(
          description,
          this.isOperator,
          (value, walks, press) => this.change(description.name, value, walks, press),
          (row) => this.tree.changed(row),
          (row, place) => unfold(this, row, place),
        ),
      ]),
    );
    this.tree.build([...this.rows.values()]);
  }

  // What was changed in this flight so far.
  async readFlight() {
    const flight = await get("/api/parameters/flight").catch(() => null);
    if (flight === null || flight.is_over) return;
    for (const [name, value] of Object.entries(flight.values)) {
      const row = this.rows.get(name);
      if (row?.flightValue === undefined) row?.flightBegan(value);
    }
  }

  status(status) {
    if (!status) return;
    if (this.isArmed === false && status.armed)
      for (const row of this.rows.values()) row.flightBegan(undefined);
    this.isArmed = status.armed;
  }

  show({ name, before }) {
    const row = this.rows.get(name),
      value = this.value(name);
    row?.confirm(value);
    if (this.isArmed && row?.flightValue === undefined && before !== value) row?.flightBegan(before);
  }

  // press: of the pointer on a slider, null of keys and typing. All values of a press are one change, however
  // long it lasts.
  async change(name, value, walks = false, press = null) {
    const { value: before, revision: from } = this.known.get(name);
    const applied = await this.set({ [name]: value }, walks);
    const now = performance.now(),
      last = this.mine.at(-1),
      to = this.known.get(name).revision;
    if (last?.name === name && last.press === press && (press || now - last.time < KEYS))
      Object.assign(last, { time: now, to });
    else if (before !== this.value(name)) {
      const act = { name, value: before, press, time: now, from, to };
      this.mine = [...this.mine.slice(-99), act];
      this.acts = [...this.acts.slice(-99), act];
    }
    this.showUndo();
    return applied[name];
  }

  async undo() {
    const step = this.mine.pop();
    this.showUndo();
    if (!step) return;
    try {
      await this.set({ [step.name]: step.value }, true);
    } catch (error) {
      this.rows.get(step.name).fail(error.message);
    }
  }

  showUndo() {
    const last = this.mine.at(-1);
    $("undo").disabled = !last || !this.isOperator;
    $("undo").title = last
      ? `${last.name} back to ${exact(last.value)}`
      : "take back this page's last change";
  }

  filter() {
    const text = $("search").value.trim().toLowerCase(),
      which = $("modified").value;
    const only = { modified: (row) => row.isModified, flight: (row) => row.isChangedInFlight }[which] ?? null;
    const found = this.tree.filter(text, only);
    $("nothing-found").hidden = !this.tree.isSearching || found > 0 || this.rows.size === 0;
  }
}
