// Live figures of a calibration over its time: one small plot a unit, with one time axis. A figure
// called `X deviation` is drawn as a band about X.

import { labelAndUnit } from "./labels.js";
import { element } from "../core/dom.js";
import { axisLook, faint, onTheme, paint } from "../core/theme.js";

const MOST = 4000; // samples: at 5 Hz a quarter of an hour
const PLOTS = 3;
const HEIGHTS = [170, 120, 96]; // px, of one, two or three
const COLORS = ["var(--text)", "var(--teal)", "var(--violet)", "var(--gold)"];
const AXES = { x: "var(--x)", y: "var(--y)", z: "var(--z)" };
const BAND = / deviation$/; // as in experiments/guide.js

export class LivePlots {
  plots;
  times;
  columns;
  units;
  built; // set by clear()

  constructor() {
    this.place = element("div", { className: "live-plots" });
    this.clear();
    onTheme(this.place, () => {
      for (const { uplot } of this.plots) uplot.redraw(false);
    });
    new ResizeObserver(() => this.resize()).observe(this.place);
  }

  clear() {
    for (const { uplot } of this.plots ?? []) uplot.destroy();
    this.plots = [];
    this.place.replaceChildren();
    this.times = [];
    this.columns = new Map(); // name → values, null where there is none
    this.units = new Map();
    this.built = "";
  }

  // One sample: time in s since the start; live: figures of the status.
  add(time, live) {
    const last = this.times.at(-1);
    if (time === last) return;
    if (time < last) this.clear();
    this.times.push(time);
    for (const { name, unit } of live) {
      if (!this.columns.has(name)) this.columns.set(name, Array(this.times.length - 1).fill(null));
      this.units.set(name, unit);
    }
    for (const [name, column] of this.columns)
      column.push(live.find((one) => one.name === name)?.value ?? null);
    if (this.times.length > MOST)
      for (const column of [this.times, ...this.columns.values()]) column.splice(0, MOST / 4);
  }

  draw() {
    if (!this.place.clientWidth || this.times.length < 2) return;
    const names = [...this.columns.keys()].join("|");
    if (names !== this.built) {
      this.built = names;
      this.build();
    }
    for (const { uplot, series } of this.plots)
      uplot.setData([this.times, ...series.map(({ values }) => values())]);
  }

  build() {
    for (const { uplot } of this.plots) uplot.destroy();
    const lines = [...this.columns.keys()].filter((name) => !BAND.test(name));
    const units = [...new Set(lines.map((name) => this.units.get(name)))].slice(0, PLOTS);
    this.plots = units.map((unit, i) =>
      this.plot(
        unit,
        lines.filter((name) => this.units.get(name) === unit),
        HEIGHTS[units.length - 1],
        i === units.length - 1,
      ),
    );
    this.place.replaceChildren(...this.plots.map(({ place }) => place));
  }

  plot(unit, names, height, isLast) {
    const series = [],
      bands = [];
    names.forEach((name, i) => {
      const stroke = colorOf(name, i),
        column = () => this.columns.get(name),
        spread = `${name} deviation`;
      series.push({ stroke, width: 1.4, values: column });
      if (!this.columns.has(spread)) return;
      const edge = (sign) => () =>
        column().map((value, k) =>
          value === null || this.columns.get(spread)[k] === null
            ? null
            : value + sign * this.columns.get(spread)[k],
        );
      bands.push({ series: [series.length + 1, series.length + 2], fill: () => paint(faint(stroke, 18)) });
      series.push(
        { stroke: faint(stroke, 33), width: 0.6, values: edge(1) },
        { stroke: faint(stroke, 33), width: 0.6, values: edge(-1) },
      );
    });
    const text = `${names.join(", ")}${unit ? `, ${unit}` : ""}`,
      canvas = element("div", {
        className: "plot",
        role: "img",
        ariaLabel: `${text} over the time of the calibration`,
      });
    const legend = element(
      "p",
      { className: "legend" },
      ...names.map((name, i) => {
        const entry = element("span", {}, name);
        entry.style.setProperty("--c", colorOf(name, i));
        return entry;
      }),
      unit ? `in ${unit}` : "",
      bands.length ? ", with its standard deviation" : "",
    );
    const line = axisLook();
    const uplot = new uPlot(
      {
        width: Math.max(80, this.place.clientWidth),
        height: height + (isLast ? 16 : 0),
        legend: { show: false },
        cursor: { show: false },
        padding: [6, 6, 0, 0],
        scales: { x: { time: false }, y: { range: (_, low, high) => room(low, high) } },
        axes: [
          {
            ...line,
            size: isLast ? 20 : 4,
            gap: 3,
            values: (_, ticks) => ticks.map((tick) => (isLast ? `${tick} s` : "")),
          },
          { ...line, size: 50, gap: 5, space: 26 },
        ],
        series: [
          {},
          ...series.map(({ stroke, width }) => ({
            stroke: () => paint(stroke),
            width,
            points: { show: false },
          })),
        ],
        bands,
      },
      [this.times, ...series.map(({ values }) => values())],
      canvas,
    );
    return { uplot, series, place: element("figure", {}, legend, canvas) };
  }

  resize() {
    const width = this.place.clientWidth;
    if (width > 80) for (const { uplot } of this.plots) uplot.setSize({ width, height: uplot.height });
  }
}

// Figures about x, y, z (also Ixx, inertia_yy) have the colours these have everywhere.
function colorOf(name, i) {
  const [, axis] = /(?:^|[^a-z])(?:[a-z]*?)(x|y|z)\1?$/i.exec(labelAndUnit(name)[0]) ?? [];
  return AXES[axis?.toLowerCase()] ?? COLORS[i % COLORS.length];
}

// A little of both ends; a constant in the middle.
function room(low, high) {
  if (!Number.isFinite(low) || !Number.isFinite(high)) return [0, 1];
  const spread = high - low || 0.02 * Math.max(1e-3, Math.abs(high));
  return [low - 0.08 * spread, high + 0.08 * spread];
}
