// One parameter's way to the vehicle, free of the page: at most one request under way and 20 a
// second, the last value always sent; late after 300 ms without an acknowledgement.

const PERIOD = 50; // ms
const LATE = 300; // ms

export class GainSender {
  /**
   * A reason stays until something is accepted: a hand that goes on pulling must see why nothing moves.
   * @param {(value: any, walks: boolean) => Promise<unknown>} send
   * @param {() => void} changed whenever `state` or `reason` changed
   */
  constructor(send, changed) {
    this.send = send;
    this.changed = changed;
    this.state = "idle"; // idle, waiting, late, refused
    this.reason = "";
    /** @type {{ value: any, walks: boolean } | undefined} */
    this.wish = undefined;
    this.busy = false;
    this.last = -Infinity;
    /** @type {any} */
    this.timer = null;
  }

  /**
   * @param {any} value
   * @param {boolean} walks in flight, where the vehicle takes only a smaller step at once, go there in several
   */
  set(value, walks = false) {
    this.wish = { value, walks };
    this.to(this.state === "late" ? "late" : "waiting");
    this.pump();
  }

  // The vehicle has confirmed something of this parameter: a walk is under way, nothing is late.
  noteConfirmed() {
    if (this.timer !== null) this.wait();
  }

  async pump() {
    if (this.busy || this.wish === undefined) return;
    this.busy = true;
    while (this.wish !== undefined) {
      const pause = this.last + PERIOD - performance.now();
      if (pause > 0) await new Promise((resolve) => setTimeout(resolve, pause));
      const { value, walks } = this.wish;
      this.wish = undefined;
      this.last = performance.now();
      this.wait();
      try {
        await this.send(value, walks);
        this.reason = "";
        if (this.wish === undefined) this.to("idle");
      } catch (error) {
        this.reason = /** @type {Error} */ (error).message;
        this.refused = value;
        if (this.wish === undefined) this.to("refused");
      } finally {
        clearTimeout(this.timer);
        this.timer = null;
      }
    }
    this.busy = false;
  }

  wait() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.to("late"), LATE);
  }

  /** @param {string} state */
  to(state) {
    this.state = state;
    this.changed();
  }
}
