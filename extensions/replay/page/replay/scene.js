// The 3D view of a replay: vehicles, paths, beacons and volume on a plain canvas. It needs no GPU and
// nothing of the server once the tracks are here; the live page's scene is another.

import { element } from "/static/core/dom.js";
import { font, onTheme, paint } from "/static/core/theme.js";
import { colorOf } from "/static/view/path_color.js";
import { SHOWN, ViewTools } from "/static/view/tools.js";
import { Camera, handle } from "./camera.js";

const ARM = 0.25,
  ROTOR = 0.125,
  AXIS = 0.18; // m
const TRAIL = 20; // s
const WHOLE = 2500; // points of a whole path
const ROTORS = [
  [1, 0],
  [0, 1],
  [-1, 0],
  [0, -1],
];
const ROUND = Array.from({ length: 17 }, (_, k) => [
  Math.cos((k * Math.PI) / 8),
  Math.sin((k * Math.PI) / 8),
]);
const DEVIATIONS = 3; // of a cone to a beacon
const UNIT = [
  [1, 0, 0],
  [0, 1, 0],
  [0, 0, 1],
];
const FULL = { lead: { dash: [], alpha: 1 }, other: { dash: [6, 5], alpha: 0.55 } };

const colors = () =>
  Object.fromEntries(
    [
      "x",
      "y",
      "z",
      "flown",
      "wanted",
      "truth",
      "text",
      "dim",
      "line",
      "strong",
      "stale",
      "ground",
      "amber",
    ].map((name) => [name, paint(`var(--${name})`)]),
  );

export class ReplayScene {
  constructor(place, clock) {
    this.clock = clock;
    this.runs = [];
    this.camera = new Camera();
    this.view = { ...SHOWN, cones: true };
    this.look = "follow";
    this.canvas = element("canvas", {
      tabIndex: 0,
      ariaLabel: "3D view: drag to turn, Shift and drag to move, wheel or + and − to zoom",
    });
    this.canvas.setAttribute("role", "img");
    const reset = element(
      "button",
      {
        title: "return to the initial view",
        onclick: () => {
          this.camera.reset();
          this.draw();
        },
      },
      "Reset view",
    );
    const key = (name, words) => element("span", { className: `key ${name}` }, words);
    this.truthKey = key("truth", "truth");
    const overlay = element("div", { className: "overlay bottom" }, this.truthKey, reset);
    const cones = element("input", {
      type: "checkbox",
      checked: true,
      onchange: () => {
        this.view.cones = cones.checked;
        this.draw();
      },
    });
    const tools = new ViewTools(overlay, {
      camera: this.look,
      note: "Grid 0.5 m",
      more: [
        element(
          "label",
          { title: "three standard deviations of a bearing, around each beacon or vehicle in sight" },
          cones,
          "Bearing cones",
        ),
      ],
      onCamera: (look) => {
        this.look = look;
        this.camera.choose(look);
        this.draw();
      },
      onView: (change) => {
        tools.show(Object.assign(this.view, change));
        this.hasTruth();
        this.draw();
      },
    });
    place.append(this.canvas, overlay);
    // By the processor: few lines, and an emulated GPU is slow.
    this.pen = /** @type {CanvasRenderingContext2D} */ (
      this.canvas.getContext("2d", { willReadFrequently: true })
    );
    this.color = colors();
    onTheme(place, () => {
      this.color = colors();
      this.draw();
    });
    handle(this.canvas, this.camera, () => this.draw());
    new ResizeObserver(() => this.resize()).observe(place);
    this.place = place;
  }

  setRuns(runs) {
    this.runs = runs;
    for (const run of runs) run.path ??= thinned(run);
    this.hasTruth();
    this.draw();
  }

  hasTruth() {
    this.truthKey.hidden = !this.view.truth || !this.runs.some((run) => "truth" in run.description.topics);
  }

