// One live chart of any signals over a shared time axis: uPlot draws scales and axes, its lines are ours.

import { indexAt } from "./history.js";
import { extent, isReference, spread, stylesOf, trace } from "./lines.js";
import { pointing } from "./pointer.js";
import { LONGEST } from "./time_axis.js";
import { element } from "../core/dom.js";
import { fixed } from "../core/format.js";

const PERIOD = 66; // ms between two drawings at most
const READ = 125; // ms between two readings of the newest values
const FONT = "11px system-ui, sans-serif";
const STEPS = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300]; // s between ticks
const EMPTY = [[0, 1], [0, 0]]; // uPlot wants some data; the lines take theirs from the history

export class Chart {
  names; units; styles; labels; ends; outputs; uplot; piece; drawn; pointer; isSeen; grow; less; // of what is selected and drawn

  // axis: TimeAxis; signals: name → { label, unit, group, topic }; who: this chart, to the history
  constructor(place, { axis, signals, who, names = [], scales = {} }) {
    this.place = place; this.axis = axis; this.signals = signals; this.who = who;
    this.scales = { ...scales }; // unit → [low, high] where fixed
    this.due = this.read = 0;
    this.legend = element("div", { className: "legend" });
    this.tools = element("div", { className: "right" });
    this.line = element("i", { className: "cursor", hidden: true });
    this.plot = element("div", { className: "plot", tabIndex: 0, role: "group", ariaRoleDescription: "chart" }, this.line);
    this.shown = new AbortController();
    place.append(element("header", {}, this.legend, this.tools), this.plot);
    this.select(names);
    pointing(this);
    axis.addEventListener("point", () => this.point(), { signal: this.shown.signal });
    this.sizes = new ResizeObserver(() => this.resize());
    this.sizes.observe(this.plot);
  }

  // For good.
  close() {
    this.shown.abort();
    this.sizes.disconnect();
    this.axis.history.want(this.who, []);
    this.drop();
  }

  // uPlot's first drawing, which may be still to come, must not find it destroyed.
  drop() {
    const { uplot } = this;
    this.uplot = undefined;
    uplot?.root.remove();
    setTimeout(() => uplot?.destroy());
  }

  select(names) {
    this.names = names;
    this.units = [...new Set(names.map((name) => this.signals.get(name).unit))];
    this.axis.history.want(this.who, names);
    this.styles = this.stylesOf(names);
    this.labels = this.labelsOf(names);
    this.ends = names.map(() => null);
    this.outputs = names.map((name) => (this.isMerged(name) ? null : element("output")));
    this.legend.replaceChildren(...this.entries());
    this.plot.ariaLabel = names.length ? `${names.map((name) => this.title(name)).join(", ")} over time` : "empty chart";
    this.rebuild();
  }

  setScale(unit, bounds) {
    if (bounds) this.scales[unit] = bounds;
    else delete this.scales[unit];
    this.drawn = -1;
    this.due = 0;
  }

  rebuild() {
    this.drop();
    this.uplot = new uPlot(this.options(), [EMPTY[0], ...this.names.map(() => EMPTY[1])], this.plot);
    this.drawn = -1;
    this.due = 0;
  }

  stylesOf(names) { return stylesOf(names); }
  figure(value) { return fixed(value, Math.abs(value) < 100 ? 3 : 1); }
  range(unit, low, high) { return this.scales[unit] ?? spread(low, high, unit); }

  title(name) {
    const { label, group, unit } = this.signals.get(name);
    return `${group === label ? "" : `${group} `}${label}${unit ? `, ${unit}` : ""}`;
  }

  // Beside the position it is the reference of, a reference needs no entry of its own.
  isMerged(name) { return isReference(name) && this.names.includes(name.replace("reference.", "state.")); }

  // As short as they can be told apart.
  labelsOf(names) {
    const own = names.filter((name) => !this.isMerged(name)), short = own.map((name) => this.signals.get(name).label);
    return names.map((name) => {
      if (this.isMerged(name)) return "";
      const { label, group } = this.signals.get(name);
      return short.filter((other) => other === label).length > 1 ? `${group} ${label}` : label;
    });
  }

  entries() {
    const entries = this.names.map((name, i) => this.outputs[i] && this.entry(this.labels[i], this.title(name), this.styles[i], this.outputs[i], this.units.length > 1 ? this.signals.get(name).unit : "")).filter(Boolean);
    if (this.names.some((name) => this.isMerged(name))) entries.push(this.entry("reference", "the reference, in the same colours", { stroke: "#84909b", dash: [5, 4] }));
    return entries;
  }

