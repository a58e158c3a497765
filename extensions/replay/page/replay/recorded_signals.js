// The signals of one or two runs as a chart's source: windows the server cuts out at the resolution of
// the screen. What is here already is drawn at once, finer data when it comes.

import { between } from "/static/charts/history.js";
import { setText } from "/static/core/dom.js";
import { faint } from "/static/core/theme.js";

const AHEAD = 1; // widths fetched on either side of what is shown
const COARSE = 3.5; // times the width at which a window is too coarse
const MOST = 200_000; // samples of a topic in a file
const OLD = 3; // s
const RETRY = 1000; // ms

// Events: `window` when another one is here, `problem` with its text.
export class RecordedSignals extends EventTarget {
  runs = [];
  names = [];
  values = new Map();
  isFetching = false;
  loaded = new Map();
  whole = new Map(); // of each run: the window last asked for, and one of all of it

  // points(): how many there are room for
  // extremes: of many samples a point the least and the greatest, else one of them
  constructor(clock, range, points, extremes = true) {
    super();
    this.extremes = extremes;
    this.clock = clock;
    this.range = range;
    this.points = points;
  }

  get signals() {
    return this.runs[0]?.signals ?? new Map();
  }

  // Answers that are still to come go to the old ones.
  clear() {
    this.loaded = new Map();
    this.whole = new Map();
  }

  // The lines of a second run are thinner and dotted.
  lines(names, styles) {
    this.names = names;
    this.clear();
    return this.runs.flatMap((run, k) =>
      run.known(names).map((name) => {
        const style = styles[names.indexOf(name)];
        return k
          ? { name, run, second: true, stroke: faint(style.stroke, 60), dash: [2, 3], width: 1.2 }
          : { name, run, ...style };
      }),
    );
  }

  // The one that fits, else the last one if it covers the middle, else the whole run.
  samples({ name, run }, min, max) {
    const last = this.loaded.get(run),
      middle = (min + max) / 2,
      { shift } = run;
    const window =
      this.fits(run, last) || (last && last.start <= middle && middle <= last.end)
        ? last
        : this.whole.get(run);
    const group = window?.groups.find(({ signals }) => signals.includes(name));
    if (!group) return undefined;
    const { times } = group,
      values = group.columns[group.signals.indexOf(name)];
    return { times, values, shift, ...between(times, min + shift, max + shift, 0, times.length) };
  }

  // Of all samples between two instants.
  async figures({ name, run }, from, to) {
    const { [name]: found } = await run.statistics([name], from + run.shift, to + run.shift);
    return found;
  }

  // Every sample, up to a bound; a second run's columns begin with its name.
  async table(names, from, to) {
    const all = await Promise.all(
      this.runs.map(async (run, k) =>
        (await run.window(names, from + run.shift, to + run.shift, MOST, false)).map(
          ({ signals, times, columns }) => ({
            names: signals.map((name) => (k ? `${run.id} ${name}` : name)),
            times: times.map((time) => time - run.shift),
            columns,
          }),
        ),
      ),
    );
    return all.flat();
  }

  // The value at the play-head, which the server has told.
  read(output, { name, run }, figure) {
    const [value, age] = this.values.get(run)?.[name] ?? [null, null];
    setText(output, figure(value));
    output.classList.toggle("stale", !(age < OLD));
  }

  // Whether what is here is as fine as the screen.
  get settled() {
    return this.runs.every((run) => this.fits(run, this.loaded.get(run)));
  }

  fits(run, window) {
    if (!window) return false;
    const { start, end } = this.reach(),
      width = this.range.end - this.range.start;
    return (
      window.start <= start + 1e-9 && window.end >= end - 1e-9 && window.end - window.start <= COARSE * width
    );
  }

  // What is shown, as far as there are runs.
  reach() {
    const { clock, range } = this;
    return { start: Math.max(range.start, clock.start), end: Math.min(range.end, clock.end) };
  }

  // One question at a time; when its answer comes, what is shown then is asked for.
  async fetch() {
    if (this.isFetching || this.settled) return;
    this.isFetching = true;
    const { loaded, whole, runs, clock } = this;
    try {
      for (const run of runs)
        if (!whole.get(run)) whole.set(run, await this.window(run, clock.start, clock.end));
      const { start, end } = this.reach(),
        width = AHEAD * (this.range.end - this.range.start);
      const from = Math.max(clock.start, start - width),
        to = Math.min(clock.end, end + width);
      await Promise.all(
        runs
          .filter((run) => !this.fits(run, loaded.get(run)))
          .map(async (run) => {
            const all = whole.get(run);
            loaded.set(run, this.fits(run, all) ? all : await this.window(run, from, to));
          }),
      );
      this.dispatchEvent(new CustomEvent("problem", { detail: "" }));
    } catch (error) {
      this.dispatchEvent(new CustomEvent("problem", { detail: error.message }));
      await new Promise((resolve) => {
        setTimeout(resolve, RETRY);
      });
    }
    this.isFetching = false;
    this.dispatchEvent(new Event("window"));
  }

  // null if the run was moved meanwhile
  async window(run, start, end) {
    const { shift } = run,
      share = (end - start) / Math.max(1e-9, this.range.end - this.range.start);
    const points = Math.min(4000, Math.round(this.points() * Math.max(1, share)));
    const groups = await run.window(this.names, start + shift, end + shift, points, this.extremes);
    return shift === run.shift ? { groups, start, end } : null;
  }
}
