// One parameter's way to the vehicle, free of the page: at most one request under way and 20 a
// second, the last value always sent; late after 300 ms without an acknowledgement.

const PERIOD = 50; // ms
const LATE = 300; // ms

export class GainPath {
  // send(value) → Promise of the applied value; changed() whenever `state`, `confirmed` changed.
  constructor(send, changed) {
    this.send = send;
    this.changed = changed;
    this.state = "idle"; // idle, waiting, late, refused
    this.reason = "";
    this.wish = undefined;
    this.busy = false;
    this.last = -Infinity;
  }

  set(value) {
    this.wish = value;
    this.reason = "";
    this.to(this.state === "late" ? "late" : "waiting");
    this.pump();
  }

  async pump() {
    if (this.busy || this.wish === undefined) return;
    this.busy = true;
    while (this.wish !== undefined) {
      const pause = this.last + PERIOD - performance.now();
      if (pause > 0) await new Promise((resolve) => setTimeout(resolve, pause));
      const value = this.wish;
      this.wish = undefined;
      this.last = performance.now();
      const timer = setTimeout(() => this.to("late"), LATE);
      try {
        await this.send(value);
        this.reason = "";
        if (this.wish === undefined) this.to("idle");
      } catch (error) {
        this.reason = error.message;
        if (this.wish === undefined) this.to("refused");
      } finally {
        clearTimeout(timer);
      }
    }
    this.busy = false;
  }

  to(state) {
    this.state = state;
    this.changed();
  }
}