  entry(label, title, style, output = "", unit = "") {
    const entry = element("span", { title }, label, output, unit);
    entry.style.setProperty("--line-style", pattern(style));
    return entry;
  }

  options() {
    const line = { stroke: "#8b97a2", font: FONT, ticks: { show: false } }, grid = { stroke: "#1d252c", width: 1 };
    const units = this.units.length ? this.units : [""];
    return {
      width: Math.max(50, this.plot.clientWidth), height: Math.max(50, this.plot.clientHeight),
      legend: { show: false }, cursor: { show: false }, padding: [6, this.units.length > 1 ? 2 : 8, 0, 0],
      scales: { x: { time: false }, ...Object.fromEntries(units.map((unit, i) => [`y${i}`, this.scale(unit)])) },
      axes: [
        { ...line, grid, size: 20, gap: 3, values: (_, ticks) => ticks.map((tick) => this.tick(tick)), splits: () => this.ticks() },
        ...units.map((unit, i) => ({ ...line, grid: i ? { show: false } : grid, scale: `y${i}`, side: i ? 1 : 3, size: 48, gap: 5, label: unit || undefined, labelSize: 15, labelGap: 0, labelFont: FONT })),
      ],
      series: [{}, ...this.names.map((name, i) => ({
        scale: `y${units.indexOf(this.signals.get(name).unit)}`, auto: false, ...this.styles[i], width: 1.4,
        points: { show: false }, paths: (u, index) => this.path(u, index - 1),
      }))],
      hooks: { draw: [(u) => this.drawEnds(u)] },
    };
  }

  scale(unit) { return { range: () => this.rangeOf(unit) }; }

  rangeOf(unit) {
    let low = null, high = null;
    if (this.piece) this.names.forEach((name) => {
      const column = this.signals.get(name).unit === unit && this.piece.source.column(name);
      if (column) [low, high] = extent(column, this.piece.from, this.piece.to, low, high);
    });
    return this.range(unit, low, high);
  }

  path(u, i) {
    this.ends[i] = null;
    const column = this.piece?.source.column(this.names[i]);
    if (!column) return null;
    const { left, width, top, height } = u.bbox, { min, max } = u.scales.x, key = u.series[i + 1].scale, y = u.scales[key];
    const slope = width / (max - min), rise = height / (y.max - y.min);
    const yOf = y.distr === 3 ? (value) => u.valToPos(value, key, true) : (value) => top + (y.max - value) * rise;
    const { path, end } = trace(this.piece.source.times, column, this.piece.from, this.piece.to, (time) => left + (time - min) * slope, yOf);
    this.ends[i] = end;
    return { stroke: path, fill: null, clip: null, band: null, gaps: null, flags: 1 };
  }

  // The name of each line where it ends, moved apart where they would cover each other.
  drawEnds(u) {
    const { ctx, bbox } = u, ratio = devicePixelRatio, least = 11 * ratio, right = bbox.left + bbox.width;
    const ends = this.labels.map((label, i) => ({ label, end: this.ends[i], color: this.styles[i].stroke })).filter(({ label, end }) => label && end);
    if (!ends.length || this.names.length < 2) return;
    ends.sort((a, b) => a.end[1] - b.end[1]);
    let below = bbox.top - least / 2;
    for (const one of ends) below = one.y = Math.max(below + least, Math.min(one.end[1], bbox.top + bbox.height));
    let above = bbox.top + bbox.height + least / 2;
    for (const one of ends.reverse()) above = one.y = Math.min(one.y, above - least);
    ctx.save();
    ctx.font = `${11 * ratio}px system-ui, sans-serif`;
    ctx.textBaseline = "middle";
    ctx.textAlign = "left";
    for (const { label, end, y, color } of ends) {
      const text = label.length > 18 ? `${label.slice(0, 17)}…` : label, wide = ctx.measureText(text).width;
      const x = Math.min(end[0] + 5 * ratio, right - wide - 2 * ratio);
      if (x < end[0]) { ctx.fillStyle = "rgb(18 23 28 / .8)"; ctx.fillRect(x - 2 * ratio, y - least / 2, wide + 4 * ratio, least); }
      ctx.fillStyle = color;
      ctx.fillText(text, x, y);
    }
    ctx.restore();
  }

  // Room on the right of what runs, in CSS pixels, for the lines' names.
  get room() { return this.names.length < 2 ? 6 : 10 + Math.min(100, 6 * Math.max(...this.labels.map((label) => Math.min(18, label.length)))); }

