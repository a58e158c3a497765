// A camera that orbits a point: where a point of the world (z up, m) is on a canvas.

const NEAR = 0.05; // m

export class Camera {
  target;
  turn;
  rise;
  distance;
  eye;
  right;
  up;
  back;
  focal;
  center;

  constructor() {
    this.reset();
  }

  reset() {
    Object.assign(this, { target: [0, 0, 0.8], turn: -2.26, rise: 0.36, distance: 3.4 });
  }

  // Where the vehicle is seen from; from there it can be turned and zoomed.
  choose(look) {
    if (look === "top") Object.assign(this, { turn: -Math.PI / 2, rise: 1.55, distance: 4.5 });
    else if (look === "side") Object.assign(this, { turn: -Math.PI / 2, rise: 0.12, distance: 3.2 });
    else if (this.distance < 0.4) this.reset();
  }

  // In the vehicle, looking along its nose; the horizon stays level.
  sitOn({ position }, turn) {
    const ahead = [turn[0], turn[3], turn[6]];
    Object.assign(this, {
      turn: Math.atan2(-ahead[1], -ahead[0]),
      rise: Math.asin(Math.max(-1, Math.min(1, -ahead[2]))),
      distance: 0.1,
      target: position.map((c, i) => c + 0.26 * ahead[i]),
    });
  }

  // Once a drawing, before `project`.
  prepare(width, height) {
    const { turn, rise, distance, target } = this;
    const back = [Math.cos(rise) * Math.cos(turn), Math.cos(rise) * Math.sin(turn), Math.sin(rise)];
    this.eye = target.map((x, i) => x + distance * back[i]);
    this.right = [-Math.sin(turn), Math.cos(turn), 0];
    this.up = [-Math.sin(rise) * Math.cos(turn), -Math.sin(rise) * Math.sin(turn), Math.cos(rise)];
    this.back = back;
    this.focal = 0.85 * Math.max(height, 0.6 * width);
    this.center = [width / 2, height / 2];
  }

  /**
   * Camera axes: right, up, depth.
   * @returns {[number, number, number]}
   */
  seen([x, y, z]) {
    const a = x - this.eye[0],
      b = y - this.eye[1],
      c = z - this.eye[2];
    return [
      a * this.right[0] + b * this.right[1],
      a * this.up[0] + b * this.up[1] + c * this.up[2],
      -(a * this.back[0] + b * this.back[1] + c * this.back[2]),
    ];
  }

  /** @returns {[number, number]} */
  flat([a, b, depth]) {
    return [this.center[0] + (this.focal * a) / depth, this.center[1] - (this.focal * b) / depth];
  }

  // [x, y] in pixels, or null behind the eye.
  project(point) {
    const seen = this.seen(point);
    return seen[2] > NEAR ? this.flat(seen) : null;
  }

  // Both ends of a line, cut off behind the eye; null when all of it is there.
  segment(p, q) {
    let a = this.seen(p),
      b = this.seen(q);
    if (a[2] <= NEAR && b[2] <= NEAR) return null;
    if (a[2] <= NEAR) a = cut(a, b);
    else if (b[2] <= NEAR) b = cut(b, a);
    return [this.flat(a), this.flat(b)];
  }

  orbit(dx, dy) {
    this.turn -= 0.006 * dx;
    this.rise = Math.min(1.55, Math.max(-0.2, this.rise + 0.006 * dy));
  }

  pan(dx, dy) {
    const scale = this.distance / this.focal;
    this.target = this.target.map((x, i) => x - scale * (dx * this.right[i] - dy * this.up[i]));
  }

  zoom(factor) {
    this.distance = Math.min(60, Math.max(0.4, this.distance * factor));
  }
}

/** @returns {[number, number, number]} */
function cut(behind, before) {
  const share = (NEAR - behind[2]) / (before[2] - behind[2]);
  return behind.map((x, i) => x + share * (before[i] - x) + (i === 2 ? 1e-6 : 0));
}

// Drag turns, right button or Shift pans, wheel and two fingers zoom, + and − too.
export function handle(canvas, camera, redraw) {
  const fingers = new Map();
  let apart = 0;
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    apart = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    const dx = event.clientX - before[0],
      dy = event.clientY - before[1];
    if (fingers.size === 2) {
      const [a, b] = [...fingers.values()],
        now = Math.hypot(a[0] - b[0], a[1] - b[1]);
      if (apart) camera.zoom(apart / now);
      apart = now;
      camera.pan(dx / 2, dy / 2);
    } else if (event.buttons & 2 || event.shiftKey) camera.pan(dx, dy);
    else camera.orbit(dx, dy);
    redraw();
  });
  for (const name of ["pointerup", "pointercancel"])
    canvas.addEventListener(name, (event) => {
      fingers.delete(event.pointerId);
      apart = 0;
    });
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      camera.zoom(Math.exp(0.0012 * event.deltaY));
      redraw();
    },
    { passive: false },
  );
  canvas.addEventListener("keydown", (event) => {
    const factor = { "+": 0.85, "=": 0.85, "-": 1.18 }[event.key];
    if (factor) {
      camera.zoom(factor);
      redraw();
      event.preventDefault();
    }
  });
}
