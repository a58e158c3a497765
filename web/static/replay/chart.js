// A chart of any recorded signals of one or two runs: uPlot over windows the server cuts out at the
// resolution of the screen. What is here already is drawn at once, finer data when it comes.

import { element, setText } from "../core/dom.js";
import { fixed } from "../core/format.js";
import { spread, styleOf } from "./style.js";
import { SignalMenu } from "./signal_menu.js";
import { stamp } from "./play_head.js";

const AHEAD = 1; // widths fetched on either side of what is shown
const COARSE = 3.5; // times the width at which a window is too coarse

export class ReplayChart extends EventTarget {
  menu; lines; outputs; uplot; drawn;

  constructor(place, index, clock, range) {
    super();
    this.index = index; this.clock = clock; this.range = range; this.runs = []; this.names = [];
    this.loaded = new Map(); this.whole = new Map(); this.asked = 0; this.values = [];
    this.legend = element("div", { className: "legend" });
    this.plot = element("div", { className: "plot" });
    this.head = element("i", { className: "playhead" });
    this.choose = element("button", { title: "choose signals", ariaExpanded: "false", onclick: () => this.toggleMenu() }, "Signals");
    place.append(element("header", {}, this.legend, element("div", { className: "right" }, this.choose)), this.plot);
    this.place = place;
    range.addEventListener("range", () => this.show());
    clock.addEventListener("time", () => this.moveHead());
    new ResizeObserver(() => this.resize()).observe(this.plot);
  }

  setRuns(runs) {
    this.runs = runs;
    this.menu?.place.remove();
    this.menu = new SignalMenu(runs[0].description.signals, (names) => {
      this.select(names);
      localStorage.setItem(`replay.chart.${this.index}`, JSON.stringify(names));
    });
    this.place.append(this.menu.place);
    this.select(this.stored() ?? this.defaults());
  }

  // After a run's shift changed: its windows are at other times.
  shifted() { this.loaded.clear(); this.whole.clear(); this.fetch(); this.show(); }

  toggleMenu() {
    this.menu.toggle(this.names);
    this.choose.setAttribute("aria-expanded", String(!this.menu.place.hidden));
  }

  stored() {
    const names = JSON.parse(localStorage.getItem(`replay.chart.${this.index}`) ?? "null");
    const known = Array.isArray(names) ? names.filter((name) => this.runs[0].signals.has(name)) : [];
    return known.length ? known : null;
  }

  defaults() {
    const { signals, description } = this.runs[0];
    const axes = (name) => ["x", "y", "z"].map((axis) => `${name}.${axis}`);
    const wanted = this.index === 0 ? [...axes("state.position"), ...axes("reference.position")] : axes("error.position");
    const known = wanted.filter((name) => signals.has(name));
    if (known.length) return known;
    const moving = description.signals.filter((signal) => !("constant" in signal));
    return moving.slice(3 * this.index, 3 * this.index + 3).map((signal) => signal.name);
  }

  select(names) {
    this.names = names;
    this.loaded.clear();
    this.whole.clear();
    this.lines = this.runs.flatMap((run, k) => styleOf(names).map((style, i) => ({ run, name: names[i], isOther: k > 0, ...style })))
      .filter(({ run, name }) => run.signals.has(name));
    this.outputs = this.lines.map(() => element("output"));
    const isShown = ({ isOther, name }) => !isOther && !(name.startsWith("reference.") && names.some((one) => !one.startsWith("reference.")));
    const entries = this.lines.map((line, i) => (isShown(line) ? this.entry(line, this.outputs[i], this.other(line)) : null)).filter(Boolean);
    if (names.length > entries.length) entries.push(this.dashed());
    this.legend.replaceChildren(...entries);
    this.uplot?.destroy();
    this.uplot = new uPlot(this.options(), [[this.clock.start, this.clock.end], ...this.lines.map(() => [null, null])], this.plot);
    this.drawn = null;
    this.uplot.over.append(this.head);
    this.fetch();
    this.show();
    this.dispatchEvent(new Event("select"));
  }

