// The rigidity eigenvalue of the last minute, and the bound at which commanded motions stop.

import { element, setText } from "/static/core/dom.js";
import { fixed } from "/static/core/format.js";
import { font, onTheme, paint } from "/static/core/theme.js";

const SHOWN = 60_000, // ms
  LEFT = 34,
  LOW = 14; // px

export class EigenvalueChart {
  constructor() {
    this.points = []; // [ms, value]
    this.bound = 0;
    this.canvas = element("canvas", { role: "img", ariaLabel: "rigidity eigenvalue of the last minute" });
    this.value = element("output", {});
    this.place = element(
      "figure",
      { className: "eigenvalue" },
      element(
        "figcaption",
        { title: "how far the edges in use are from leaving the shape undetermined; 0: not rigid" },
        "Rigidity eigenvalue ",
        this.value,
      ),
      this.canvas,
    );
    onTheme(this.canvas, () => this.draw());
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  add(value, bound) {
    const now = performance.now();
    this.points.push([now, value]);
    this.bound = bound;
    while (this.points[0][0] < now - SHOWN) this.points.shift();
    setText(
      this.value,
      `${fixed(value, 3)}, slower below ${fixed(2 * bound, 2)}, stops at ${fixed(bound, 2)}`,
    );
    this.value.classList.toggle("warn", value < 2 * bound);
    this.draw();
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    const dots = devicePixelRatio,
      pen = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d")),
      now = performance.now();
    this.canvas.width = Math.round(width * dots);
    this.canvas.height = Math.round(height * dots);
    pen.setTransform(dots, 0, 0, dots, 0, 0);
    const top = 1.15 * Math.max(4 * this.bound, ...this.points.map(([, value]) => value)),
      across = (ms) => width - ((width - LEFT) * (now - ms)) / SHOWN,
      up = (value) => height - LOW - ((height - LOW - 4) * value) / top;
    pen.font = font();
    pen.fillStyle = paint("var(--dim)");
    pen.strokeStyle = paint("var(--line)");
    for (const value of [0, top / 2.3, top / 1.15]) {
      pen.fillText(fixed(value, 2), 2, up(value) + 4);
      stroke(pen, [
        [LEFT, up(value)],
        [width, up(value)],
      ]);
    }
    pen.fillText("60 s ago", LEFT, height - 2);
    pen.fillText("now", width - 24, height - 2);
    pen.strokeStyle = paint("var(--amber)");
    pen.setLineDash([4, 3]);
    stroke(pen, [
      [LEFT, up(this.bound)],
      [width, up(this.bound)],
    ]);
    pen.setLineDash([]);
    pen.strokeStyle = paint("var(--text)");
    pen.lineWidth = 1.4;
    stroke(
      pen,
      this.points.map(([ms, value]) => [Math.max(LEFT, across(ms)), up(value)]),
    );
  }
}

/** @param {CanvasRenderingContext2D} pen @param {number[][]} points */
function stroke(pen, points) {
  pen.beginPath();
  for (const [x, y] of points) pen.lineTo(x, y);
  pen.stroke();
}
