// The time axis that charts share: how long a window, paused or not, zoomed to what, cursor where.

/** @import { History } from "./history.js" */

import { partsOf, zoneMark } from "../core/time_zone.js";

export const SHORTEST = 5;
export const LONGEST = 600; // s
const FRAMES = 0.12; // s without a frame that are nothing: three frames
const FINEST = 0.2; // s, of a zoom into what is paused
const STEPS = [0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300]; // s between ticks

// What a live and a replayed time axis have in common: a cursor, and a count of changes.
export class Axis extends EventTarget {
  /** @type {number | null} */
  cursor = null; // s
  /** @type {{ t: number, text: string, kind: string }[]} */
  events = []; // in order of time; t less the origin is a time of the axis
  version = 0; // counts what makes a chart that stands still draw again

  get origin() {
    return 0;
  }

  /** @returns {number | null} s, where a replay is */
  get head() {
    return null;
  }

  /** @param {number | null} time */
  point(time) {
    if (time === this.cursor) return;
    this.cursor = time;
    this.dispatchEvent(new Event("point"));
  }

  // Where a chart was clicked.
  /** @param {number} _time */
  choose(_time) {}
}

// Times of at most about so many ticks in [min, max], in order; `now` is one of them where it is given.
/** @param {number} min @param {number} max @param {number} most @param {number} [now] */
export function ticksOf(min, max, most, now) {
  if (!(max > min)) return [];
  const least = (max - min) / most,
    step = STEPS.find((one) => one >= least) ?? 600 * Math.ceil(least / 600);
  const ticks = [];
  const last =
    now === undefined ? Math.floor(max / step) * step : now - Math.ceil(Math.max(0, now - max) / step) * step;
  for (let tick = last; tick >= min; tick -= step) ticks.push(tick);
  return ticks.reverse();
}

export class TimeAxis extends Axis {
  /** @param {History} history @param {number} seconds */
  constructor(history, seconds) {
    super();
    this.history = history;
    this.usual = seconds;
    this.window = seconds;
    /** @type {ReturnType<History["freeze"]> | null} */
    this.frozen = null; // what is shown while paused
    this.pausedAt = 0;
    /** @type {[number, number] | null} */
    this.zoom = null; // [from, to] in s, while paused
    this.reached = 0; // s, the vehicle's time in the newest frame
    this.received = NaN; // ms, when that came
    history.telemetry.addEventListener("frame", (/** @type {any} */ { detail }) => {
      this.reached = detail.time;
      this.received = performance.now();
    });
    history.telemetry.addEventListener("origin", () => this.resume());
  }

  get origin() {
    return this.source.origin;
  }
  get isKnown() {
    return !Number.isNaN(this.received);
  }
  // The vehicle's time, which runs on while nothing comes.
  get now() {
    const waited = (performance.now() - this.received) / 1e3;
    return this.reached + (waited > FRAMES ? waited : 0);
  }
  get paused() {
    return this.frozen !== null;
  }
  get pausedFor() {
    return this.paused ? this.now - this.pausedAt : 0;
  }
  get hasRoom() {
    return !this.zoom;
  } // for the lines' names, on the right
  get source() {
    return this.frozen ?? this.history;
  }

  // What is shown, without the room on its right.
  get span() {
    const end = this.paused ? this.pausedAt : this.now;
    return this.zoom ?? [end - this.window, end];
  }

  /** @param {number} seconds */
  setWindow(seconds) {
    this.window = Math.min(LONGEST, Math.max(SHORTEST, seconds));
    this.zoom = null;
    this.changed();
  }

  pause() {
    if (this.paused) return;
    this.frozen = this.history.freeze();
    this.pausedAt = this.now;
    this.changed();
  }

  resume() {
    this.frozen = this.zoom = null;
    this.changed();
  }

  toggle() {
    if (this.paused) this.resume();
    else this.pause();
  }

  // Closer (factor < 1) or farther around a time. What runs stays at now.
  /** @param {number} factor @param {number} time */
  scale(factor, time) {
    if (!this.paused) {
      this.setWindow(this.window * factor);
      return;
    }
    const [from, to] = this.span,
      length = Math.min(LONGEST, Math.max(FINEST, (to - from) * factor));
    const share = (time - from) / (to - from);
    this.show(time - share * length, time + (1 - share) * length);
  }

  /** @param {number} seconds */
  pan(seconds) {
    this.pause();
    const [from, to] = this.span;
    this.show(from + seconds, to + seconds);
  }

  // Pauses, for a piece of what was does not run.
  /** @param {number} from @param {number} to */
  show(from, to) {
    this.pause();
    const first = this.source.first ?? from,
      length = Math.max(FINEST, to - from);
    const start = Math.min(this.pausedAt - 0.1 * length, Math.max(first - 0.9 * length, from));
    this.zoom = [start, start + length];
    this.changed();
  }

  reset() {
    if (this.zoom) this.zoom = null;
    else this.window = this.usual;
    this.changed();
  }

  /** @param {number} min @param {number} max @param {number} most */
  ticks(min, max, most) {
    return max - min < 2 * LONGEST ? ticksOf(min, max, most, this.paused ? undefined : this.now) : [];
  }

  // Before now while it runs, by the clock while it is paused.
  /** @param {number} time */
  label(time) {
    const before = this.now - time;
    if (this.paused) return this.clock(time, this.span[1] - this.span[0] > 6 ? 0 : 1);
    if (before < 0.05) return "now";
    return before > 119.5 ? `−${Number((before / 60).toFixed(1))} min` : `−${Math.round(before)} s`;
  }

  // 14:03:27 by the vehicle's clock, with so many digits.
  /** @param {number} time @param {number} digits */
  clock(time, digits) {
    const steps = 10 ** digits,
      count = Math.floor(time * steps + 1e-6),
      [hour, ...rest] = partsOf(new Date((this.origin + count / steps) * 1e3 + 1e-3)).slice(3);
    const text = [hour, ...rest].map((n) => String(n).padStart(2, "0")).join(":");
    return `${digits ? `${text}.${String(count % steps).padStart(digits, "0")}` : text}${zoneMark()}`;
  }

  changed() {
    this.version += 1;
    this.dispatchEvent(new Event("change"));
  }
}
