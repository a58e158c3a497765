// The arena, below the list of runs: how often each control law is the first or near it, and its error on each
// course under each disturbance, with intervals, or against effort or processor time. Results are files that
// `quadlab arena --out` wrote.

import { get } from "/static/core/api.js";
import { attempt, element, optionsOf, setText, svg, tableHead } from "/static/core/dom.js";

const COLOURS = ["text", "z", "amber", "y", "violet", "rose", "teal", "flown"];
const WIDTH = 440,
  LEFT = 122,
  RIGHT = 14,
  ROW = 20,
  TOP = 8,
  BOTTOM = 20;
const BY_DISTURBANCE = "by disturbance";
const AGAINST = {
  "against effort": { unit: "N/s", of: ({ effort }) => effort },
  "against time of a tick": { unit: "µs", of: ({ tick }) => tick && 1e6 * tick },
};
const SCATTER = 190;
const mm = (/** @type {number} */ value) => (1000 * value).toPrecision(3);
const colourOf = (/** @type {number} */ k) => `var(--${COLOURS[k % COLOURS.length]})`;

export function show(place) {
  new Arena(place);
}

class Arena {
  constructor(place) {
    this.chosen = element("select", { ariaLabel: "result", onchange: () => this.read() });
    this.drawing = element(
      "select",
      { ariaLabel: "drawing", onchange: () => this.draw() },
      ...optionsOf([BY_DISTURBANCE, ...Object.keys(AGAINST)], BY_DISTURBANCE),
    );
    this.reason = element("p", { className: "reason", hidden: true });
    this.empty = element("p", { className: "empty", hidden: true });
    this.standings = element("table", { className: "standings" });
    this.courses = element("div", { className: "courses" });
    this.all = element(
      "details",
      { ontoggle: () => this.list() },
      element("summary", {}, "Arena"),
      element("div", { className: "choices" }, this.chosen, this.drawing),
      this.reason,
      this.empty,
      this.standings,
      this.courses,
    );
    place.append(this.all);
  }

  async list() {
    if (!this.all.open) return;
    await attempt(this.reason, async () => {
      const { folder, results } = await get("/api/arena");
      this.chosen.hidden = this.drawing.hidden = results.length === 0;
      this.empty.hidden = results.length > 0;
      setText(this.empty, `No result yet. Write one with: quadlab arena --out ${folder}/NAME.json`);
      this.chosen.replaceChildren(...optionsOf(results, this.chosen.value));
      if (results.length) await this.read();
    });
  }

  async read() {
    await attempt(this.reason, async () =>
      this.show(await get(`/api/arena/${encodeURIComponent(this.chosen.value)}`)),
    );
  }

  show(result) {
    this.result = result;
    const { standings } = result;
    /** @type {Map<string, string>} */
    const colours = new Map(standings.map(({ law }, k) => [law, colourOf(k)]));
    this.colours = colours;
    this.standings.replaceChildren(
      tableHead("law", "first", "within 10 %", "crashed", "error over the first's"),
      element("tbody", {}, ...standings.map((one) => standing(one, colours.get(one.law) ?? ""))),
    );
    this.draw();
  }

  draw() {
    const { lines } = this.result;
    const against = AGAINST[this.drawing.value];
    const courses = [...new Set(lines.map(({ course }) => course))];
    this.courses.replaceChildren(
      ...courses.map((course) => {
        const own = lines.filter((line) => line.course === course);
        return element(
          "figure",
          {},
          element(
            "figcaption",
            {},
            course,
            element("small", {}, against ? ` mm over ${against.unit}` : " mm"),
          ),
          against ? scattered(course, own, this.colours, against) : drawn(course, own, this.colours),
        );
      }),
    );
  }
}

function standing({ law, first, near, lines, crashed, flights, over_first: over }, colour) {
  const swatch = element("i", {});
  swatch.style.background = colour;
  const cells = [`${first} of ${lines}`, `${near} of ${lines}`, `${crashed} of ${flights}`];
  return element(
    "tr",
    {},
    element("th", { scope: "row" }, swatch, law),
    ...cells.map((text) => element("td", {}, text)),
    element("td", {}, over === null ? "–" : `× ${over.toFixed(2)}`),
  );
}

const text = (x, y, words, anchor) => svg("text", { x, y, "text-anchor": anchor }, words);

