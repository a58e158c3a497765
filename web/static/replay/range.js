// The stretch of time all charts show: the whole run, a few seconds around the play-head, or a part
// that was drawn with the mouse and turns its page when the play-head leaves it.

/** @import { Clock } from "./play_head.js" */

/** @type {[string, number | null][]} */
export const WIDTHS = [["all", null], ["60 s", 60], ["30 s", 30], ["10 s", 10], ["3 s", 3], ["1 s", 1]];
const SHORTEST = 0.05; // s

export class Range extends EventTarget {
  /** @param {Clock} clock */
  constructor(clock) {
    super();
    this.clock = clock; this.width = /** @type {number | null} */ (null); this.isZoomed = false; this.start = 0; this.end = 1;
    clock.addEventListener("time", () => this.follow());
    clock.addEventListener("change", () => this.follow());
  }

  /** @param {number | null} width seconds around the play-head; null for all */
  setWidth(width) {
    Object.assign(this, { width, isZoomed: false });
    this.follow();
  }

  /** @param {number} start @param {number} end */
  zoom(start, end) {
    const { clock } = this, least = Math.max(SHORTEST, end - start), middle = (start + end) / 2;
    if (least >= clock.end - clock.start) { this.setWidth(null); return; }
    this.isZoomed = true;
    this.show(middle - least / 2, middle + least / 2);
  }

  /**
   * About t, which stays where it is.
   * @param {number} factor
   * @param {number} t
   */
  scale(factor, t) { this.zoom(t + (this.start - t) * factor, t + (this.end - t) * factor); }

  follow() {
    const { clock, width } = this;
    if (this.isZoomed) {
      const span = this.end - this.start;
      if (clock.t < this.start) this.show(clock.t - 0.9 * span, clock.t + 0.1 * span);
      else if (clock.t > this.end) this.show(clock.t - 0.1 * span, clock.t + 0.9 * span);
    } else if (width === null) this.show(clock.start, clock.end);
    else this.show(clock.t - width / 2, clock.t + width / 2);
  }

  /** @param {number} start @param {number} end */
  show(start, end) {
    if (start === this.start && end === this.end) return;
    Object.assign(this, { start, end });
    this.dispatchEvent(new Event("range"));
  }
}
