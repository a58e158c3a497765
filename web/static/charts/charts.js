// The row of charts: one time axis, one to four charts, layouts, pause.

import { Chart } from "./chart.js";
import { LiveSignals } from "./live_signals.js";
import { pointingByKeys } from "./pointer.js";
import { ChartMenu } from "./signal_menu.js";
import { LiveSpectrogram, SpectrogramChart } from "./spectrogram.js";
import { LiveSpectra, SpectrumChart } from "./spectrum.js";
import { derive } from "./derived.js";
import { LayoutMenu } from "./layout_menu.js";
import { BUILT_IN, Layouts, MOST_CHARTS } from "./layouts.js";
import { TimeAxis } from "./time_axis.js";
import { viewMenu } from "./view_menu.js";
import { XyChart } from "./xy.js";
import { get } from "../core/api.js";
import { $, element, hide, setText } from "../core/dom.js";
import { duration } from "../core/format.js";
import { History } from "./history.js";
import { icon } from "../icons/icons.js";
import { onKey } from "../core/keys.js";

const WINDOWS = [5, 10, 30, 60, 120, 300, 600]; // s
const MOST_EVENTS = 400; // lines
const RENEW = 1000; // ms between two spectra
const LINES = { time: Chart, xy: XyChart };
const DENSITIES = {
  spectrum: [LiveSpectra, SpectrumChart],
  spectrogram: [LiveSpectrogram, SpectrogramChart],
};
const LOOK = 100; // ms between two looks whether charts are due while no frames come

// What the server says of the texts of derived signals.
export const liveExpressions = (texts) =>
  get(`/api/expressions?${texts.map((text) => `text=${encodeURIComponent(text)}`).join("&")}`);

// A chart as a layout keeps it: what is usual is left out.
function lookOf({ names, scales, limits, view, hasFigures, hasEvents }) {
  return {
    signals: names,
    scales: { ...scales },
    ...(view === "time" ? {} : { view }),
    ...(Object.keys(limits).length ? { limits: { ...limits } } : {}),
    ...(hasFigures ? { hasFigures } : {}),
    ...(hasEvents ? { hasEvents } : {}),
  };
}

export class Charts {
  chosen;
  add;
  pause; // made by the tools
  slowness = 1;

