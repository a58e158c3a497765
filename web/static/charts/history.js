// Every sample of the signals that this page charts, of the last ten minutes: what it missed meanwhile is
// sent later (web/live/telemetry.py). Times are s since the `origin` of the vehicle's epoch.

const KEPT = 600; // s
const LEAST = 1024; // samples

/** @typedef {{ t: number, count: number }} Hole where ticks are missing, and how many */

// Signals of the same instants. Samples stand in one piece, from `start` to `end`.
export class Series {
  /** @type {Hole[]} */
  holes = [];
  start = 0;
  end = 0;

  /** @param {string[]} names */
  constructor(names) {
    this.names = names;
    this.times = new Float64Array(LEAST);
    /** @type {Map<string, Float32Array>} */
    this.columns = new Map(names.map((name) => [name, new Float32Array(LEAST)]));
  }

  get last() {
    return this.end > this.start ? this.times[this.end - 1] : undefined;
  }

  /** @param {Float64Array} times @param {Float32Array[]} columns @param {Hole[]} [holes] */
  add(times, columns, holes = []) {
    this.room(times.length);
    this.times.set(times, this.end);
    this.names.forEach((name, k) => this.columns.get(name)?.set(columns[k], this.end));
    this.end += times.length;
    const oldest = (this.last ?? 0) - KEPT;
    this.start = indexAt(this.times, oldest, this.start, this.end);
    this.holes = [
      ...(this.holes[0]?.t < oldest ? this.holes.filter(({ t }) => t >= oldest) : this.holes),
      ...holes,
    ];
  }

  clear() {
    this.start = this.end = 0;
    this.holes = [];
  }

  // For so many more: at most half of it is in use afterwards.
  /** @param {number} count */
  room(count) {
    const {
        start,
        end,
        times: { length },
      } = this,
      needed = 2 * (end - start + count);
    if (end + count <= length) return;
    /** @template {Float64Array | Float32Array} T @param {T} old @returns {T} */
    const moved = (old) => {
      const all = /** @type {T} */ (needed > length ? new /** @type {any} */ (old.constructor)(needed) : old);
      if (all === old) all.copyWithin(0, start, end);
      else all.set(old.subarray(start, end));
      return all;
    };
    this.times = moved(this.times);
    this.columns = new Map([...this.columns].map(([name, column]) => [name, moved(column)]));
    this.start = 0;
    this.end = end - start;
  }

  // Without the others.
  /** @param {Set<string>} wanted */
  narrow(wanted) {
    this.names = this.names.filter((name) => wanted.has(name));
    this.columns = new Map(
      this.names.map((name) => [name, /** @type {Float32Array} */ (this.columns.get(name))]),
    );
  }

  // A copy that stays as it is.
  freeze() {
    const { start, end, names } = this,
      copy = new Series(names);
    copy.times = this.times.slice(start, end);
    copy.columns = new Map([...this.columns].map(([name, column]) => [name, column.slice(start, end)]));
    return Object.assign(copy, { end: end - start, holes: this.holes });
  }
}

export class History {
  /**
   * @typedef {EventTarget & { origin: number, topicOf: Map<string, string>, chart(series: Series[]): void }} Feed
   * @param {Feed} telemetry
   */
  constructor(telemetry) {
    this.telemetry = telemetry;
    /** @type {Map<string, string[]>} */
    this.wants = new Map(); // who wants which signals
    /** @type {Series[]} */
    this.series = [];
    telemetry.addEventListener("origin", () => this.series.forEach((one) => one.clear())); // all of it comes anew
  }

  get origin() {
    return this.telemetry.origin;
  }
  /** @returns {any} the oldest time; undefined while it is empty */
  get first() {
    return first(this.series);
  }
  /** @param {string} name */
  of(name) {
    return this.series.find(({ columns }) => columns.has(name));
  }

  /**
   * @param {string} who
   * @param {string[]} names none takes the wish back
   */
  want(who, names) {
    if (names.length) this.wants.set(who, names);
    else this.wants.delete(who);
    const wanted = new Set([...this.wants.values()].flat()),
      news = [...wanted].filter((name) => !this.of(name));
    const size = this.series.flatMap((one) => one.names).length;
    for (const one of this.series) one.narrow(wanted);
    this.series = this.series.filter((one) => one.names.length);
    if (!news.length && size === this.series.flatMap((one) => one.names).length) return;
    const { topicOf } = this.telemetry,
      topics = new Set(news.map((name) => topicOf.get(name)));
    this.series.push(
      ...[...topics].map((topic) => new Series(news.filter((name) => topicOf.get(name) === topic))),
    );
    this.telemetry.chart(this.series);
  }

  // A copy that stays as it is.
  freeze() {
    const series = this.series.map((one) => one.freeze());
    return {
      origin: this.origin,
      series,
      get first() {
        return first(series);
      },
      of: (/** @type {string} */ name) => series.find(({ columns }) => columns.has(name)),
    };
  }
}

/** @param {Series[]} series */
function first(series) {
  const times = series.filter(({ start, end }) => end > start).map(({ start, times: its }) => its[start]);
  return times.length ? Math.min(...times) : undefined;
}

// The first index in [start, end) whose time is not before `time`; `end` if there is none.
/** @param {ArrayLike<number>} times @param {number} time @param {number} start @param {number} end */
export function indexAt(times, time, start, end) {
  while (start < end) {
    const middle = (start + end) >> 1;
    if (times[middle] < time) start = middle + 1;
    else end = middle;
  }
  return start;
}

// The samples that are drawn of [min, max]: those in it, and one on either side.
/**
 * @param {ArrayLike<number>} times
 * @param {number} min @param {number} max
 * @param {number} start @param {number} end
 */
export function between(times, min, max, start, end) {
  return {
    from: Math.max(start, indexAt(times, min, start, end) - 1),
    to: Math.min(end, indexAt(times, max, start, end) + 1),
  };
}