  // References have the colours of what they are the reference of.
  dashed() {
    const entry = element("span", { className: "dashed", title: "dashed" }, "reference");
    entry.style.setProperty("--c", "#84909b");
    return entry;
  }

  other({ name }) {
    const k = this.lines.findIndex((line) => line.isOther && line.name === name);
    return k < 0 ? "" : this.outputs[k];
  }

  entry({ run, name, stroke, dash }, output, other) {
    const { label, group, unit } = run.signals.get(name);
    if (other) other.className = "second";
    const entry = element("span", { title: `${group} ${label}${unit ? `, ${unit}` : ""}` }, label, output, other);
    entry.style.setProperty("--c", stroke);
    entry.classList.toggle("dashed", Boolean(dash));
    return entry;
  }

  options() {
    const grey = { stroke: "#7d8994", font: "11px system-ui", grid: { stroke: "#1d252c", width: 1 }, ticks: { show: false } };
    const units = new Set(this.lines.map(({ run, name }) => run.signals.get(name).unit));
    const label = [...units].filter(Boolean).join(", ") || undefined;
    return {
      ...this.size(),
      legend: { show: false }, padding: [6, 16, 0, 0],
      cursor: { sync: { key: "replay" }, drag: { x: true, y: false, setScale: false, dist: 5 }, points: { show: false }, bind: { dblclick: () => () => { this.range.setWidth(null); } } },
      scales: { x: { time: false }, y: { range: (_, low, high) => spread(low, high, units) } },
      axes: [
        { ...grey, size: 20, gap: 3, space: 70, values: (_, ticks, __, ___, step) => ticks.map((tick) => stamp(tick, step < 0.1 ? 2 : step < 1 ? 1 : 0)) },
        { ...grey, size: 52, gap: 5, label, labelSize: 15, labelGap: 0, labelFont: "11px system-ui" },
      ],
      series: [{}, ...this.lines.map(({ name, stroke, dash, isOther }) => ({
        label: name, stroke: isOther ? `${stroke}99` : stroke, dash: isOther ? [2, 3] : dash, width: isOther ? 1.2 : 1.4, points: { show: false }, spanGaps: false,
      }))],
      hooks: {
        ready: [(u) => {
          u.over.addEventListener("wheel", (event) => {
            event.preventDefault();
            this.range.scale(Math.exp(0.0015 * event.deltaY), u.posToVal(event.offsetX, "x"));
          }, { passive: false });
          u.over.addEventListener("click", (event) => { if (!this.dragged) this.clock.seek(u.posToVal(event.offsetX, "x")); this.dragged = false; });
        }],
        setSelect: [(u) => {
          this.dragged = u.select.width > 5;
          if (!this.dragged) return;
          const start = u.posToVal(u.select.left, "x"), end = u.posToVal(u.select.left + u.select.width, "x");
          u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
          this.range.zoom(start, end);
        }],
      },
    };
  }

  // Never so small that uPlot finds no room for its axes.
  size() { return { width: Math.max(160, this.plot.clientWidth), height: Math.max(80, this.plot.clientHeight) }; }

  get points() { return Math.min(2000, Math.max(200, this.plot.clientWidth)); }

  // Whether what is drawn is as fine as the screen.
  get settled() { return this.runs.every((run) => this.fits(run, this.loaded.get(run))); }

  fits(run, window) {
    if (!window) return false;
    const { start, end } = this.reach();
    return window.start <= start + 1e-9 && window.end >= end - 1e-9 && window.end - window.start <= COARSE * (this.range.end - this.range.start);
  }

  // What is shown, as far as there are runs.
  reach() { return { start: Math.max(this.range.start, this.clock.start), end: Math.min(this.range.end, this.clock.end) }; }

