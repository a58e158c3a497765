// What came of all signals that this page asks for, in arrays of a fixed size: the last ten minutes,
// also of those that nobody charts at present.

const CAPACITY = 15360; // samples at 25 Hz
const MOST = 96; // signals: 12 MB
const STEP_BACK = 1; // s; a clock that was set back by more starts afresh

// Samples stand in one piece: arrays are twice as long, and when they are full their last half
// is moved to the front.
export class History {
  /** @param {EventTarget & { want(who: string, names: string[]): void }} telemetry */
  constructor(telemetry, capacity = CAPACITY) {
    this.telemetry = telemetry;
    this.capacity = capacity;
    /** @type {Map<string, string[]>} */
    this.wants = new Map(); // who wants which signals
    this.times = new Float64Array(2 * capacity);
    /** @type {Map<string, Float32Array>} */
    this.columns = new Map(); // name → Float32Array, NaN where there is no value
    this.end = 0;
    telemetry.addEventListener("frame", (/** @type {any} */ { detail }) => this.take(detail));
    telemetry.addEventListener("close", () => this.gap());
  }

  /**
   * @param {string} who
   * @param {string[]} names none takes the wish back
   */
  want(who, names) {
    if (names.length) this.wants.set(who, names);
    else this.wants.delete(who);
    this.telemetry.want("charts", [...new Set([...this.wants.values()].flat())]);
  }

  /**
   * Room for one more signal; of too many the oldest that comes no more is given up.
   * @param {string} name
   * @param {Record<string, number>} value
   */
  add(name, value) {
    const gone = this.columns.size < MOST ? undefined : [...this.columns.keys()].find((other) => !(other in value));
    if (gone !== undefined) this.columns.delete(gone);
    this.columns.set(name, new Float32Array(2 * this.capacity).fill(NaN));
  }

  get start() { return Math.max(0, this.end - this.capacity); }
  /** @returns {any} undefined while it is empty */
  get last() { return this.end ? this.times[this.end - 1] : undefined; }
  /** @param {string} name */
  column(name) { return this.columns.get(name); }

  /** @param {{ time: number, value: Record<string, number> }} frame */
  take({ time, value }) {
    if (time <= this.last - STEP_BACK) this.end = 0;
    if (time <= this.last) return;
    this.room();
    this.times[this.end] = time;
    for (const name in value) if (!this.columns.has(name)) this.add(name, value);
    for (const [name, column] of this.columns) column[this.end] = value[name] ?? NaN;
    this.end += 1;
  }

  // Nothing came from here on.
  gap() {
    if (this.end) this.take({ time: this.last + 1e-3, value: {} });
  }

  room() {
    if (this.end < 2 * this.capacity) return;
    for (const column of [this.times, ...this.columns.values()]) column.copyWithin(0, this.capacity);
    this.end = this.capacity;
  }

  // A copy that stays as it is.
  freeze() {
    const { start, end } = this;
    const columns = new Map([...this.columns].map(([name, column]) => [name, column.slice(start, end)]));
    return { times: this.times.slice(start, end), start: 0, end: end - start,
      column: (/** @type {string} */ name) => columns.get(name) };
  }
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
  return { from: Math.max(start, indexAt(times, min, start, end) - 1),
    to: Math.min(end, indexAt(times, max, start, end) + 1) };
}
