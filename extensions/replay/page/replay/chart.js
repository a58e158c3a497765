// One of a replay's charts: the signals it shows at first, and those that were chosen.

import { Chart } from "/static/charts/chart.js";
import { ChartMenu } from "/static/charts/signal_menu.js";
import { Spectrogram, SpectrogramChart } from "/static/charts/spectrogram.js";
import { Spectra, SpectrumChart } from "/static/charts/spectrum.js";
import { derive } from "/static/charts/derived.js";
import { viewMenu } from "/static/charts/view_menu.js";
import { XyChart } from "/static/charts/xy.js";
import { element } from "/static/core/dom.js";
import { RecordedSignals } from "./recorded_signals.js";

const SAMPLES = 2000; // of one signal over another
const axes = (name) => ["x", "y", "z"].map((axis) => `${name}.${axis}`);
const FIRST = [[...axes("state.position"), ...axes("reference.position")], axes("error.position")]; // of each chart

// Events: `select`, `drawn` when it is as fine as the screen, `problem` with its text.
export class ReplayChart extends EventTarget {
  menu; // made with the runs

  constructor(place, index, clock, range) {
    super();
    this.key = `replay.chart.${index}`;
    this.index = index;
    this.place = place;
    this.range = range;
    this.recorded = new RecordedSignals(clock, range, () =>
      Math.min(2000, Math.max(200, this.chart.plot.clientWidth)),
    );
    this.sampled = new RecordedSignals(clock, range, () => SAMPLES, false);
    /** @type {Record<string, any[]>} */
    this.views = {
      time: [this.recorded, Chart],
      xy: [this.sampled, XyChart],
      spectrum: [new Spectra(range), SpectrumChart],
      spectrogram: [new Spectrogram(range), SpectrogramChart],
    };
    this.view = "time";
    this.chart = new Chart(place, { axis: range, source: this.recorded });
    for (const one of [range, this.views.spectrum[0].axis]) one.addEventListener("range", () => this.show());
    for (const [source] of Object.values(this.views)) {
      source.addEventListener("window", () => {
        this.chart.refresh();
        this.show();
      });
      source.addEventListener("problem", ({ detail }) => {
        place.classList.toggle("lost", Boolean(detail));
        if (detail) this.dispatchEvent(new CustomEvent("problem", { detail }));
      });
    }
  }

  get names() {
    return this.chart.names;
  }
  get source() {
    return this.chart.source;
  }
  get settled() {
    return this.source.settled;
  }

  setRuns(runs) {
    const { signals } = runs[0].description;
    for (const [source] of Object.values(this.views)) source.runs = runs;
    this.menu = new ChartMenu(
      { signals, named: signals.filter(({ known }) => known).length },
      async (text) => {
        const signal = await derive(text, (texts) => runs[0].expressions(texts));
        await Promise.all(runs.map((run) => run.learn([signal.name])));
        return signal;
      },
    );
    this.addTools();
    this.chart.select(this.stored() ?? this.defaults(runs[0]));
    this.show();
  }

  addTools() {
    const { chart, menu } = this;
    const choose = element(
      "button",
      {
        title: "choose signals",
        ariaExpanded: "false",
        onclick: () => menu.toggle(this.chart, choose, () => this.changed()),
      },
      "Signals",
    );
    chart.tools.append(
      choose,
      viewMenu(
        chart,
        this.view,
        (view) => this.setView(view),
        () => this.show(),
      ),
    );
  }

  // Over time, as an XY plot, over frequency, or over both.
  setView(view) {
    const { place, range } = this,
      { names, hasFigures, hasEvents, limits } = this.chart,
      [source, Kind] = this.views[view];
    if (this.menu.isOpen) this.menu.close();
    this.chart.close();
    place.replaceChildren();
    this.view = view;
    this.chart = new Kind(place, { axis: source.axis ?? range, source, hasFigures, hasEvents, limits });
    this.addTools();
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
    for (const source of [this.recorded, this.sampled]) source.clear();
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
    for (const source of [this.recorded, this.sampled]) source.values = values;
    this.chart.readOut();
  }
}