  resize() {
    const ratio = Math.min(2, devicePixelRatio || 1);
    this.width = this.place.clientWidth;
    this.height = this.place.clientHeight;
    this.canvas.width = Math.max(1, this.width * ratio);
    this.canvas.height = Math.max(1, this.height * ratio);
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.draw();
  }

  draw() {
    if (!this.width || !this.runs.length) return;
    const { pen, camera, clock } = this,
      lead = this.runs[0];
    const pose = lead.pose("state", clock.t) ?? lead.pose("truth", clock.t);
    if (this.look !== "free" && pose) camera.target = pose.position;
    if (this.look === "first" && pose) camera.sitOn(pose, rotation(pose.rotation));
    camera.prepare(this.width, this.height);
    pen.globalAlpha = 1;
    pen.setLineDash([]);
    pen.fillStyle = this.color.ground;
    pen.fillRect(0, 0, this.width, this.height);
    if (this.view.ground) this.ground();
    if (this.view.volume) {
      this.volume(lead.description.volume, this.color.stale);
      for (const box of lead.description.boxes ?? []) this.volume(box, this.color.x, 0.12);
    }
    this.beacons(lead.beacons(clock.t));
    if (this.view.cones) this.cones(lead, clock.t);
    for (const run of [...this.runs].reverse()) this.run(run, run === lead ? FULL.lead : FULL.other);
    pen.globalAlpha = 1;
    pen.setLineDash([]);
  }

  run(run, { dash, alpha }) {
    const t = this.clock.t + run.shift,
      { pen } = this;
    pen.globalAlpha = 0.28 * alpha;
    pen.setLineDash(dash);
    if (this.view.flown) this.line(run.path, this.color.flown, 1);
    pen.globalAlpha = alpha;
    if (this.view.reference) this.line(trail(run, "reference", t), this.color.wanted, 1.2);
    if (this.view.flown) this.flown(run, t);
    const truth = this.view.truth && run.pose("truth", t),
      pose = run.pose("state", t),
      wanted = run.pose("reference", t);
    if (truth) {
      pen.globalAlpha = 0.45 * alpha;
      this.frame(truth, this.color.truth, null);
    }
    pen.globalAlpha = alpha;
    if (wanted && this.view.reference) this.dot(wanted.position, this.color.wanted, 3.5);
    if (!pose) return;
    if (wanted && this.view.error)
      this.line(
        [pose.position, pose.position.map((c, i) => c + this.view.magnified * (wanted.position[i] - c))],
        this.color.x,
        3,
      );
    const [x, y, z] = pose.position;
    if (this.look === "first" && run === this.runs[0]) return;
    if (z > 0.05) {
      pen.setLineDash([2, 3]);
      this.line(
        [
          [x, y, 0],
          [x, y, z],
        ],
        this.color.dim,
        1,
      );
    }
    pen.setLineDash(dash.length ? [3, 2] : []);
    this.vehicle(pose, run.motors(t), t);
  }

  // The path of the last seconds, its parts in the colours of the chosen signal.
  flown(run, t) {
    const { color } = this.view,
      points = trail(run, "state", t);
    if (color === "none") {
      this.line(points, this.color.flown, 2.2);
      return;
    }
    const values = rowsOf(run, t).map((k) => run.signal(color, k));
    for (let k = 1; k < points.length; k++) {
      const value = values[Math.min(k, values.length - 1)];
      this.line(points.slice(k - 1, k + 1), value === null ? this.color.dim : colorOf(color, value), 2.2);
    }
  }

