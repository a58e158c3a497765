// One of a replay's charts: the signals it shows at first, and those that were chosen.

import { Chart } from "../charts/chart.js";
import { ChartMenu } from "../charts/signal_menu.js";
import { element } from "../core/dom.js";
import { RecordedSignals } from "./recorded_signals.js";

const axes = (name) => ["x", "y", "z"].map((axis) => `${name}.${axis}`);
const FIRST = [[...axes("state.position"), ...axes("reference.position")], axes("error.position")]; // of each chart

// Events: `select`, `drawn` when it is as fine as the screen, `problem` with its text.
export class ReplayChart extends EventTarget {
  constructor(place, index, clock, range) {
    super();
    this.key = `replay.chart.${index}`; this.index = index;
    this.source = new RecordedSignals(clock, range, () => Math.min(2000, Math.max(200, this.chart.plot.clientWidth)));
    this.chart = new Chart(place, { axis: range, source: this.source });
    range.addEventListener("range", () => this.show());
    this.source.addEventListener("window", () => { this.chart.refresh(); this.show(); });
    this.source.addEventListener("problem", ({ detail }) => {
      place.classList.toggle("lost", Boolean(detail));
      if (detail) this.dispatchEvent(new CustomEvent("problem", { detail }));
    });
  }

  get names() { return this.chart.names; }
  get settled() { return this.source.settled; }

  setRuns(runs) {
    const { chart, source } = this, { signals } = runs[0].description;
    source.runs = runs;
    const menu = new ChartMenu({ signals, named: signals.filter(({ known }) => known).length });
    const choose = element("button", { title: "choose signals", ariaExpanded: "false",
      onclick: () => menu.toggle(chart, choose, () => this.changed()) }, "Signals");
    chart.tools.append(choose);
    chart.select(this.stored() ?? this.defaults(runs[0]));
    this.show();
  }

  changed() {
    localStorage.setItem(this.key, JSON.stringify(this.names));
    this.show();
    this.dispatchEvent(new Event("select"));
  }

  stored() {
    const names = JSON.parse(localStorage.getItem(this.key) ?? "null");
    const known = Array.isArray(names) ? names.filter((name) => this.source.signals.has(name)) : [];
    return known.length ? known : null;
  }

  defaults(run) {
    const known = run.known(FIRST[this.index]);
    const moving = run.description.signals.filter((signal) => !("constant" in signal));
    return known.length ? known : moving.slice(3 * this.index, 3 * this.index + 3).map(({ name }) => name);
  }

  // After a run's shift changed: its windows are at other times.
  shifted() {
    this.source.clear();
    this.chart.refresh();
    this.show();
  }

  show() {
    this.chart.draw();
    if (this.settled) this.dispatchEvent(new Event("drawn"));
    else this.source.fetch();
  }

  // Values at the play-head, one object of them a run.
  put(values) {
    this.source.values = values;
    this.chart.readOut();
  }
}
