// The telemetry as a chart's source: what its axis' history holds, running or paused.

import { figuresOf } from "./figures.js";
import { between, indexAt } from "./history.js";

/** @import { TimeAxis } from "./time_axis.js" */

export class LiveSignals {
  /**
   * @param {TimeAxis} axis
   * @param {Map<string, { label: string, unit: string, group: string, topic: string }>} signals
   * @param {string} who this chart, to the history
   */
  constructor(axis, signals, who) {
    this.axis = axis; this.signals = signals; this.who = who;
  }

  /** @param {string[]} names @param {{ stroke: string, dash: number[] }[]} styles */
  lines(names, styles) {
    this.axis.history.want(this.who, names);
    return names.map((name, i) => ({ name, ...styles[i] }));
  }

  /** @param {{ name: string }} line @param {number} min @param {number} max */
  samples({ name }, min, max) {
    const { source } = this.axis, values = source.column(name);
    return values && { times: source.times, values, ...between(source.times, min, max, source.start, source.end) };
  }

  /** @param {number} from @param {number} to */
  inside(from, to) {
    const { source } = this.axis;
    return /** @type {[number, number]} */ ([from, to].map((time) => indexAt(source.times, time, source.start, source.end)));
  }

  /** @param {{ name: string }} line @param {number} from @param {number} to */
  figures({ name }, from, to) { return figuresOf(this.axis.source.column(name) ?? [], ...this.inside(from, to)); }

  /** @param {string[]} names @param {number} from @param {number} to */
  table(names, from, to) {
    const { source } = this.axis, ends = this.inside(from, to);
    return [{ names, times: source.times.slice(...ends), columns: names.map((name) => source.column(name)?.slice(...ends) ?? []) }];
  }

  // At the cursor, else the newest: what is old keeps its last value and is marked as old.
  /** @param {HTMLElement} output @param {{ name: string }} line @param {(value: number) => string} figure */
  read(output, { name }, figure) {
    const { axis } = this, { source, cursor } = axis, isPast = cursor !== null || axis.paused;
    const at = indexAt(source.times, cursor ?? axis.span[1], source.start, source.end) - 1;
    const value = at < source.start ? NaN : source.column(name)?.[at] ?? NaN, text = figure(value);
    if (!isPast) output.dataset.topic ??= this.signals.get(name)?.topic; // by what is now, or by what was then
    else if (output.dataset.topic !== undefined) { delete output.dataset.topic; output.classList.remove("stale"); }
    const isNews = isPast || Number.isFinite(value) || output.textContent === "";
    if (isNews && output.textContent !== text) output.textContent = text;
  }
}
