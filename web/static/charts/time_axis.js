// The time axis that charts share: how long a window, paused or not, zoomed to what, cursor where.

/** @import { History } from "./history.js" */

export const SHORTEST = 5, LONGEST = 600; // s
const FINEST = 0.2; // s, of a zoom into what is paused

export class TimeAxis extends EventTarget {
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
    /** @type {number | null} */
    this.cursor = null; // s
    this.version = 0; // counts what makes a paused chart draw again
    history.telemetry.addEventListener("frame", (/** @type {any} */ { detail }) => { this.offset = detail.time - performance.now() / 1e3; });
  }

  get isKnown() { return this.offset !== undefined; }
  get now() { return this.isKnown ? performance.now() / 1e3 + this.offset : 0; } // runs on while nothing comes
  get paused() { return this.frozen !== null; }
  get pausedFor() { return this.paused ? this.now - this.pausedAt : 0; }
  get source() { return this.frozen ?? this.history; }

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

  toggle() { if (this.paused) this.resume(); else this.pause(); }

  // Closer (factor < 1) or farther around a time. What runs stays at now.
  /** @param {number} factor @param {number} time */
  scale(factor, time) {
    if (!this.paused) { this.setWindow(this.window * factor); return; }
    const [from, to] = this.span, length = Math.min(LONGEST, Math.max(FINEST, (to - from) * factor));
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
    const { source } = this, first = source.end ? source.times[0] : from, length = Math.max(FINEST, to - from);
    const start = Math.min(this.pausedAt - 0.1 * length, Math.max(first - 0.9 * length, from));
    this.zoom = [start, start + length];
    this.changed();
  }

  reset() {
    if (this.zoom) this.zoom = null;
    else this.window = this.usual;
    this.changed();
  }

  /** @param {number | null} time */
  point(time) {
    if (time === this.cursor) return;
    this.cursor = time;
    this.dispatchEvent(new Event("point"));
  }

  changed() {
    this.version += 1;
    this.dispatchEvent(new Event("change"));
  }
}
