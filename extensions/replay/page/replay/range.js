// The time axis of a replay's charts: the whole run, a few seconds around the play-head, or a part
// that was drawn with the mouse and turns its page when the play-head leaves it.

import { Axis, ticksOf } from "/static/charts/time_axis.js";
import { stamp } from "./play_head.js";

/** @import { PlayHead } from "./play_head.js" */

/** @type {[string, number | null][]} */
export const WIDTHS = [
  ["all", null],
  ["60 s", 60],
  ["30 s", 30],
  ["10 s", 10],
  ["3 s", 3],
  ["1 s", 1],
];
const SHORTEST = 0.05; // s

// Events: `range` when another part is shown, `point` when cursor or play-head moved.
export class Range extends Axis {
  isKnown = true;
  paused = true; // it stands still until it is told
  hasRoom = false;

  /** @param {PlayHead} clock */
  constructor(clock) {
    super();
    this.clock = clock;
    this.isZoomed = false;
    this.start = 0;
    this.end = 1;
    this.width = /** @type {number | null} */ (null);
    clock.addEventListener("time", () => {
      this.follow();
      this.dispatchEvent(new Event("point"));
    });
    clock.addEventListener("change", () => this.follow());
  }

  get span() {
    return [this.start, this.end];
  }
  get head() {
    return this.clock.t;
  }
  ticks = ticksOf;

  /** @param {number} t */
  label(t) {
    return stamp(t, this.end - this.start < 0.6 ? 2 : this.end - this.start < 6 ? 1 : 0);
  }

  /** @param {number | null} width seconds around the play-head; null for all */
  setWidth(width) {
    Object.assign(this, { width, isZoomed: false });
    this.follow();
  }

  /** @param {number} start @param {number} end */
  show(start, end) {
    const { clock } = this,
      least = Math.max(SHORTEST, end - start),
      middle = (start + end) / 2;
    if (least >= clock.end - clock.start) {
      this.setWidth(null);
      return;
    }
    this.isZoomed = true;
    this.set(middle - least / 2, middle + least / 2);
  }

  // About t, which stays where it is.
  /** @param {number} factor @param {number} t */
  scale(factor, t) {
    this.show(t + (this.start - t) * factor, t + (this.end - t) * factor);
  }

  /** @param {number} seconds */
  pan(seconds) {
    this.show(this.start + seconds, this.end + seconds);
  }

  /** @param {number} t */
  choose(t) {
    this.clock.seek(t);
  }

  reset() {
    this.setWidth(null);
  }

  follow() {
    const { clock, width } = this;
    if (this.isZoomed) {
      const span = this.end - this.start;
      if (clock.t < this.start) this.set(clock.t - 0.9 * span, clock.t + 0.1 * span);
      else if (clock.t > this.end) this.set(clock.t - 0.1 * span, clock.t + 0.9 * span);
    } else if (width === null) this.set(clock.start, clock.end);
    else this.set(clock.t - width / 2, clock.t + width / 2);
  }

  /** @param {number} start @param {number} end */
  set(start, end) {
    if (start === this.start && end === this.end) return;
    Object.assign(this, { start, end });
    this.version += 1;
    this.dispatchEvent(new Event("range"));
  }
}
