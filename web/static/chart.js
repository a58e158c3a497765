// A live chart of any signals: uPlot over the last seconds; gaps are gaps.

import { ChartMenu } from "./chart_menu.js";
import { element, fixed } from "./format.js";

const KEEP = 60; // s
const PERIOD = 66; // ms between two drawings
const WINDOWS = [10, 30, 60]; // s
const AXIS = { x: "#e5827c", y: "#76c495", z: "#79a9ea", roll: "#e5827c", pitch: "#76c495", yaw: "#79a9ea" };
const OTHERS = ["#c9b06b", "#b08fd8", "#6fc3c6", "#d08fae", "#9aa8b4", "#e0a36a", "#8fbf73"];
const DEFAULTS = [
  ["state.position.x", "state.position.y", "state.position.z", "reference.position.x", "reference.position.y", "reference.position.z"],
  ["error.position.x", "error.position.y", "error.position.z"],
];

export class Chart {
  constructor(place, index, telemetry, description) {
    this.telemetry = telemetry;
    this.index = index;
    this.signals = new Map(description.signals.map((signal) => [signal.name, signal]));
    this.window = Number(localStorage.getItem(`chart.${index}.window`)) || 30;
    this.legend = element("div", { className: "legend" });
    this.plot = element("div", { className: "plot" });
    const span = element("select", { title: "seconds shown", onchange: (event) => this.setWindow(Number(event.target.value)) },
      ...WINDOWS.map((seconds) => element("option", { value: seconds, selected: seconds === this.window }, `${seconds} s`)));
    place.append(element("header", {}, this.legend, element("div", { className: "right" }, span)), this.plot);
    this.addMenu(place, description);
    this.select(this.stored() ?? DEFAULTS[index]);
    telemetry.addEventListener("frame", ({ detail }) => this.take(detail));
    telemetry.addEventListener("close", () => this.gap());
    new ResizeObserver(() => this.resize()).observe(this.plot);
    setInterval(() => this.draw(), PERIOD);
  }

  addMenu(place, description) {
    this.menu = new ChartMenu(description, (names) => { this.select(names); localStorage.setItem(`chart.${this.index}.signals`, JSON.stringify(names)); });
    const choose = element("button", { title: "choose signals", onclick: () => this.menu.toggle(this.names) }, "Signals");
    place.querySelector("header .right").append(choose);
    place.append(this.menu.place);
  }

  stored() {
    const names = JSON.parse(localStorage.getItem(`chart.${this.index}.signals`) ?? "null");
    return Array.isArray(names) && names.every((name) => this.signals.has(name)) ? names : null;
  }

  setWindow(seconds) {
    this.window = seconds;
    localStorage.setItem(`chart.${this.index}.window`, String(seconds));
  }

  select(names) {
    this.names = names;
    this.telemetry.want(`chart.${this.index}`, names);
    this.data = [[], ...names.map(() => [])];
    const others = [...OTHERS];
    const styles = names.map((name) => this.style(name, others));
    this.outputs = names.map((name) => (isReference(name) ? null : element("output")));
    const entries = names.map((name, i) => {
      if (isReference(name)) return null; // they have the colours of what they are the reference of
      const { label, group, unit } = this.signals.get(name);
      return this.entry(label, `${group} ${label}${unit ? `, ${unit}` : ""}`, styles[i].stroke, this.outputs[i]);
    }).filter(Boolean);
    if (names.some(isReference)) entries.push(this.entry("reference", "dashed", "#84909b"));
    this.legend.replaceChildren(...entries);
    this.uplot?.destroy();
    this.uplot = new uPlot(this.options(names, styles), this.data, this.plot);
  }

  style(name, others) {
    const axis = name.split(".").at(-1), dash = isReference(name) || name.startsWith("truth.position.") ? [5, 4] : undefined;
    return { stroke: AXIS[axis] ?? others.shift() ?? "#d5dbe1", dash };
  }