  vehicle(pose, motors, t) {
    const turn = rotation(pose.rotation),
      at = (p) => moved(turn, pose.position, p),
      { pen } = this,
      alpha = pen.globalAlpha;
    this.frame(pose, this.color.text, this.color.flown);
    UNIT.forEach((axis, i) =>
      this.line(
        [at([0, 0, 0.035]), at(axis.map((c, k) => AXIS * c + (k === 2 ? 0.035 : 0)))],
        this.color["xyz"[i]],
        2.5,
      ),
    );
    ROTORS.forEach(([x, y], i) => {
      const hub = [ARM * x, ARM * y, 0.055];
      pen.globalAlpha = 0.16 * alpha;
      this.area(
        ROUND.map(([c, s]) => at([hub[0] + ROTOR * c, hub[1] + ROTOR * s, hub[2]])),
        i === 0 ? this.color.flown : this.color.text,
      );
      pen.globalAlpha = alpha;
      // Real propellers turn 80 times a second: a share of it, and the same at the same instant.
      const angle = motors && motors[i] > 31 ? (i % 2 ? 1 : -1) * t * 9 * (1 + i / 50) : 0.4;
      const [c, s] = [ROTOR * Math.cos(angle), ROTOR * Math.sin(angle)];
      this.line(
        [at([hub[0] - c, hub[1] - s, hub[2]]), at([hub[0] + c, hub[1] + s, hub[2]])],
        this.color.text,
        1.5,
      );
    });
  }

  // Arms and rims; `front` is the colour of the front arm.
  frame(pose, color, front) {
    const turn = rotation(pose.rotation),
      at = (p) => moved(turn, pose.position, p);
    ROTORS.forEach(([x, y], i) => {
      const own = i === 0 && front ? front : color,
        hub = [ARM * x, ARM * y, 0];
      this.line([at([0, 0, 0]), at(hub)], own, 3.5);
      this.line([at(hub), at([hub[0], hub[1], 0.055])], own, 2);
      this.line(
        ROUND.map(([c, s]) => at([hub[0] + ROTOR * c, hub[1] + ROTOR * s, 0.055])),
        own,
        1,
      );
    });
  }

  ground() {
    for (let k = -6; k <= 6; k++) {
      const color = k % 2 ? this.color.line : this.color.strong;
      this.pen.globalAlpha = k % 2 ? 0.7 : 0.8;
      this.line(
        [
          [k, -6, 0],
          [k, 6, 0],
        ],
        color,
        1,
      );
      this.line(
        [
          [-6, k, 0],
          [6, k, 0],
        ],
        color,
        1,
      );
    }
    this.pen.globalAlpha = 1;
    UNIT.forEach((axis, i) => this.line([[0, 0, 0], axis.map((c) => 0.5 * c)], this.color["xyz"[i]], 2));
  }

  // The edges of a box; its faces too, where `shade` is more than 0.
  volume(box, color, shade = 0) {
    if (!box) return;
    const corner = (k) => box.map((side, axis) => side[(k >> axis) & 1]);
    for (let k = 0; k < 8; k++)
      for (const bit of [1, 2, 4]) if (!(k & bit)) this.line([corner(k), corner(k | bit)], color, 1);
    this.pen.globalAlpha = shade;
    for (const [a, b, c] of [
      [1, 2, 4],
      [2, 4, 1],
      [4, 1, 2],
    ])
      for (const side of shade ? [0, c] : [])
        this.area([side, side | a, side | a | b, side | b].map(corner), color);
    this.pen.globalAlpha = 1;
  }

  beacons(rows) {
    this.pen.font = font();
    this.pen.textAlign = "center";
    for (const [id, x, y, z] of rows) {
      this.line(
        [
          [x, y, 0],
          [x, y, z],
        ],
        this.color.dim,
        1,
      );
      const at = this.dot([x, y, z], this.color.amber, 4);
      if (at) this.pen.fillText(String(id), at[0], at[1] - 8);
    }
  }

  // From the true pose, else the estimate, to each beacon in sight, and a metre towards each vehicle seen.
  cones(run, t) {
    const pose = run.pose("truth", t) ?? run.pose("state", t),
      sight = pose && run.sight(t),
      others = pose && run.neighbours(t);
    if (sight) this.conesTo(pose, sight.places, sight.sigma, this.color.amber);
    if (!others) return;
    const turn = rotation(pose.rotation),
      tips = others.seen.map(([, x, y, z]) => moved(turn, pose.position, [x, y, z]));
    this.conesTo(pose, tips, others.sigma, this.color.wanted);
    tips.forEach((tip, k) => {
      const at = this.dot(tip, this.color.wanted, 2);
      if (at) this.pen.fillText(String(others.seen[k][0]), at[0] + 5, at[1] - 5);
    });
  }

