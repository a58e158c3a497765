// Where all vehicles are, from above: lab frame, x to the right and y up, with what they flew of late.

import { element, setIfChanged } from "../core/dom.js";
import { fixed } from "../core/format.js";
import { font, onTheme, paint } from "../core/theme.js";

const LEAST = 4; // m, the shortest side that is shown
const MARGIN = 34; // px, for names and the scale
const KEPT = 300; // positions of a trail, 30 s
const STEP = 0.02; // m; nearer ones add nothing to a trail

export class FleetPlot {
  constructor(place, names) {
    this.names = names;
    this.trails = new Map(names.map((name) => [name, []]));
    this.now = new Map();
    this.marked = null;
    this.canvas = element("canvas", { role: "img", ariaLabel: "the vehicles from above" });
    place.append(
      element("h2", {}, "From above"),
      this.canvas,
      element(
        "p",
        { className: "hint" },
        "Lab frame: x to the right, y up. The tick is the nose; the number is the height in m; the " +
          "line is the last 30 s.",
      ),
    );
    this.half = LEAST / 2;
    onTheme(this.canvas, () => this.draw());
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  add(positions) {
    positions?.forEach((position, index) => {
      const name = this.names[index],
        trail = this.trails.get(name);
      this.now.set(name, position);
      if (!position) {
        if (trail.length && trail.at(-1)) trail.push(null);
        return;
      } // a gap
      const last = trail.at(-1);
      if (!last || Math.hypot(last[0] - position[0], last[1] - position[1]) > STEP) trail.push(position);
      if (trail.length > KEPT) trail.splice(0, trail.length - KEPT);
    });
    if (!this.asked)
      this.asked = requestAnimationFrame(() => {
        this.asked = null;
        this.draw();
      });
  }

  mark(name) {
    this.marked = name;
    this.draw();
  }

  // The whole of what is shown fits; it grows at once, and never shrinks while one looks.
  fit() {
    for (const trail of this.trails.values())
      for (const point of trail)
        if (point) this.half = Math.max(this.half, Math.abs(point[0]) + 0.5, Math.abs(point[1]) + 0.5);
    return this.half;
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.canvas,
      dots = devicePixelRatio;
    if (!width || !height) return;
    setIfChanged(this.canvas, "width", Math.round(width * dots));
    setIfChanged(this.canvas, "height", Math.round(height * dots));
    const pen = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    const color = (name) => paint(`var(${name})`);
    pen.setTransform(dots, 0, 0, dots, 0, 0);
    pen.clearRect(0, 0, width, height);
    const half = this.fit(),
      scale = (Math.min(width, height) / 2 - MARGIN) / half;
    const at = ([x, y]) => [width / 2 + scale * x, height / 2 - scale * y];
    this.grid(pen, color, { width, height, half, scale, at });
    for (const name of this.names)
      this.trail(pen, color(name === this.marked ? "--flown" : "--strong"), this.trails.get(name), at);
    for (const name of this.names)
      if (this.now.get(name)) this.vehicle(pen, color, name, this.now.get(name), at);
  }

  grid(pen, color, { width, height, half, scale, at }) {
    pen.strokeStyle = color("--line");
    pen.lineWidth = 1;
    pen.beginPath();
    const across = Math.ceil(width / 2 / scale),
      up = Math.ceil(height / 2 / scale),
      step = half > 12 ? 5 : 1;
    for (let x = -Math.floor(across / step) * step; x <= across; x += step) {
      const [px] = at([x, 0]);
      pen.moveTo(Math.round(px) + 0.5, 0);
      pen.lineTo(Math.round(px) + 0.5, height);
    }
    for (let y = -Math.floor(up / step) * step; y <= up; y += step) {
      const [, py] = at([0, y]);
      pen.moveTo(0, Math.round(py) + 0.5);
      pen.lineTo(width, Math.round(py) + 0.5);
    }
    pen.stroke();
    const [ox, oy] = at([0, 0]);
    for (const [name, tip] of [
      ["--x", [ox + 0.6 * scale, oy]],
      ["--y", [ox, oy - 0.6 * scale]],
    ]) {
      pen.strokeStyle = color(name);
      pen.lineWidth = 2;
      pen.beginPath();
      pen.moveTo(ox, oy);
      pen.lineTo(...tip);
      pen.stroke();
      pen.fillStyle = color(name);
      pen.font = font();
      pen.fillText(name.at(-1), tip[0] + 4, tip[1] + (name === "--x" ? 4 : 0));
    }
    pen.strokeStyle = pen.fillStyle = color("--dim");
    pen.lineWidth = 1.5;
    const left = 14,
      low = height - 14;
    pen.beginPath();
    pen.moveTo(left, low - 4);
    pen.lineTo(left, low);
    pen.lineTo(left + step * scale, low);
    pen.lineTo(left + step * scale, low - 4);
    pen.stroke();
    pen.fillText(`${step} m`, left + 4, low - 6);
  }

  trail(pen, color, trail, at) {
    pen.strokeStyle = color;
    pen.lineWidth = 1.5;
    pen.beginPath();
    let isDown = false;
    for (const point of trail) {
      if (!point) {
        isDown = false;
        continue;
      }
      if (isDown) pen.lineTo(...at(point));
      else pen.moveTo(...at(point));
      isDown = true;
    }
    pen.stroke();
  }

  vehicle(pen, color, name, position, at) {
    const [x, y] = at(position),
      [, , z, yaw] = position,
      isMarked = name === this.marked;
    pen.fillStyle = pen.strokeStyle = color(isMarked ? "--flown" : "--text");
    pen.beginPath();
    pen.arc(x, y, isMarked ? 6 : 4.5, 0, 2 * Math.PI);
    pen.fill();
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x + 11 * Math.cos(yaw), y - 11 * Math.sin(yaw));
    pen.stroke();
    pen.font = font(1, "600");
    pen.fillText(name, x + 9, y - 9);
    pen.fillStyle = color("--dim");
    pen.font = font();
    pen.fillText(fixed(z, 2), x + 9, y + 17);
  }
}
