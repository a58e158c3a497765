// The flight volume: its walls as numbers, and the box to scale from above and from the side.

import { element, svg } from "../core/dom.js";
import { Fields } from "./fields.js";

const NAME = (axis, end) => `behavior.volume_${axis}_${end}`;
const LABELS = ["x", "y", "z"].flatMap((axis) => [
  [NAME(axis, "min"), `${axis} from`],
  [NAME(axis, "max"), `${axis} to`],
]);
const WIDTH = 320,
  HEIGHT = 240,
  MARGIN = 26; // of a drawing, px
const STEPS = [0.5, 1, 2, 5, 10, 20, 50];

export class VolumeSection {
  constructor(place, events, parameters) {
    this.parameters = parameters;
    const left = element("div"),
      drawings = element("div", { className: "drawings" });
    this.top = drawing("from above", "x", "y");
    this.side = drawing("from the side", "x", "z");
    drawings.append(this.top.figure, this.side.figure);
    place.append(
      element(
        "p",
        { className: "hint" },
        "No behavior leaves this volume. A lower limit above its upper one is refused.",
      ),
      element("div", { className: "volume" }, left, drawings),
    );
    this.fields = new Fields(left, parameters, LABELS);
    this.fields.addEventListener("draft", () => this.draw());
    this.draw();
  }

  draw() {
    const confirmed = box((name) => this.parameters.value(name)),
      typed = this.fields.values();
    const wanted = this.fields.isDraft ? box((name) => typed[name]) : null;
    // One scale for both, so that they can be compared.
    const boxes = [confirmed, wanted].filter((one) => one !== null);
    if (!boxes.length) return;
    const span = (axis) => [
      Math.min(0, ...boxes.map((one) => one[axis][0])),
      Math.max(0, ...boxes.map((one) => one[axis][1])),
    ];
    const spans = { x: span("x"), y: span("y"), z: span("z") };
    const room = (axis, pixels) => (pixels - 2 * MARGIN) / Math.max(0.1, spans[axis][1] - spans[axis][0]);
    const scale = Math.min(room("x", WIDTH), room("y", HEIGHT), room("z", HEIGHT));
    this.top.draw(spans, scale, confirmed, wanted);
    this.side.draw(spans, scale, confirmed, wanted);
  }
}

// value(name) → {x: [min, max], …} in m, or null while something is not known.
const spanOf = (axis, bounds) => `${axis} ${bounds[axis].join(" to ")} m`;

function box(value) {
  const made = Object.fromEntries(
    ["x", "y", "z"].map((axis) => [axis, [value(NAME(axis, "min")), value(NAME(axis, "max"))]]),
  );
  return Object.values(made).flat().every(Number.isFinite) ? made : null;
}

function drawing(title, across, up) {
  const picture = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img" });
  const caption = element(
    "figcaption",
    {},
    `${title}: `,
    element("span", { className: `axis-${across}` }, across),
    " to the right, ",
    element("span", { className: `axis-${up}` }, up),
    " up",
  );
  const figure = element("figure", {}, picture, caption);
  const draw = (spans, scale, confirmed, wanted) => {
    const middle = (axis) => (spans[axis][0] + spans[axis][1]) / 2;
    const x = (value) => WIDTH / 2 + scale * (value - middle(across)),
      y = (value) => HEIGHT / 2 - scale * (value - middle(up));
    const step = STEPS.find((one) => one * scale >= 22) ?? 100;
    const parts = [];
    for (const [axis, at, line] of [
      [across, x, (p) => ({ x1: p, x2: p, y1: 6, y2: HEIGHT - 18 })],
      [up, y, (p) => ({ y1: p, y2: p, x1: 24, x2: WIDTH - 4 })],
    ]) {
      const [from, to] = spans[axis];
      for (let value = Math.ceil(from / step) * step; value <= to + 1e-9; value += step) {
        parts.push(
          svg("line", { ...line(at(value)), class: Math.abs(value) < 1e-9 ? `zero axis-${axis}` : "grid" }),
        );
        const place =
          axis === across
            ? { x: at(value), y: HEIGHT - 6, "text-anchor": "middle" }
            : { x: 20, y: at(value) + 4, "text-anchor": "end" };
        parts.push(svg("text", place, String(Number(value.toFixed(1))).replace("-", "−")));
      }
    }
    for (const [one, kind] of [
      [confirmed, "confirmed"],
      [wanted, "wanted"],
    ]) {
      if (!one) continue;
      const [left, right] = one[across],
        [low, high] = one[up];
      parts.push(
        svg("rect", {
          class: kind,
          x: x(Math.min(left, right)),
          y: y(Math.max(low, high)),
          width: scale * Math.abs(right - left),
          height: scale * Math.abs(high - low),
        }),
      );
    }
    picture.replaceChildren(...parts);
    picture.setAttribute(
      "aria-label",
      confirmed
        ? `flight volume ${title}: ${[across, up].map((axis) => spanOf(axis, confirmed)).join(", ")}`
        : "flight volume, not known yet",
    );
  };
  return { figure, draw };
}