  conesTo(pose, places, sigma, color) {
    for (const place of places) {
      const along = place.map((c, i) => c - pose.position[i]),
        length = Math.hypot(...along),
        radius = length * Math.tan(DEVIATIONS * sigma);
      const [x, y, z] = along.map((c) => c / length),
        level = Math.hypot(x, y) || 1e-9;
      const side = [-y / level, x / level, 0],
        up = [(-z * x) / level, (-z * y) / level, level];
      const rim = ROUND.map(([c, s]) => place.map((p, i) => p + radius * (c * side[i] + s * up[i])));
      this.pen.globalAlpha = 0.09;
      for (let k = 1; k < rim.length; k++) this.area([pose.position, rim[k - 1], rim[k]], color);
      this.pen.globalAlpha = 0.7;
      this.line(rim, color, 1);
    }
    this.pen.globalAlpha = 1;
  }

  line(points, color, width) {
    const { pen, camera } = this;
    pen.strokeStyle = color;
    pen.lineWidth = width;
    pen.beginPath();
    let isOpen = false;
    for (let k = 1; k < points.length; k++) {
      const segment = points[k - 1] && points[k] ? camera.segment(points[k - 1], points[k]) : null;
      if (!segment) {
        isOpen = false;
        continue;
      }
      if (!isOpen) pen.moveTo(...segment[0]);
      pen.lineTo(...segment[1]);
      isOpen = true;
    }
    pen.stroke();
  }

  area(points, color) {
    const flat = points.map((point) => this.camera.project(point));
    if (flat.includes(null)) return;
    this.pen.fillStyle = color;
    this.pen.beginPath();
    for (const point of flat) if (point) this.pen.lineTo(point[0], point[1]);
    this.pen.fill();
  }

  dot(point, color, radius) {
    const at = this.camera.project(point);
    if (!at) return null;
    this.pen.fillStyle = color;
    this.pen.beginPath();
    this.pen.arc(at[0], at[1], radius, 0, 2 * Math.PI);
    this.pen.fill();
    return at;
  }
}

const point = (run, part, k) => {
  const i = k * run.track.width + run.place[part],
    { rows } = run.track;
  return Number.isNaN(rows[i]) ? null : [rows[i], rows[i + 1], rows[i + 2]];
};

// All of a path in few points; null parts it.
function thinned(run) {
  const step = Math.max(1, Math.ceil(run.track.count / WHOLE)),
    found = [];
  for (let k = 0; k < run.track.count; k += step) found.push(point(run, "state", k));
  return found;
}

// The rows of the track that the path of the last seconds shows.
function rowsOf({ track: { rate, count } }, t) {
  const last = Math.min(count - 1, Math.floor(t * rate)),
    step = Math.max(1, Math.floor(rate / 25)),
    found = [];
  for (let k = Math.max(0, (last - TRAIL * rate) | 0); k <= last; k += step) found.push(k);
  return found;
}

function trail(run, part, t) {
  const found = rowsOf(run, t).map((k) => point(run, part, k)),
    now = run.pose(part, t);
  if (now) found.push(now.position);
  return found;
}

function rotation([w, x, y, z]) {
  return [
    1 - 2 * (y * y + z * z),
    2 * (x * y - w * z),
    2 * (x * z + w * y),
    2 * (x * y + w * z),
    1 - 2 * (x * x + z * z),
    2 * (y * z - w * x),
    2 * (x * z - w * y),
    2 * (y * z + w * x),
    1 - 2 * (x * x + y * y),
  ];
}

const moved = (r, [px, py, pz], [x, y, z]) => [
  px + r[0] * x + r[1] * y + r[2] * z,
  py + r[3] * x + r[4] * y + r[5] * z,
  pz + r[6] * x + r[7] * y + r[8] * z,
];
