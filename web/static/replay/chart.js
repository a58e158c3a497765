// One of a replay's charts: the signals it shows at first, and those that were chosen.

import { Chart } from "../charts/chart.js";
import { ChartMenu } from "../charts/signal_menu.js";
import { Spectrogram, SpectrogramChart } from "../charts/spectrogram.js";
import { Spectra, SpectrumChart } from "../charts/spectrum.js";
import { element } from "../core/dom.js";
import { RecordedSignals } from "./recorded_signals.js";

const axes = (name) => ["x", "y", "z"].map((axis) => `${name}.${axis}`);
const FIRST = [[...axes("state.position"), ...axes("reference.position")], axes("error.position")]; // of each chart

// Events: `select`, `drawn` when it is as fine as the screen, `problem` with its text.
export class ReplayChart extends EventTarget {
  kinds; tools; // made with the runs

  constructor(place, index, clock, range) {
    super();
    this.key = `replay.chart.${index}`; this.index = index; this.place = place; this.range = range;
    this.recorded = new RecordedSignals(clock, range, () => Math.min(2000, Math.max(200, this.chart.plot.clientWidth)));
    this.spectra = new Spectra(range); this.spectrogram = new Spectrogram(range);
    this.chart = new Chart(place, { axis: range, source: this.recorded });
    for (const one of [range, this.spectra.axis]) one.addEventListener("range", () => this.show());
    for (const source of [this.recorded, this.spectra, this.spectrogram]) {
      source.addEventListener("window", () => { this.chart.refresh(); this.show(); });
      source.addEventListener("problem", ({ detail }) => {
        place.classList.toggle("lost", Boolean(detail));
        if (detail) this.dispatchEvent(new CustomEvent("problem", { detail }));
      });
    }
  }

  get names() { return this.chart.names; }
  get source() { return this.chart.source; }
  get settled() { return this.source.settled; }

  setRuns(runs) {
    const { signals } = runs[0].description;
    this.recorded.runs = this.spectra.runs = this.spectrogram.runs = runs;
    const menu = new ChartMenu({ signals, named: signals.filter(({ known }) => known).length });
    const choose = element("button", { title: "choose signals", ariaExpanded: "false",
      onclick: () => menu.toggle(this.chart, choose, () => this.changed()) }, "Signals");
    const kind = (text, source, title) => element("button", { title: `${title}, with the rotors' frequencies; press again to return`, ariaPressed: "false",
      onclick: () => { if (menu.isOpen) menu.close(); this.setSource(this.source === source ? this.recorded : source); } }, text);
    this.kinds = [kind("Spectrum", this.spectra, "density over frequency of what is shown"),
      kind("Spectrogram", this.spectrogram, "density of the first signal over time and frequency")];
    this.tools = [...this.kinds, choose];
    this.chart.tools.append(...this.tools);
    this.chart.select(this.stored() ?? this.defaults(runs[0]));
    this.show();
  }

  // Over time, over frequency, or over both.
  setSource(source) {
    const { place, range, spectra, spectrogram } = this, { names } = this;
    this.chart.close();
    place.replaceChildren();
    this.chart = source === spectra ? new SpectrumChart(place, { axis: spectra.axis, source })
      : source === spectrogram ? new SpectrogramChart(place, { axis: range, source })
        : new Chart(place, { axis: range, source });
    this.kinds.forEach((button, i) => { button.ariaPressed = String(source === [spectra, spectrogram][i]); });
    this.chart.tools.append(...this.tools);
    this.chart.select(names);
    this.changed();
  }

  changed() {
    localStorage.setItem(this.key, JSON.stringify(this.names));
    this.show();
    this.dispatchEvent(new Event("select"));
  }

  // Shows other signals for now; what was chosen by hand stays stored.
  showOnly(names) {
    const known = names.filter((name) => this.source.signals.has(name));
    if (!known.length) return;
    this.chart.select(known);
    this.show();
    this.dispatchEvent(new Event("select"));
  }

  stored() {
    const names = JSON.parse(localStorage.getItem(this.key) ?? "null");
    const known = Array.isArray(names) ? names.filter((name) => this.recorded.signals.has(name)) : [];
    return known.length ? known : null;
  }

  defaults(run) {
    const known = run.known(FIRST[this.index]);
    const moving = run.description.signals.filter((signal) => !("constant" in signal));
    return known.length ? known : moving.slice(3 * this.index, 3 * this.index + 3).map(({ name }) => name);
  }

  // After a run's shift changed: its windows are at other times.
  shifted() {
    this.recorded.clear();
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
    this.recorded.values = values;
    this.chart.readOut();
  }
}