  draw(at = performance.now()) {
    const { axis, uplot } = this;
    if (!this.isSeen || !axis.isKnown || !uplot) return; // also not in a tab that is hidden
    if (axis.paused ? this.drawn === axis.version : at < this.due) return;
    this.drawn = axis.version;
    const source = axis.source, [min, to] = axis.span, width = Math.max(60, uplot.bbox.width / devicePixelRatio);
    const max = axis.zoom ? to : to + (to - min) * this.room / Math.max(40, width - this.room);
    this.piece = {
      source,
      from: Math.max(source.start, indexAt(source.times, min, source.start, source.end) - 1),
      to: Math.min(source.end, indexAt(source.times, max, source.start, source.end) + 1),
    };
    this.due = at + Math.max(PERIOD, 500 * (max - min) / width); // half a pixel later
    uplot.setScale("x", { min, max });
    if (this.pointer !== undefined && !axis.paused) axis.point(this.timeAt(this.pointer)); // it runs on under the pointer
    if (at - this.read >= READ || axis.paused) { this.read = at; this.readOut(); }
  }

  // css: pixels from the left of the plot
  timeAt(css) {
    const { left, width } = this.uplot.bbox, { min, max } = this.uplot.scales.x;
    return min + (css * devicePixelRatio - left) / width * (max - min);
  }

  // The shared cursor and the values at it.
  point() {
    const { cursor } = this.axis, { left, width, top, height } = this.uplot?.bbox ?? {};
    const { min, max } = this.uplot?.scales.x ?? {};
    const isIn = cursor !== null && cursor >= min && cursor <= max;
    this.line.hidden = !isIn;
    if (isIn) {
      this.line.style.transform = `translateX(${((left + (cursor - min) / (max - min) * width) / devicePixelRatio).toFixed(1)}px)`;
      Object.assign(this.line.style, { top: `${top / devicePixelRatio}px`, height: `${height / devicePixelRatio}px` });
    }
    this.readOut();
  }

  // At the cursor, else the newest: what is old keeps its last value and is marked as old.
  readOut() {
    const { axis } = this, { source } = axis, isPast = axis.cursor !== null || axis.paused;
    const time = axis.cursor ?? axis.span[1], at = indexAt(source.times, time, source.start, source.end) - 1;
    this.names.forEach((name, i) => {
      const output = this.outputs[i];
      if (!output) return;
      const value = at < source.start ? NaN : source.column(name)?.[at];
      if (isPast === (output.dataset.topic !== undefined)) { // by what is now, or by what was then
        if (isPast) { delete output.dataset.topic; output.classList.remove("stale"); } else output.dataset.topic = this.signals.get(name).topic;
      }
      const text = this.figure(value);
      if (output.textContent !== text && (isPast || Number.isFinite(value) || output.textContent === "")) output.textContent = text;
    });
  }

  ticks() {
    const { min, max } = this.uplot?.scales.x ?? {}, { axis } = this, end = axis.paused ? max : axis.now;
    if (!(max - min > 0 && max - min < 2 * LONGEST)) return [];
    const most = Math.max(2, this.uplot.bbox.width / devicePixelRatio / 70), step = STEPS.find((one) => (max - min) / one <= most) ?? LONGEST;
    const last = axis.paused ? Math.floor(end / step) * step : end - Math.ceil(Math.max(0, end - max) / step) * step, ticks = [];
    for (let tick = last; tick >= min; tick -= step) ticks.push(tick);
    return ticks.reverse();
  }

  // Before now while it runs, by the clock while it is paused.
  tick(time) {
    const before = this.axis.now - time;
    if (this.axis.paused) return clock(time, this.axis.span);
    if (before < 0.05) return "now";
    return before > 119.5 ? `−${Number((before / 60).toFixed(1))} min` : `−${Math.round(before)} s`;
  }

  resize() {
    this.isSeen = this.plot.clientWidth > 0;
    if (!this.uplot || !this.isSeen) return;
    this.uplot.setSize({ width: this.plot.clientWidth, height: this.plot.clientHeight });
    this.drawn = -1;
    this.due = 0;
  }
}

// 14:03:27, with tenths when that is what is looked at.
export function clock(time, [from, to] = [0, 60]) {
  const text = new Date(time * 1e3).toTimeString().slice(0, 8);
  return to - from > 6 ? text : `${text}.${Math.floor(time * 10) % 10}`;
}

// A background that looks as the line does.
function pattern({ stroke, dash }) {
  if (!dash?.length) return stroke;
  let at = 0;
  const stops = dash.map((length, i) => `${i % 2 ? "transparent" : stroke} ${at}px ${at += length}px`);
  return `repeating-linear-gradient(to right, ${stops.join(", ")})`;
}
