// The telemetry as a chart's source: what its axis' history holds, running or paused.

import { figuresOf } from "./figures.js";
import { between, indexAt } from "./history.js";

/** @import { TimeAxis } from "./time_axis.js" @import { Series } from "./history.js" */

export class LiveSignals {
  /**
   * @param {TimeAxis} axis
   * @param {Map<string, { label: string, unit: string, group: string, topic: string }>} signals
   * @param {string} who this chart, to the history
   */
  constructor(axis, signals, who) {
    this.axis = axis;
    this.signals = signals;
    this.who = who;
  }

  /** @param {string[]} names @param {{ stroke: string, dash: number[] }[]} styles */
  lines(names, styles) {
    this.axis.history.want(this.who, names);
    return names.map((name, i) => ({ name, ...styles[i] }));
  }

  // Where something is missing a sample without a value says so.
  /** @param {{ name: string }} line @param {number} min @param {number} max */
  samples({ name }, min, max) {
    const series = this.axis.source.of(name),
      values = series?.columns.get(name);
    if (!series || !values) return undefined;
    const { times, start, end, holes } = series;
    return { times, values, holes, ...between(times, min, max, start, end) };
  }

  /** @param {{ name: string }} line @param {number} from @param {number} to */
  figures({ name }, from, to) {
    const series = this.axis.source.of(name);
    return figuresOf(series?.columns.get(name) ?? [], ...inside(series, from, to));
  }

  // By the vehicle's epoch.
  /** @param {string[]} names @param {number} from @param {number} to */
  table(names, from, to) {
    const { source } = this.axis;
    return [...new Set(names.map((name) => source.of(name)))].flatMap((series) => {
      if (!series) return [];
      const its = names.filter((name) => series.columns.has(name)),
        ends = inside(series, from, to);
      return [
        {
          names: its,
          times: series.times.slice(...ends).map((time) => source.origin + time),
          columns: its.map((name) => series.columns.get(name)?.slice(...ends) ?? []),
        },
      ];
    });
  }

  // The index of the sample at the cursor, else of the newest.
  /** @param {string} name */
  at(name) {
    const { axis } = this,
      series = axis.source.of(name),
      isPast = axis.cursor !== null || axis.paused;
    if (!series || !isPast) return series && series.end - 1;
    return indexAt(series.times, (axis.cursor ?? axis.span[1]) + 1e-9, series.start, series.end) - 1;
  }

  // When that sample was taken, s since the origin.
  /** @param {string} name */
  stamp(name) {
    const index = this.at(name) ?? -1,
      series = this.axis.source.of(name);
    return series && index >= series.start ? series.times[index] : undefined;
  }

  // What is old keeps its last value and is marked as old.
  /** @param {HTMLElement} output @param {{ name: string }} line @param {(value: number) => string} figure */
  read(output, { name }, figure) {
    const { axis } = this,
      series = axis.source.of(name),
      isPast = axis.cursor !== null || axis.paused;
    const index = this.at(name) ?? -1,
      column = series && index >= series.start ? series.columns.get(name) : undefined;
    const value = column?.[index] ?? NaN,
      text = figure(value);
    if (!isPast)
      output.dataset.topic ??= this.signals.get(name)?.topic; // by what is now, or by what was then
    else if (output.dataset.topic !== undefined) {
      delete output.dataset.topic;
      output.classList.remove("stale");
    }
    const isNews = isPast || Number.isFinite(value) || output.textContent === "";
    if (isNews && output.textContent !== text) output.textContent = text;
  }
}

/** @param {Series | undefined} series @param {number[]} ends @returns {[number, number]} */
function inside(series, ...ends) {
  const [from, to] = ends.map((time) => (series ? indexAt(series.times, time, series.start, series.end) : 0));
  return [from, to];
}
