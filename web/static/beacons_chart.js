// Position error of what is compared against the bound of one frame, from zero up or logarithmic.

import { BOUND, colorOf, wordsOf } from "./beacons_names.js";
import { Chart } from "./chart.js";
import { element, fixed } from "./format.js";

const ERROR = "comparison.position_error.";
const DEVIATION = "comparison.deviation.error_state";
const LIMIT = "comparison.position_bound";
const LEAST = 60; // mm, height of the chart: noise should look like noise

export class ErrorChart extends Chart {
  constructor(place, telemetry, description) {
    super(place, "beacons", telemetry, description);
    place.prepend(element("h2", {}, "Position error", element("span", { className: "limit" }, "against the truth")));
  }

  // What is compared is what is drawn: no choice of signals, but one of the scale.
  addMenu(place) {
    this.log = element("button", { title: "logarithmic scale, 1 mm up", onclick: () => this.setLog(!this.isLog) }, "log");
    place.querySelector("header .right").append(this.log);
    this.setLog(localStorage.getItem("chart.beacons.log") === "true");
  }

  setLog(isLog) {
    this.isLog = isLog;
    localStorage.setItem("chart.beacons.log", String(isLog));
    this.log.setAttribute("aria-pressed", String(isLog));
    if (!this.uplot) return;
    this.uplot.destroy();
    this.uplot = new uPlot(this.options(this.names, this.names.map((name) => this.style(name))), this.data, this.plot);
  }

  options(names, styles) {
    const options = super.options(names, styles);
    if (this.isLog) options.scales.y = { distr: 3, range: (_, low, high) => [1, Math.max(100, 10 ** Math.ceil(Math.log10(high || 1)))] };
    return options;
  }

  stored() { return []; }

  // names: of the comparison, in its order; none takes the signals back.
  compare(names) {
    const errors = names.map((name) => ERROR + name).filter((name) => this.signals.has(name));
    const others = names.length ? [LIMIT, ...(names.includes("error_state") ? [DEVIATION] : [])] : [];
    this.select([...errors, ...others]);
  }

  select(names) {
    if (names.length) { super.select(names); return; }
    this.telemetry.want(`chart.${this.index}`, this.names = []);
    this.legend.replaceChildren();
    this.uplot?.destroy();
    this.uplot = undefined;
  }

  style(name) {
    if (name === LIMIT) return { stroke: BOUND, dash: [6, 4] };
    if (name === DEVIATION) return { stroke: colorOf("error_state"), dash: [2, 3] };
    return { stroke: colorOf(name.slice(ERROR.length)) };
  }

  // Errors without their values, which stand in the table above.
  entry(label, title, color, output) {
    const isBound = label === "one-frame bound", isDeviation = title.startsWith("rms deviation"), dashed = isBound || isDeviation;
    const text = isBound ? "bound of one frame" : isDeviation ? "error-state's stated deviation" : wordsOf(label).replace("complementary, ", "compl. ").replace(" gains", "");
    return super.entry(text, dashed ? "dashed" : title, color, dashed ? output : "");
  }

  figure(value) { return fixed(value, 1); }

  // From zero, a little under it for the labels' sake.
  range(low, high) {
    const top = Math.max(LEAST, 1.08 * (high ?? 0));
    return [-0.04 * top, top];
  }

  take(frame) { if (this.uplot) super.take(frame); }
  gap() { if (this.uplot) super.gap(); }
  draw() { if (this.uplot) super.draw(); }
  resize() { if (this.uplot && this.plot.clientWidth) super.resize(); }
}
