// A chart of any signals over a time axis: uPlot draws scales and axes, its lines are ours.
// Its axis is a TimeAxis or a replay's Range. Its source says what there is, live or recorded:
//   signals: name → { label, unit, group, topic }
//   lines(names, styles): [{ name, stroke, dash, … }] of what was chosen; `second` ones have no name
//   samples(line, from, to): { times, values, from, to, shift, holes } of a time, or undefined
//   read(output, line, figure): writes the value that belongs to the cursor or to now
// figures(line, from, to): statistics of a time, see figures.js; table(names, from, to): groups of columns,
// see save.js

import { FigureTable } from "./figures.js";
import { extent, isReference, spread, stylesOf, trace } from "./lines.js";
import { drawEnds, drawMarks } from "./marks.js";
import { pointing } from "./pointer.js";
import { element } from "../core/dom.js";
import { fixed } from "../core/format.js";
import { axisLook, paint, theme } from "../core/theme.js";

const BARE = 6; // CSS pixels on the right of lines without names
const PERIOD = 30; // ms between two drawings at least: each frame of the telemetry is drawn
const READ = 125; // ms between two readings of the newest values
const COUNT = 500; // ms between two statistics of what runs
const EMPTY = [
  [0, 1],
  [0, 0],
]; // uPlot wants some data; the lines take theirs from the source

export class Chart {
  names;
  lines;
  units;
  ends;
  outputs;
  uplot;
  drawn;
  pointer;
  isSeen;
  grow;
  less; // of what is selected and drawn

  constructor(
    place,
    { axis, source, names = [], scales = {}, limits = {}, hasFigures = false, hasEvents = false },
  ) {
    this.place = place;
    this.axis = axis;
    this.source = source;
    this.scales = { ...scales }; // unit → [low, high] where fixed
    this.limits = { ...limits }; // unit → where a line is drawn across
    this.hasFigures = hasFigures;
    this.hasEvents = hasEvents;
    this.due = this.read = this.counted = 0;
    this.pieces = []; // samples of each line
    // scrolls where it is long
    this.legend = element("div", { className: "legend", role: "group", ariaLabel: "legend", tabIndex: 0 });
    this.tools = element("div", { className: "right" });
    this.cursor = element("i", { className: "cursor", hidden: true });
    this.head = element("i", { className: "playhead", hidden: true });
    this.plot = element(
      "div",
      { className: "plot", role: "group", ariaRoleDescription: "chart" },
      this.cursor,
      this.head,
    );
    this.shown = new AbortController();
    this.figures = new FigureTable(this);
    place.append(element("header", {}, this.legend, this.tools), this.figures.place, this.plot);
    this.set("hasFigures", hasFigures);
    this.select(names);
    this.attach();
    axis.addEventListener(
      "point",
      () => {
        this.moveLines();
        this.readOut();
      },
      { signal: this.shown.signal },
    );
    theme.addEventListener(
      "change",
      () => {
        this.uplot?.redraw(false);
        this.refresh();
      },
      { signal: this.shown.signal },
    );
    this.sizes = new ResizeObserver(() => this.resize());
    this.sizes.observe(this.plot);
  }

  attach() {
    pointing(this);
  }

  get xName() {
    return "time_s";
  }

  // Whether statistics, or the lines of events, are shown.
  set(name, value) {
    this[name] = value;
    this.figures.place.hidden = !this.hasFigures || !this.source.figures;
    this.refresh();
    if (this.axis.paused) this.draw();
  }

  setLimit(unit, value) {
    if (Number.isFinite(value)) this.limits[unit] = value;
    else delete this.limits[unit];
    this.refresh();
    if (this.axis.paused) this.draw();
  }

  // For good.
  close() {
    this.shown.abort();
    this.sizes.disconnect();
    this.source.lines([], []);
    this.drop();
  }

  // uPlot's first drawing, which may be still to come, must not find it destroyed.
  drop() {
    const { uplot } = this;
    this.uplot = undefined;
    uplot?.root.remove();
    setTimeout(() => uplot?.destroy());
  }

  signal(name) {
    return this.source.signals.get(name);
  }

  select(names) {
    this.names = names;
    this.units = [...new Set(names.map((name) => this.signal(name).unit))];
    const labels = this.labelsOf(names);
    this.lines = this.source.lines(names, this.stylesOf(names)).map((line) => ({
      ...line,
      unit: this.signal(line.name).unit,
      label: line.label ?? (line.second ? "" : labels[names.indexOf(line.name)]),
    }));
    this.ends = this.lines.map(() => null);
    this.outputs = this.lines.map((line) => (line.label || line.second ? element("output") : null));
    this.legend.replaceChildren(...this.entries());
    this.plot.ariaLabel = names.length
      ? `${names.map((name) => this.title(name)).join(", ")} over time`
      : "empty chart";
    this.rebuild();
  }

