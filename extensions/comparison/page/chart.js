// Position error of what is compared against the bound of one frame, from zero up or logarithmic.
// While nothing is compared, or the tab is hidden, it has no signals and draws nothing.

import { BOUND, colorOf, wordsOf } from "/static/beacons/estimate_names.js";
import { Chart } from "/static/charts/chart.js";
import { LiveSignals } from "/static/charts/live_signals.js";
import { pointingByKeys } from "/static/charts/pointer.js";
import { TimeAxis } from "/static/charts/time_axis.js";
import { element, optionsOf } from "/static/core/dom.js";
import { fixed } from "/static/core/format.js";

const ERROR = "comparison.position_error.";
const DEVIATION = "comparison.deviation.error_state";
const LIMIT = "comparison.position_bound";
const LEAST = 60; // mm, height of the chart: noise should look like noise
const WINDOWS = [10, 30, 60]; // s
const LOOK = 66; // ms

export class ErrorChart extends Chart {
  constructor(place, history, description) {
    const seconds = Number(localStorage.getItem("chart.beacons.window"));
    const axis = new TimeAxis(history, WINDOWS.includes(seconds) ? seconds : 30);
    const signals = new Map(description.signals.map((signal) => [signal.name, signal]));
    super(place, { axis, source: new LiveSignals(axis, signals, "chart of errors") });
    pointingByKeys(this);
    place.prepend(
      element("h2", {}, "Position error", element("span", { className: "limit" }, "against the truth")),
    );
    const choose = () => {
      axis.setWindow(Number(span.value));
      localStorage.setItem("chart.beacons.window", span.value);
    };
    const span = element(
      "select",
      { ariaLabel: "seconds shown", onchange: choose },
      ...optionsOf(
        WINDOWS.map((one) => [String(one), `${one} s`]),
        String(axis.window),
      ),
    );
    this.log = element(
      "button",
      { title: "logarithmic scale, from 1 mm", onclick: () => this.setLog(!this.isLog) },
      "log",
    );
    this.tools.append(span, this.log);
    this.setLog(localStorage.getItem("chart.beacons.log") === "true");
    setInterval(() => document.hidden || this.draw(), LOOK);
  }

  setLog(isLog) {
    this.isLog = isLog;
    localStorage.setItem("chart.beacons.log", String(isLog));
    this.log.setAttribute("aria-pressed", String(isLog));
    if (this.uplot) this.rebuild();
  }

  scale(unit) {
    if (!this.isLog) return super.scale(unit);
    return { distr: 3, range: () => [1, Math.max(100, 10 ** Math.ceil(Math.log10(this.rangeOf(unit)[1])))] };
  }

  // names: of the comparison, in its order; none takes the signals back.
  compare(names) {
    const errors = names.map((name) => ERROR + name).filter((name) => this.source.signals.has(name));
    const others = names.length ? [LIMIT, ...(names.includes("error_state") ? [DEVIATION] : [])] : [];
    this.select([...errors, ...others]);
  }

  rebuild() {
    if (this.names.length) super.rebuild();
    else this.drop();
  }

  stylesOf(names) {
    return names.map((name) => {
      if (name === LIMIT) return { stroke: BOUND, dash: [6, 4] };
      if (name === DEVIATION) return { stroke: colorOf("error_state"), dash: [2, 3] };
      return { stroke: colorOf(name.slice(ERROR.length)), dash: [] };
    });
  }

  labelsOf(names) {
    return names.map((name) =>
      name === LIMIT
        ? "bound of one frame"
        : name === DEVIATION
          ? "error-state's stated deviation"
          : wordsOf(name.slice(ERROR.length)).replace("complementary, ", "compl. ").replace(" gains", ""),
    );
  }

  // Errors without their values, which stand in the table above.
  entry(line, output) {
    const entry = super.entry(line, line.dash.length ? output : "");
    entry.classList.toggle("dashed", line.dash.length > 0);
    return entry;
  }

  drawEnds() {} // the legend has room for the names

  figure(value) {
    return fixed(value, 1);
  }

  // From zero, a little under it for the labels' sake.
  range(unit, low, high) {
    const top = Math.max(LEAST, 1.08 * (high ?? 0));
    return [-0.04 * top, top];
  }
}
