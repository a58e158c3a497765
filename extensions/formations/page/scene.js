// All vehicles in 3D, and who sees whom: a cone from the observer toward the observed, coloured by how far
// the bearing is from the desired one. Drag to turn the view, wheel to zoom.

import { element } from "/static/core/dom.js";
import { fixed } from "/static/core/format.js";
import { faint, font, onTheme, paint } from "/static/core/theme.js";

export const GOOD = 1; // deg, of a bearing's error
export const FAIR = 2.5;
const LEAST = 2, // m from the middle to the side of what is shown, at least
  FLOOR = 6, // m, side of the floor that is drawn
  ARM = 0.25,
  ROTOR = 0.125,
  SHARE = 0.4, // of the way to the observed, that a cone reaches
  WIDTH = 0.08, // of a cone's length
  FAR = 8; // m from the middle to the eye
const CIRCLE = Array.from({ length: 13 }, (_, k) => [
  Math.cos((k * Math.PI) / 6),
  Math.sin((k * Math.PI) / 6),
]);

/** @param {number} error deg */
export const colourOf = (error) =>
  error <= GOOD ? "var(--teal)" : error <= FAIR ? "var(--amber)" : "var(--rose)";

// Of a point (m, world): right, up and toward the eye, in m about the middle.
/** @param {number[]} point @param {number[]} middle @param {number} azimuth @param {number} elevation */
export function seen(point, middle, azimuth, elevation) {
  const [x, y, z] = point.map((value, i) => value - middle[i]);
  const [c, s, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
  const toward = c * x + s * y;
  return [c * y - s * x, ce * z - se * toward, ce * toward + se * z];
}

export class Scene {
  constructor(names) {
    this.names = names;
    this.canvas = element("canvas", { role: "img", ariaLabel: "all vehicles, and who sees whom" });
    this.azimuth = -1.9;
    this.elevation = 0.5;
    this.zoom = 1;
    this.half = LEAST;
    this.now = null;
    this.follow();
    onTheme(this.canvas, () => this.draw());
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  follow() {
    const { canvas } = this;
    canvas.addEventListener("pointerdown", ({ pointerId }) => canvas.setPointerCapture(pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons) return;
      this.azimuth -= event.movementX / 150;
      this.elevation = Math.max(0, Math.min(Math.PI / 2, this.elevation + event.movementY / 150));
      this.draw();
    });
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.zoom = Math.max(0.4, Math.min(4, this.zoom * Math.exp(-event.deltaY / 600)));
        this.draw();
      },
      { passive: false },
    );
  }

  // now: a message of /formation.
  show(now) {
    this.now = now;
    for (const pose of now.poses)
      if (pose) this.half = Math.max(this.half, Math.abs(pose[0]) + 0.7, Math.abs(pose[1]) + 0.7);
    this.asked ??= requestAnimationFrame(() => {
      this.asked = undefined;
      this.draw();
    });
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    const dots = devicePixelRatio,
      pen = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    this.canvas.width = Math.round(width * dots);
    this.canvas.height = Math.round(height * dots);
    pen.setTransform(dots, 0, 0, dots, 0, 0);
    const scale = (this.zoom * Math.min(width / 2, height / 1.4)) / this.half;
    const at = (point) => {
      const [right, up, near] = seen(point, [0, 0, 0.8], this.azimuth, this.elevation),
        share = (scale * FAR * this.half) / (FAR * this.half - near * LEAST);
      return [width / 2 + share * right, height / 2 - share * up];
    };
    this.floor(pen, at);
    if (!this.now) return;
    for (const edge of this.now.edges) this.cone(pen, at, edge);
    this.now.poses.forEach((pose, k) => pose && this.vehicle(pen, at, pose, k));
  }

  floor(pen, at) {
    const side = Math.max(FLOOR / 2, Math.ceil(this.half));
    pen.strokeStyle = paint("var(--line)");
    pen.lineWidth = 1;
    for (let k = -side; k <= side; k++) {
      line(pen, [at([k, -side, 0]), at([k, side, 0])]);
      line(pen, [at([-side, k, 0]), at([side, k, 0])]);
    }
    for (const [axis, tip] of Object.entries({ x: [0.6, 0, 0], y: [0, 0.6, 0], z: [0, 0, 0.6] })) {
      pen.strokeStyle = paint(`var(--${axis})`);
      pen.lineWidth = 2;
      line(pen, [at([0, 0, 0]), at(tip)]);
    }
  }

  cone(pen, at, [i, j, error]) {
    const from = this.now.poses[i],
      to = this.now.poses[j];
    if (!from || !to) return;
    const along = [0, 1, 2].map((k) => SHARE * (to[k] - from[k])),
      flat = Math.hypot(along[0], along[1]),
      size = WIDTH * Math.hypot(flat, along[2]);
    const across = flat > 1e-6 ? [-along[1] / flat, along[0] / flat, 0] : [1, 0, 0],
      upward = flat > 1e-6 ? [(-along[2] * along[0]) / flat, (-along[2] * along[1]) / flat, flat] : [0, 1, 0],
      length = Math.hypot(...upward);
    const rim = CIRCLE.map(([c, s]) =>
      at([0, 1, 2].map((k) => from[k] + along[k] + size * (c * across[k] + (s * upward[k]) / length))),
    );
    const colour = colourOf(error),
      apex = at(from);
    pen.fillStyle = paint(faint(colour, 22));
    pen.strokeStyle = paint(colour);
    pen.lineWidth = 1;
    for (let k = 0; k + 1 < rim.length; k++) area(pen, [apex, rim[k], rim[k + 1]]);
    line(pen, rim);
    line(pen, [apex, at([0, 1, 2].map((k) => from[k] + along[k]))]);
  }

  vehicle(pen, at, [x, y, z, yaw], k) {
    const flies = this.now.flying.includes(k),
      c = Math.cos(yaw),
      s = Math.sin(yaw);
    const body = (u, v) => at([x + c * u - s * v, y + s * u + c * v, z]);
    pen.strokeStyle = paint("var(--strong)");
    pen.lineWidth = 1;
    line(pen, [at([x, y, 0]), at([x, y, z])]);
    pen.strokeStyle = paint(flies ? "var(--text)" : "var(--dim)");
    pen.lineWidth = 2;
    line(pen, [body(-ARM, 0), body(ARM, 0)]);
    line(pen, [body(0, -ARM), body(0, ARM)]);
    pen.lineWidth = 1;
    for (const [u, v] of [
      [ARM, 0],
      [0, ARM],
      [-ARM, 0],
      [0, -ARM],
    ])
      line(
        pen,
        CIRCLE.map(([p, q]) => body(u + ROTOR * p, v + ROTOR * q)),
      );
    pen.strokeStyle = paint("var(--flown)");
    pen.lineWidth = 2;
    line(pen, [body(ARM, 0), body(ARM + ROTOR, 0)]);
    const [px, py] = at([x, y, z]);
    pen.fillStyle = paint("var(--text)");
    pen.font = font(1, "600");
    pen.fillText(this.names[k], px + 10, py - 10);
    const wide = pen.measureText(this.names[k]).width;
    pen.fillStyle = paint("var(--dim)");
    pen.font = font();
    pen.fillText(`${fixed(z, 2)} m`, px + 15 + wide, py - 10);
  }
}

/** @param {CanvasRenderingContext2D} pen @param {number[][]} points */
function trace(pen, points) {
  pen.beginPath();
  for (const [x, y] of points) pen.lineTo(x, y);
}

/** @param {CanvasRenderingContext2D} pen @param {number[][]} points */
function line(pen, points) {
  trace(pen, points);
  pen.stroke();
}

/** @param {CanvasRenderingContext2D} pen @param {number[][]} points */
function area(pen, points) {
  trace(pen, points);
  pen.fill();
}