  setScale(unit, bounds) {
    if (bounds) this.scales[unit] = bounds;
    else delete this.scales[unit];
    this.refresh();
  }

  rebuild() {
    this.drop();
    this.uplot = new uPlot(this.options(), [EMPTY[0], ...this.lines.map(() => EMPTY[1])], this.plot);
    this.refresh();
  }

  // Draws at the next occasion even where it stands still.
  refresh() {
    this.drawn = -1;
    this.due = this.counted = 0;
  }

  stylesOf(names) {
    return stylesOf(names);
  }
  figure(value) {
    return fixed(value, Math.abs(value) < 100 ? 3 : 1);
  }
  range(unit, low, high) {
    return this.scales[unit] ?? spread(low, high, unit);
  }

  title(name) {
    const { label, group, unit } = this.signal(name);
    return `${group === label ? "" : `${group} `}${label}${unit ? `, ${unit}` : ""}`;
  }

  // Beside the position it is the reference of, a reference needs no entry of its own.
  isMerged(name) {
    return isReference(name) && this.names.includes(name.replace("reference.", "state."));
  }

  // As short as they can be told apart; none of what is merged.
  labelsOf(names) {
    const short = names.filter((name) => !this.isMerged(name)).map((name) => this.signal(name).label);
    return names.map((name) => {
      if (this.isMerged(name)) return "";
      const { label, group } = this.signal(name);
      return short.filter((other) => other === label).length > 1 ? `${group} ${label}` : label;
    });
  }

  entries() {
    const entries = [];
    this.lines.forEach((line, i) => {
      if (line.label && this.isListed(line))
        entries.push(this.entry(line, this.outputs[i], this.second(line)));
    });
    if (this.names.some((name) => this.isMerged(name))) {
      const title = "the reference, in the same colours";
      entries.push(this.entry({ name: "", label: "reference", title, stroke: "var(--dim)", dash: [5, 4] }));
    }
    return entries;
  }

  isListed(_line) {
    return true;
  }
  // A background that looks as the line does.
  pattern(stroke, dash) {
    if (!dash?.length) return stroke;
    let at = 0;
    const stops = dash.map((length, i) => `${i % 2 ? "transparent" : stroke} ${at}px ${(at += length)}px`);
    return `repeating-linear-gradient(to right, ${stops.join(", ")})`;
  }

  // The value of the same signal in another run.
  second({ name }) {
    const output = this.outputs[this.lines.findIndex((line) => line.second && line.name === name)];
    if (output) output.className = "second";
    return output ?? "";
  }

  entry({ name, label, title = this.title(name), unit = "", stroke, dash }, output = "", second = "") {
    const entry = element("span", { title }, label, output, second, this.units.length > 1 ? unit : "");
    entry.style.setProperty("--line-style", this.pattern(stroke, dash));
    return entry;
  }

  options() {
    const line = axisLook();
    const units = this.units.length ? this.units : [""],
      { axis } = this;
    const most = (u) => Math.max(2, u.bbox.width / devicePixelRatio / 70);
    return {
      ...this.size(),
      legend: { show: false },
      cursor: { show: false },
      padding: [6, this.units.length > 1 ? 2 : 8, 0, 0],
      scales: {
        x: { time: false },
        ...Object.fromEntries(units.map((unit, i) => [`y${i}`, this.scale(unit)])),
      },
      axes: [
        {
          ...line,
          size: 20,
          gap: 3,
          splits: (u, _, min, max) => axis.ticks(min, max, most(u)),
          values: (_, ticks) => ticks.map((tick) => axis.label(tick)),
        },
        ...units.map((unit, i) => ({
          ...line,
          ...(i ? { grid: { show: false } } : {}),
          scale: `y${i}`,
          side: i ? 1 : 3,
          size: 48,
          gap: 5,
          label: this.axisTitle(unit) || undefined,
          labelSize: 15,
          labelGap: 0,
        })),
      ],
      series: [
        {},
        ...this.lines.map(({ unit, stroke, dash, width = 1.4 }) => ({
          scale: `y${units.indexOf(unit)}`,
          auto: false,
          stroke: () => paint(stroke),
          dash,
          width,
          points: { show: false },
          paths: (u, index) => this.path(u, index - 1),
        })),
      ],
      hooks: {
        drawClear: [(u) => drawMarks(u, this)],
        draw: [
          (u) => {
            this.drawEnds(u);
            this.moveLines();
          },
        ],
      },
    };
  }

  // "Tracking error [m]": what all lines of a unit have in common, else the unit.
  axisTitle(unit) {
    const groups = new Set(
        this.names
          .filter((name) => !this.isMerged(name) && this.signal(name).unit === unit)
          .map((name) => this.signal(name).group),
      ),
      [group] = groups;
    if (groups.size !== 1 || !group) return unit;
    return `${group.charAt(0).toUpperCase()}${group.slice(1)}${unit ? ` [${unit}]` : ""}`;
  }