// The place on an axis of a logarithmic scale that has room for all values.
function scale(values, from, to) {
  const [low, high] = [Math.min(...values) / 1.1, Math.max(...values) * 1.1];
  const at = (value) => from + (Math.log(value / low) / Math.log(high / low)) * (to - from);
  return { at, ticks: decades(low, high) };
}

// An upright line of the grid with its value below.
function upright(x, height, words) {
  return [
    svg("line", { x1: x, x2: x, y1: TOP, y2: height - BOTTOM, class: "grid" }),
    text(x, height - 5, words, "middle"),
  ];
}

function figure(label, height, parts) {
  return svg(
    "svg",
    { viewBox: `0 0 ${WIDTH} ${height}`, class: "arena", role: "img", "aria-label": label },
    ...parts,
  );
}

// Errors of a course in mm, logarithmic: a line for each disturbance, a mark with its interval for each law.
function drawn(course, lines, colours) {
  const values = lines
    .flatMap(({ laws }) => laws.flatMap(({ low, high }) => [low, high]))
    .filter((one) => one);
  const x = scale(values, LEFT, WIDTH - RIGHT);
  const height = TOP + ROW * lines.length + BOTTOM;
  const rows = lines.map(({ disturbance, laws }, k) => {
    const y = TOP + ROW * (k + 0.5);
    return [
      text(LEFT - 8, y + 4, disturbance, "end"),
      ...laws.map((one, n) => mark(one, x.at, y + 1.6 * (n - (laws.length - 1) / 2), colours.get(one.law))),
    ];
  });
  const ticks = x.ticks.map((value) => upright(x.at(value), height, `${Number(mm(value))}`));
  const label = `median error in mm on ${course}, by disturbance and law`;
  return figure(label, height, [...ticks.flat(), ...rows.flat()]);
}

// Errors of a course in mm against another figure, both logarithmic: a dot for each law and disturbance.
function scattered(course, lines, colours, { unit, of }) {
  const dots = lines
    .flatMap(({ disturbance, laws }) => laws.map((one) => ({ ...one, disturbance, x: of(one) })))
    .filter(({ median, x }) => median && x);
  if (!dots.length) return element("p", { className: "empty" }, "This result does not have it.");
  const left = 48;
  const values = (name) => dots.map((one) => one[name]);
  const [x, y] = [scale(values("x"), left, WIDTH - RIGHT), scale(values("median"), SCATTER - BOTTOM, TOP)];
  const across = x.ticks.map((value) => upright(x.at(value), SCATTER, `${Number(value.toPrecision(3))}`));
  const rows = y.ticks.map((value) => [
    svg("line", { x1: left, x2: WIDTH - RIGHT, y1: y.at(value), y2: y.at(value), class: "grid" }),
    text(left - 8, y.at(value) + 4, `${Number(mm(value))}`, "end"),
  ]);
  const marks = dots.map((one) => {
    const about = `${one.law}, ${one.disturbance}: ${mm(one.median)} mm, ${one.x.toPrecision(3)} ${unit}`;
    return coloured(
      colours.get(one.law),
      about,
      svg("circle", { cx: x.at(one.x), cy: y.at(one.median), r: 3 }),
    );
  });
  const label = `median error in mm on ${course} against ${unit}, by law and disturbance`;
  return figure(label, SCATTER, [...across.flat(), ...rows.flat(), ...marks]);
}

function mark({ law, median, low, high, crashed, flights }, x, y, colour) {
  if (median === null) return svg("g", {});
  const lost = crashed ? `, ${crashed} of ${flights} crashed` : "";
  const about = `${law}: ${mm(median)} mm${low === null || high === null ? "" : ` (${mm(low)} … ${mm(high)})`}${lost}`;
  const from = low ?? median,
    to = high ?? median;
  return coloured(
    colour,
    about,
    svg("line", { x1: x(from), x2: x(to), y1: y, y2: y }),
    svg("circle", { cx: x(median), cy: y, r: 3 }),
  );
}

function coloured(colour, about, ...parts) {
  const group = svg("g", {}, svg("title", {}, about), ...parts);
  group.style.setProperty("--law", colour); // an attribute would be an inline style, which the page forbids
  return group;
}

function decades(low, high) {
  const found = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power += 1)
    for (const digit of [1, 2, 5]) {
      const value = digit * 10 ** power;
      if (value > low && value < high) found.push(value);
    }
  return found;
}