  show() {
    if (!this.uplot) return;
    const windows = this.runs.map((run) => (this.fits(run, this.loaded.get(run)) ? this.loaded.get(run) : this.best(run)));
    if (windows.some(Boolean)) this.uplot.batch(() => {
      if (windows.some((window, k) => window !== this.drawn?.[k])) { this.drawn = windows; this.uplot.setData(this.joined(windows), false); }
      this.uplot.setScale("x", { min: this.range.start, max: this.range.end });
    });
    this.moveHead();
    if (!this.settled) this.fetch();
    else this.dispatchEvent(new Event("drawn"));
  }

  // While the finer one is on its way: the last one if it covers the middle, else the whole run.
  best(run) {
    const window = this.loaded.get(run), { start, end } = this.reach(), middle = (start + end) / 2;
    return window && window.start <= middle && middle <= window.end ? window : this.whole.get(run);
  }

  joined(windows) {
    const tables = [], place = [];
    windows.forEach((window, k) => {
      for (const { signals, times, columns } of window?.groups ?? []) {
        signals.forEach((name) => place.push(this.lines.findIndex((line) => line.run === this.runs[k] && line.name === name)));
        tables.push([Array.from(times, (t) => t - this.runs[k].shift), ...columns.map((column) => Array.from(column, (v) => (Number.isFinite(v) ? v : null)))]);
      }
    });
    const data = tables.length ? (tables.length === 1 ? tables[0] : uPlot.join(tables)) : [[]];
    const out = [data[0], ...this.lines.map(() => [])];
    place.forEach((line, k) => { if (line >= 0) out[line + 1] = data[k + 1]; });
    for (let k = 1; k < out.length; k++) if (!out[k].length) out[k] = new Array(data[0].length).fill(undefined);
    return out;
  }

  // One question at a time; when its answer comes, what is shown then is asked for.
  async fetch() {
    if (this.isFetching) return;
    this.isFetching = true;
    const names = this.names, runs = this.runs;
    try {
      for (const run of runs) if (!this.whole.get(run)) this.whole.set(run, await this.window(run, this.clock.start, this.clock.end));
      const width = this.range.end - this.range.start, { start, end } = this.reach();
      const from = Math.max(this.clock.start, start - AHEAD * width), to = Math.min(this.clock.end, end + AHEAD * width);
      await Promise.all(runs.filter((run) => !this.fits(run, this.loaded.get(run))).map(async (run) => {
        const whole = this.whole.get(run);
        this.loaded.set(run, this.fits(run, whole) ? whole : await this.window(run, from, to));
      }));
      this.place.classList.remove("lost");
    } catch (error) {
      this.place.classList.add("lost");
      this.dispatchEvent(new CustomEvent("problem", { detail: error.message }));
      await new Promise((resolve) => setTimeout(resolve, 1000));
    }
    this.isFetching = false;
    if (names !== this.names || runs !== this.runs) { this.loaded.clear(); this.whole.clear(); }
    this.show();
  }

  async window(run, start, end) {
    const shift = run.shift, share = (end - start) / Math.max(1e-9, this.range.end - this.range.start);
    const points = Math.min(4000, Math.round(this.points * Math.max(1, share)));
    const groups = await run.window(this.names, start + shift, end + shift, points);
    return shift === run.shift ? { groups, start, end } : null;
  }

  moveHead() {
    if (!this.uplot) return;
    const x = this.uplot.valToPos(this.clock.t, "x");
    this.head.hidden = !(x >= 0 && x <= this.uplot.over.clientWidth);
    this.head.style.transform = `translateX(${x}px)`;
  }

  // Values at the play-head, one object of them a run.
  put(values) {
    this.lines?.forEach(({ run, name }, i) => {
      const [value, age] = values.get(run)?.[name] ?? [null, null];
      const text = value === null ? "–" : fixed(value, Math.abs(value) < 100 ? 3 : 1);
      setText(this.outputs[i], text);
      this.outputs[i].classList.toggle("stale", !(age < 3));
    });
  }

  resize() {
    this.uplot?.setSize(this.size());
    this.moveHead();
  }
}