  // events: of this page; what happens is a line in the charts
  constructor(place, telemetry, description, events) {
    this.place = place;
    this.telemetry = telemetry;
    this.signals = new Map(description.signals.map((signal) => [signal.name, signal]));
    this.history = new History(telemetry);
    this.layouts = new Layouts(this.signals);
    this.menu = new ChartMenu(description, (text) => this.derive(text));
    this.charts = [];
    this.counter = 0;
    const { name, layout } = this.layouts.last;
    this.axis = new TimeAxis(this.history, layout.window);
    this.axis.usual = 30;
    this.follow(events);
    this.row = element("div", { className: "row" });
    place.append(this.bar(), this.row);
    this.show(layout, name);
    for (const change of ["change", "point"]) this.axis.addEventListener(change, () => this.drawBar());
    this.drawBar();
    onKey(" ", "pause or resume the charts", () => this.axis.toggle());
    setInterval(() => this.draw(), LOOK);
    setInterval(() => this.drawBar(), 500);
    setInterval(() => this.renew(), RENEW);
    new ResizeObserver(() => this.cover()).observe($("view"));
    place.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.expand(null);
    });
    // One column: nothing to cover.
    document.addEventListener("tab", ({ detail }) => {
      if (detail === "charts") this.expand(null);
    });
  }

  follow(events) {
    const { axis, history } = this,
      add = ({ time, text, level }) => {
        axis.events = [
          ...axis.events.slice(-MOST_EVENTS),
          { t: time, text, kind: level === "info" ? "" : "warn" },
        ];
      };
    events.on("hello", ({ events: lines }) => {
      axis.events = [];
      lines.filter(({ time }) => time).forEach(add);
    });
    events.on("event", (line) => add({ ...line, time: line.time ?? history.origin + axis.now }));
    this.telemetry.addEventListener("frame", ({ detail }) => {
      this.slowness = detail.slowness;
      this.draw();
    });
  }

  // A signal from now on, in all menus; throws what is wrong with the text.
  async derive(text) {
    const signal = await derive(text, liveExpressions);
    this.signals.set(signal.name, signal);
    this.telemetry.topicOf.set(signal.name, signal.topic);
    return signal;
  }

  bar() {
    this.pause = element(
      "button",
      { title: "pause or resume (space); recording of data goes on", onclick: () => this.axis.toggle() },
      "Pause",
    );
    this.windows = element("select", {
      ariaLabel: "seconds shown",
      onchange: () => {
        this.axis.setWindow(Number(this.windows.value));
        this.changed();
      },
    });
    this.reset = element(
      "button",
      { title: "reset the zoom (double-click in a chart)", hidden: true, onclick: () => this.axis.reset() },
      "Whole window",
    );
    this.state = element("output", { className: "state" });
    this.at = element("output", { className: "at" });
    this.chosen = element("select", {
      ariaLabel: "layout of the charts",
      onchange: () => this.chooseLayout(),
    });
    this.add = element(
      "button",
      {
        title: "add a chart",
        ariaLabel: "add a chart",
        onclick: () => {
          this.addChart({ signals: [], scales: {} });
          this.changed();
        },
      },
      icon("add"),
    );
    this.layoutMenu = new LayoutMenu(this.layouts, {
      current: () => this.layout,
      shown: () => this.name,
      show: (name) => this.show(this.layouts.of(name), name),
      listed: () => this.list(),
      derive: (text) => this.derive(text),
    });
    return element(
      "div",
      { className: "bar", role: "toolbar", ariaLabel: "charts" },
      this.pause,
      this.windows,
      this.reset,
      this.state,
      this.at,
      element("span", { className: "right" }, this.chosen, this.layoutMenu.button, this.add),
      this.layoutMenu.place,
    );
  }

  get layout() {
    return { window: Math.round(this.axis.window), charts: this.charts.map(lookOf) };
  }

  show(layout, name) {
    for (const chart of [...this.charts]) this.removeChart(chart);
    this.axis.setWindow(layout.window);
    for (const one of layout.charts) this.addChart(one);
    this.named(name);
  }

  // What is shown is kept; a name stays while nothing is changed.
  changed() {
    this.named("");
  }

  named(name) {
    this.name = name;
    this.layouts.keep(name, this.layout);
    this.list();
    this.drawBar();
  }

  list() {
    const option = (name) => element("option", { value: name }, name);
    this.chosen.replaceChildren(
      ...(this.name ? [] : [element("option", { value: "" }, "changed")]),
      element("optgroup", { label: "built in" }, ...Object.keys(BUILT_IN).map(option)),
      ...(this.layouts.names.length
        ? [element("optgroup", { label: "saved here" }, ...this.layouts.names.map(option))]
        : []),
    );
    this.chosen.value = this.name;
  }

  chooseLayout() {
    const { value } = this.chosen;
    if (value) this.show(this.layouts.of(value), value);
  }

  addChart(look) {
    if (this.charts.length >= MOST_CHARTS) return;
    const place = element("section", { className: "chart", id: `chart-${this.charts.length}` });
    this.row.append(place);
    this.put(this.make(place, look), this.charts.length);
    this.number();
  }

  // A chart of one signal; where there are as many charts as there may be, the last one shows it.
  plot(name) {
    if (this.charts.length < MOST_CHARTS) this.addChart({ signals: [name], scales: {} });
    else this.charts.at(-1).select([name]);
    this.changed();
  }

  make(place, /** @type {any} */ { signals: names, view = "time", ...look }) {
    const made =
      view in LINES
        ? this.overTime(LINES[view], place, names, look)
        : this.overFrequency(DENSITIES[view], place, names, look);
    return Object.assign(made, { view });
  }

  overTime(Kind, place, names, look) {
    const source = new LiveSignals(this.axis, this.signals, `chart ${this.counter++}`);
    const chart = new Kind(place, { axis: this.axis, source, ...look });
    chart.select(names);
    return chart;
  }

  overFrequency([Source, Kind], place, names, look) {
    const source = new Source(this.signals, this.axis),
      chart = new Kind(place, { axis: source.axis ?? this.axis, source, ...look });
    chart.select(names);
    const problem = element("output", { className: "state" });
    chart.tools.append(problem);
    source.addEventListener("window", () => chart.refresh());
    source.addEventListener("problem", ({ detail }) => setText(problem, detail));
    source.renew();
    return chart;
  }

  // The same signals in another view.
  change(chart, view) {
    if (this.menu.isOpen) this.menu.close();
    const at = this.charts.indexOf(chart),
      { place } = chart;
    chart.close();
    place.replaceChildren();
    this.charts.splice(at, 1);
    this.put(this.make(place, { ...lookOf(chart), view }), at);
    this.number();
    this.changed();
  }

  // With its buttons, among the others.
  put(chart, at) {
    const { place } = chart;
    pointingByKeys(chart);
    const choose = element(
      "button",
      {
        title: "choose signals, set scales",
        ariaExpanded: "false",
        onclick: () => this.menu.toggle(chart, choose, () => this.changed()),
      },
      "Signals",
    );
    chart.grow = element(
      "button",
      {
        className: "icon",
        title: "expand over the 3D view; Escape restores it",
        ariaLabel: "expand",
        ariaPressed: String(place.classList.contains("expanded")),
        onclick: () => this.expand(place.classList.contains("expanded") ? null : chart),
      },
      icon("expand"),
    );
    chart.less = element(
      "button",
      {
        className: "icon",
        title: "remove this chart",
        ariaLabel: "remove chart",
        onclick: () => {
          this.removeChart(chart);
          this.changed();
        },
      },
      icon("close"),
    );
    chart.tools.append(
      choose,
      viewMenu(
        chart,
        chart.view,
        (view) => this.change(chart, view),
        () => this.changed(),
      ),
      chart.grow,
      chart.less,
    );
    this.charts.splice(at, 0, chart);
  }

  removeChart(chart) {
    if (this.menu.isOpen && this.menu.chart === chart) this.menu.close();
    chart.close();
    chart.place.remove();
    this.charts = this.charts.filter((other) => other !== chart);
    this.number();
  }

  number() {
    this.charts.forEach((chart, i) => {
      chart.place.id = `chart-${i}`;
      chart.place.ariaLabel = `chart ${i + 1}`;
      chart.less.hidden = this.charts.length === 1;
    });
    this.cover();
    this.add.disabled = this.charts.length >= MOST_CHARTS;
  }

  // One chart over the 3D view, below what is written on top of it; null: none.
  expand(chart) {
    for (const one of this.charts) {
      one.place.classList.toggle("expanded", one === chart);
      one.grow.ariaPressed = String(one === chart);
    }
    this.cover();
  }

  cover() {
    const place = this.row.querySelector(".expanded"),
      { left, top, width, height } = $("view").getBoundingClientRect();
    for (const { place: one } of this.charts) if (one !== place) one.removeAttribute("style");
    this.row.style.setProperty("--count", String(Math.max(1, this.charts.length - (place ? 1 : 0))));
    if (place)
      Object.assign(place.style, {
        left: `${left}px`,
        top: `${top + 40}px`,
        width: `${width}px`,
        height: `${height - 40}px`,
      });
  }

  renew() {
    if (document.hidden || this.axis.paused) return;
    for (const { source, isSeen } of this.charts) if (isSeen) source.renew?.();
  }

  draw() {
    if (document.hidden) return;
    for (const chart of this.charts) chart.draw();
  }

  drawBar() {
    const { axis } = this,
      { paused, zoom } = axis,
      seconds = Math.round(axis.window);
    const choices = WINDOWS.includes(seconds) ? WINDOWS : [...WINDOWS, seconds].sort((a, b) => a - b);
    if (choices.join() !== this.choices) {
      this.choices = choices.join();
      this.windows.replaceChildren(
        ...choices.map((one) =>
          element("option", { value: one }, one < 120 ? `${one} s` : `${Number((one / 60).toFixed(1))} min`),
        ),
      );
    }
    if (this.windows.value !== String(seconds)) this.windows.value = seconds;
    this.pause.ariaPressed = String(paused);
    setText(this.pause, paused ? "Resume" : "Pause");
    hide(this.reset, !zoom);
    this.place.classList.toggle("paused", paused);
    const shown = zoom ? `, ${Number((zoom[1] - zoom[0]).toPrecision(2))} s shown` : "";
    const coarse = this.slowness > 1 ? `slow connection: extremes of ${this.slowness} samples` : "";
    setText(this.state, paused ? `paused for ${duration(axis.pausedFor)}${shown}` : coarse);
    setText(this.at, this.stamp);
  }

  // When the sample under the cursor was taken.
  get stamp() {
    const { axis } = this,
      { source, names: [name] = [] } =
        this.charts.find(({ source: one, names }) => one.stamp && names.length) ?? {};
    const time = name && axis.cursor !== null ? source.stamp(name) : undefined;
    return time === undefined ? "" : `at ${axis.clock(time, 4)}`;
  }
}
