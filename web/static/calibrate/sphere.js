// Which way was up in the poses held so far, on a sphere about the vehicle: body x forward, y left,
// z up. Points behind the sphere are hollow; the next pose is a ring, the vehicle now a cross.

import { element, svg } from "../core/dom.js";

const POSE = /^pose (\d+) ([xyz])$/,
  NEXT = /^next ([xyz])$/;
const SIZE = 190,
  RADIUS = 72;
const YAW = 0.6,
  PITCH = 0.42; // rad: seen from the front left and above
/** @type {[string, [number, number, number], string][]} */
const AXES = [
  ["forward", [1, 0, 0], "x"],
  ["left", [0, 1, 0], "y"],
  ["up", [0, 0, 1], "z"],
];
/** @type {[string, [number, number, number]][]} */
const FACES = [
  ["upright", [0, 0, 1]],
  ["upside down", [0, 0, -1]],
  ["nose up", [1, 0, 0]],
  ["nose down", [-1, 0, 0]],
  ["left side up", [0, 1, 0]],
  ["right side up", [0, -1, 0]],
];
const FACE = 0.9; // cosine, within which a direction is that face

export const isPose = (name) => POSE.test(name) || NEXT.test(name);

// live: figures of the status → { done: Map(number → [x, y, z]), next: [x, y, z] or null }
export function posesOf(live) {
  const done = new Map(),
    next = [NaN, NaN, NaN];
  for (const { name, value } of live) {
    const [, number, axis] = POSE.exec(name) ?? [],
      [, ahead] = NEXT.exec(name) ?? [];
    if (axis) {
      if (!done.has(number)) done.set(number, [NaN, NaN, NaN]);
      done.get(number)["xyz".indexOf(axis)] = value ?? NaN;
    } else if (ahead) next["xyz".indexOf(ahead)] = value ?? NaN;
  }
  return {
    done: new Map([...done].filter(([, up]) => up.every(Number.isFinite))),
    next: next.every(Number.isFinite) ? next : null,
  };
}

export class PoseSphere {
  constructor() {
    this.svg = svg("svg", { viewBox: `0 0 ${SIZE} ${SIZE}`, role: "img", class: "sphere" });
    this.points = svg("g");
    this.svg.append(...backdrop(), this.points);
    this.text = element("p", { className: "covered" });
    const sign = (name, text) => element("span", { className: name }, text);
    this.place = element(
      "div",
      { className: "poses", hidden: true },
      this.svg,
      element(
        "div",
        {},
        this.text,
        element(
          "p",
          { className: "signs" },
          sign("held", "held: the direction of up"),
          sign("next", "next"),
          sign("now", "the vehicle now"),
        ),
      ),
    );
  }

  // done, next: of posesOf; now: [x, y, z], where up is in body axes, or null.
  show({ done, next }, now) {
    const marks = [
      ...[...done].map(([number, up]) => ({ up: unit(up), kind: "held", number })),
      ...(next ? [{ up: unit(next), kind: "next", number: "" }] : []),
      ...(now ? [{ up: unit(now), kind: "now", number: "" }] : []),
    ];
    marks.sort((one, other) => project(one.up)[2] - project(other.up)[2]);
    this.points.replaceChildren(...marks.map(mark));
    const names = [...done.values()].map(nameOf),
      count = done.size ? `${done.size} pose${done.size === 1 ? "" : "s"} held` : "No pose held yet",
      ahead = next ? `Next: ${nameOf(next)}.` : "";
    const whole = `${count}${names.length ? `: ${names.join(", ")}` : ""}. ${ahead}`;
    if (this.whole === whole) return;
    this.whole = whole;
    this.svg.setAttribute("aria-label", whole);
    // faces have short names
    this.text.textContent = names.every((name) => !name.includes("°")) ? whole : `${count}. ${ahead}`;
  }
}

// In words: a face of the vehicle, or by how much it is tilted and where to.
export function nameOf(up) {
  const [x, y, z] = unit(up),
    face = FACES.find(([, [a, b, c]]) => a * x + b * y + c * z > FACE);
  if (face && face[1].reduce((sum, value, i) => sum + value * [x, y, z][i], 0) > 0.995) return face[0];
  const tilt = Math.round((Math.acos(Math.min(1, Math.max(-1, z))) * 180) / Math.PI);
  const ways = [
    [x, "nose up"],
    [-x, "nose down"],
    [y, "left side up"],
    [-y, "right side up"],
  ]
    .filter(([share]) => share > 0.38 * Math.hypot(x, y))
    .sort((a, b) => b[0] - a[0])
    .map(([, way]) => way);
  return `${tilt}° ${ways.join(" and ").replace(" up and", " and") || "tilted"}`;
}

const unit = (up) => {
  const length = Math.hypot(...up) || 1;
  return up.map((value) => value / length);
};

// Right, down in pixels from the centre; the third is towards the eye.
function project([x, y, z]) {
  const cos = Math.cos(YAW),
    sin = Math.sin(YAW),
    towards = x * cos + y * sin,
    right = -x * sin + y * cos; // from ahead, left is on the right
  const tilted = z * Math.cos(PITCH) - towards * Math.sin(PITCH),
    depth = z * Math.sin(PITCH) + towards * Math.cos(PITCH);
  return [RADIUS * right, -RADIUS * tilted, depth];
}

function mark({ up, kind, number }) {
  const [x, y, depth] = project(up),
    side = depth < 0 ? "behind" : "ahead",
    at = `translate(${(SIZE / 2 + x).toFixed(1)} ${(SIZE / 2 + y).toFixed(1)})`;
  const group = svg("g", { class: `${kind} ${side}`, transform: at });
  if (kind === "now") group.append(svg("path", { d: "M-5 0H5M0 -5V5" }));
  else group.append(svg("circle", { r: kind === "next" ? 7 : 4 }));
  if (number) group.append(svg("text", { x: 6, y: -5 }, number));
  return group;
}

function backdrop() {
  const centre = SIZE / 2,
    ring = (around) => {
      const steps = Array.from({ length: 49 }, (_, i) => project(around((i * Math.PI) / 24)));
      const path = (isAhead) =>
        steps
          .map(([x, y, depth], i) =>
            depth >= 0 === isAhead
              ? `${i && steps[i - 1][2] >= 0 === isAhead ? "L" : "M"}${(centre + x).toFixed(1)} ` +
                `${(centre + y).toFixed(1)}`
              : "",
          )
          .join("");
      return [
        svg("path", { d: path(false), class: "ring behind" }),
        svg("path", { d: path(true), class: "ring" }),
      ];
    };
  const axes = AXES.flatMap(([name, direction, axis]) => {
    const [x, y] = project(direction),
      label = svg(
        "text",
        { x: centre + 1.16 * x, y: centre + 1.16 * y + 3, class: `axis-${axis}`, "text-anchor": "middle" },
        name,
      );
    return [
      svg("line", { x1: centre, y1: centre, x2: centre + x, y2: centre + y, class: `axis ${axis}` }),
      label,
    ];
  });
  return [
    svg("circle", { cx: centre, cy: centre, r: RADIUS, class: "outline" }),
    ...ring((a) => [Math.cos(a), Math.sin(a), 0]),
    ...ring((a) => [0, Math.cos(a), Math.sin(a)]),
    ...ring((a) => [Math.cos(a), 0, Math.sin(a)]),
    ...axes,
  ];
}
