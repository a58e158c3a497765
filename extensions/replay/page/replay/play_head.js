// The play-head: where it is, and how it moves by itself. Times are the first run's, s.

export const SPEEDS = [0.125, 0.25, 0.5, 1, 2, 4, 8];

// Events: `time` when it moved, `change` when playing, speed or range did.
export class PlayHead extends EventTarget {
  constructor() {
    super();
    this.t = 0;
    this.start = 0;
    this.end = 1;
    this.speed = 1;
    this.direction = 1;
    this.playing = false;
    this.last = 0;
    this.tick = this.tick.bind(this);
  }

  /** @param {number} start @param {number} end */
  setRange(start, end) {
    Object.assign(this, { start, end });
    this.seek(this.t);
    this.dispatchEvent(new Event("change"));
  }

  /** @param {number} t */
  seek(t) {
    const next = Math.min(this.end, Math.max(this.start, t));
    if (next === this.t) return;
    this.t = next;
    this.dispatchEvent(new Event("time"));
  }

  /** @param {number} seconds */
  step(seconds) {
    this.pause();
    this.seek(this.t + seconds);
  }

  /** @param {number} speed */
  setSpeed(speed) {
    this.speed = speed;
    this.dispatchEvent(new Event("change"));
  }

  /** @param {number} steps */
  faster(steps) {
    const place = SPEEDS.indexOf(this.speed) + steps;
    this.setSpeed(SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, place))]);
  }

  play(direction = this.direction) {
    this.direction = direction;
    if (direction > 0 ? this.t >= this.end : this.t <= this.start)
      this.seek(direction > 0 ? this.start : this.end);
    if (!this.playing) {
      this.playing = true;
      this.last = performance.now();
      requestAnimationFrame(this.tick);
    }
    this.dispatchEvent(new Event("change"));
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    this.dispatchEvent(new Event("change"));
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  /** @param {number} now */
  tick(now) {
    if (!this.playing) return;
    const passed = Math.min(0.25, Math.max(0, (now - this.last) / 1e3)); // a hidden tab goes on where it was
    this.last = now;
    this.seek(this.t + this.direction * this.speed * passed);
    if (this.direction > 0 ? this.t >= this.end : this.t <= this.start) this.pause();
    else requestAnimationFrame(this.tick);
  }
}

// 1:02.345 of seconds.
/** @param {number} t */
export function stamp(t, digits = 3) {
  const size = Math.abs(t),
    sign = t < 0 && size >= 0.5 * 10 ** -digits ? "−" : "";
  const scaled = Math.round(size * 10 ** digits),
    unit = 60 * 10 ** digits;
  const rest = ((scaled % unit) / 10 ** digits).toFixed(digits).padStart(digits ? digits + 3 : 2, "0");
  const minutes = Math.floor(scaled / unit),
    hours = Math.floor(minutes / 60);
  return hours
    ? `${sign}${hours}:${String(minutes % 60).padStart(2, "0")}:${rest}`
    : `${sign}${minutes}:${rest}`;
}