  figure(value) { return fixed(value, Math.abs(value) < 100 ? 3 : 1); }

  range(low, high, units) { return spread(low, high, units); }

  entry(label, title, color, output = "") {
    const entry = element("span", { title }, label, output);
    entry.style.setProperty("--c", color);
    entry.classList.toggle("dashed", title === "dashed");
    return entry;
  }

  options(names, styles) {
    const line = { stroke: "#7d8994", font: "11px system-ui", grid: { stroke: "#1d252c", width: 1 }, ticks: { show: false } };
    const units = new Set(names.map((name) => this.signals.get(name).unit));
    return {
      width: Math.max(50, this.plot.clientWidth), height: Math.max(50, this.plot.clientHeight),
      legend: { show: false }, cursor: { drag: { x: false, y: false }, points: { show: false } }, padding: [6, 16, 0, 0],
      scales: { x: { time: false }, y: { range: (_, low, high) => this.range(low, high, units) } },
      axes: [
        { ...line, size: 20, gap: 3, values: (_, ticks) => ticks.map((tick) => axisTime(tick - this.now())), splits: () => this.ticks() },
        { ...line, size: 52, gap: 5, label: [...units].filter(Boolean).join(", ") || undefined, labelSize: 15, labelGap: 0, labelFont: "11px system-ui" },
      ],
      series: [{}, ...names.map((name, i) => ({ label: name, stroke: styles[i].stroke, dash: styles[i].dash, width: 1.4, points: { show: false }, spanGaps: false }))],
    };
  }

  take({ time, value }) {
    this.data[0].push(time);
    this.names.forEach((name, i) => this.data[i + 1].push(Number.isFinite(value[name]) ? value[name] : null));
    this.offset = time - performance.now() / 1e3;
    const first = this.data[0].findIndex((stamp) => stamp > time - KEEP);
    if (first > 100) for (const column of this.data) column.splice(0, first); // in slices: it costs
  }

  gap() {
    const last = this.data[0].at(-1);
    if (last === undefined) return;
    this.data[0].push(last + 1e-3);
    for (const column of this.data.slice(1)) column.push(null);
  }

  now() { return this.offset === undefined ? 0 : performance.now() / 1e3 + this.offset; }

  ticks() {
    const step = this.window / 5, now = this.now();
    return [5, 4, 3, 2, 1, 0].map((i) => now - i * step);
  }

  draw() {
    if (document.hidden || this.offset === undefined) return;
    const now = this.now();
    this.uplot.batch(() => {
      this.uplot.setData(this.data, false);
      this.uplot.setScale("x", { min: now - this.window, max: now });
    });
    this.names.forEach((_, i) => {
      if (this.outputs[i] === null) return;
      const value = this.data[i + 1].at(-1), text = value === null || value === undefined ? "–" : this.figure(value);
      if (this.outputs[i].textContent !== text) this.outputs[i].textContent = text;
    });
  }

  resize() { this.uplot.setSize({ width: this.plot.clientWidth, height: this.plot.clientHeight }); }
}

const isReference = (name) => name.startsWith("reference.");

// A little air, and a least height for each unit: noise should look like noise.
const LEAST = { m: 0.02, "m/s": 0.05, "m/s²": 0.2, "°": 1, "°/s": 2, N: 0.5, "N m": 0.02, kg: 0.01, V: 0.2, mm: 2, ms: 5, "µs": 50, count: 2, "%": 1, Hz: 2 };

function spread(low, high, units) {
  if (low === null || high === null) return [-1, 1];
  const least = Math.max(0.01, ...[...units].map((unit) => LEAST[unit] ?? 0)), height = high - low;
  const room = Math.max(0.08 * height, 0.5 * (least - height));
  return [low - room, high + room];
}

function axisTime(seconds) { return Math.abs(seconds) < 0.05 ? "now" : `−${Math.round(-seconds)} s`; }
