// One figure of a link over the last five minutes: a name, its value, and a small plot.

import { element, setIfChanged, setText } from "../core/dom.js";
import { font, paint } from "../core/theme.js";

const CAPACITY = 1500; // five minutes at 5 Hz
const LENGTH = 300; // s
const BREAK = 1.5; // s without a sample: a gap

export class LinkStrip {
  // format(value): text with its unit; least: height of the plot when nothing is larger;
  /**
   * deadline: { value(), text } marked by a line; zero: whether the plot stands on zero
   * @param {string} label
   * @param {{
   *   format: (value: number) => string, least: number, topic?: string, title?: string, deadline?: any,
   *   zero?: boolean
   * }} look
   */
  constructor(label, { format, least, topic = "", title = "", deadline = null, zero = true }) {
    this.label = label;
    this.format = format;
    this.least = least;
    this.deadline = deadline;
    this.zero = zero;
    this.times = new Float64Array(CAPACITY); // s of this page's clock, a ring
    this.values = new Float32Array(CAPACITY);
    this.count = 0;
    this.value = element("output", {}, "–");
    if (topic) this.value.dataset.topic = topic;
    this.largest = element("span", { className: "largest" });
    this.canvas = element("canvas", { role: "img" });
    this.place = element(
      "div",
      { className: "strip", title },
      element("span", { className: "name" }, label),
      this.value,
      this.largest,
      this.canvas,
    );
  }

  // NaN is a gap.
  add(time, value) {
    const i = this.count++ % CAPACITY;
    this.times[i] = time;
    this.values[i] = value;
  }

  get newest() {
    return this.count ? this.values[(this.count - 1) % CAPACITY] : NaN;
  }

  draw(now) {
    if (Number.isFinite(this.newest)) setText(this.value, this.format(this.newest)); // else the last one stays, grey
    let low = Infinity,
      high = -Infinity;
    this.each(now, (_, value) => {
      if (value < low) low = value;
      if (value > high) high = value;
    });
    const isKnown = high >= low;
    setText(
      this.largest,
      !isKnown ? "" : this.zero ? `max ${this.format(high)}` : `${this.format(low)} to ${this.format(high)}`,
    );
    this.canvas.ariaLabel = isKnown
      ? `${this.label}, last five minutes: ${this.format(low)} to ${this.format(high)}`
      : `${this.label}: no data`;
    this.paint(now, low, high, isKnown);
  }

  each(now, act) {
    for (let k = Math.max(0, this.count - CAPACITY); k < this.count; k++) {
      const i = k % CAPACITY,
        ago = now - this.times[i];
      if (ago <= LENGTH && Number.isFinite(this.values[i])) act(this.times[i], this.values[i]);
    }
  }

  paint(now, low, high, isKnown) {
    const { canvas } = this,
      ratio = devicePixelRatio,
      width = Math.round(canvas.clientWidth * ratio),
      height = Math.round(canvas.clientHeight * ratio);
    if (!width || !height) return;
    setIfChanged(canvas, "width", width);
    setIfChanged(canvas, "height", height);
    const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d")),
      limit = this.deadline?.value();
    context.clearRect(0, 0, width, height);
    const middle = (low + high) / 2,
      half = Math.max(this.least / 2, ((high - low) / 2) * 1.1);
    const bottom = this.zero || !isKnown ? 0 : middle - half,
      top = this.zero || !isKnown ? Math.max(this.least, 1.1 * (isKnown ? high : 0)) : middle + half;
    const x = (time) => width * (1 - (now - time) / LENGTH),
      y = (value) => height - 1 - ((value - bottom) / (top - bottom)) * (height - 2);
    context.lineWidth = ratio;
    if (limit > bottom && limit < top) {
      context.strokeStyle = paint("var(--amber)");
      context.setLineDash([3 * ratio, 3 * ratio]);
      context.beginPath();
      context.moveTo(0, y(limit));
      context.lineTo(width, y(limit));
      context.stroke();
      context.setLineDash([]);
      context.fillStyle = paint("var(--dim)");
      context.font = font(ratio);
      context.fillText(this.deadline.text, 2 * ratio, y(limit) - 3 * ratio);
    }
    context.strokeStyle = paint("var(--z)");
    context.beginPath();
    let before = -Infinity;
    this.each(now, (time, value) => {
      if (time - before > BREAK) context.moveTo(x(time), y(value));
      else context.lineTo(x(time), y(value));
      before = time;
    });
    context.stroke();
  }
}