  // Never so small that uPlot finds no room for its axes.
  size() {
    return { width: Math.max(160, this.plot.clientWidth), height: Math.max(50, this.plot.clientHeight) };
  }

  scale(unit) {
    return { range: () => this.rangeOf(unit) };
  }

  // Least and greatest of what is shown in a unit; null of nothing.
  extentOf(unit) {
    let low = /** @type {number | null} */ (null),
      high = /** @type {number | null} */ (null);
    this.pieces.forEach((piece, i) => {
      if (piece && this.lines[i]?.unit === unit)
        [low, high] = extent(piece.values, piece.from, piece.to, low, high);
    });
    return [low, high];
  }

  rangeOf(unit) {
    let [low, high] = this.extentOf(unit);
    if (unit in this.limits && low !== null && high !== null)
      [low, high] = [Math.min(low, this.limits[unit]), Math.max(high, this.limits[unit])];
    return this.range(unit, low, high);
  }

  path(u, i) {
    this.ends[i] = null;
    const piece = this.pieces[i];
    if (!piece) return null;
    const { times, values, from, to, shift = 0 } = piece,
      key = u.series[i + 1].scale,
      y = u.scales[key];
    const { left, width, top, height } = u.bbox,
      { min, max } = u.scales.x;
    const slope = width / (max - min),
      rise = height / (y.max - y.min);
    const yOf =
      y.distr === 3 ? (value) => u.valToPos(value, key, true) : (value) => top + (y.max - value) * rise;
    const { path, end } = trace(times, values, from, to, (time) => left + (time - shift - min) * slope, yOf);
    this.ends[i] = end;
    return { stroke: path, fill: null, clip: null, band: null, gaps: null, flags: 1 };
  }

  drawEnds(u) {
    // A replay's lines go to the edge.
    const hasRoom = this.axis.head === null && this.room(u.bbox.width / devicePixelRatio) !== BARE;
    if (hasRoom) drawEnds(u, this.lines, this.ends);
  }

  // Room on the right of what runs, in CSS pixels, for the lines' names; none where they would take a third.
  /** @param {number} width */
  room(width) {
    if (this.names.length < 2) return BARE;
    const room = 10 + Math.min(100, 6 * Math.max(...this.lines.map(({ label }) => label.length)));
    return 3 * room < width ? room : BARE;
  }

  draw(at = performance.now()) {
    const { axis, uplot } = this;
    if (!this.isSeen || !axis.isKnown || !uplot) return; // also not in a tab that is hidden
    if (axis.paused ? this.drawn === axis.version : at < this.due) return;
    this.drawn = axis.version;
    const [min, to] = axis.span,
      width = Math.max(60, uplot.bbox.width / devicePixelRatio),
      room = this.room(width);
    const max = axis.hasRoom ? to + ((to - min) * room) / Math.max(40, width - room) : to;
    this.pieces = this.lines.map((line) => this.source.samples(line, min, max));
    this.due = at + Math.max(PERIOD, (500 * (max - min)) / width); // half a pixel later
    this.show(min, max);
    if (this.hasFigures && this.source.figures && (axis.paused || at >= this.counted)) {
      this.counted = at + COUNT;
      this.figures.draw();
    }
    // It runs on under the pointer.
    if (this.pointer !== undefined && !axis.paused) axis.point(this.timeAt(this.pointer));
    if (at - this.read >= READ || axis.paused) {
      this.read = at;
      this.readOut();
    }
  }

  show(min, max) {
    this.uplot.setScale("x", { min, max });
  }

  // css: pixels from the left of the plot
  timeAt(css) {
    const { left, width } = this.uplot.bbox,
      { min, max } = this.uplot.scales.x;
    return min + ((css * devicePixelRatio - left) / width) * (max - min);
  }

  // The shared cursor and a replay's play-head.
  moveLines() {
    const { left, width, top, height } = this.uplot?.bbox ?? {},
      { min, max } = this.uplot?.scales.x ?? {};
    for (const [line, time] of [
      [this.cursor, this.axis.cursor],
      [this.head, this.axis.head],
    ]) {
      line.hidden = !(time !== null && time >= min && time <= max);
      if (line.hidden) continue;
      const x = (left + ((time - min) / (max - min)) * width) / devicePixelRatio;
      line.style.transform = `translateX(${x.toFixed(1)}px)`;
      Object.assign(line.style, {
        top: `${top / devicePixelRatio}px`,
        height: `${height / devicePixelRatio}px`,
      });
    }
  }

  readOut() {
    this.lines.forEach((line, i) => {
      if (this.outputs[i]) this.source.read(this.outputs[i], line, (value) => this.figure(value));
    });
  }

  resize() {
    this.isSeen = this.plot.clientWidth > 0;
    if (!this.uplot || !this.isSeen) return;
    this.uplot.setSize(this.size());
    this.refresh();
    if (this.axis.paused) this.draw();
  }
}
