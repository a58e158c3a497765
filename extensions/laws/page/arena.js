// The arena, below the list of runs: how often each control law is the first or near it, and its error on each
// course under each disturbance, with intervals. Results are files that `quadlab arena --out` wrote.

import { get } from "/static/core/api.js";
import { attempt, element, optionsOf, setText, svg, tableHead } from "/static/core/dom.js";

const COLOURS = ["text", "z", "amber", "y", "violet", "flown", "teal", "rose"];
const WIDTH = 440,
  LEFT = 122,
  RIGHT = 14,
  ROW = 20,
  TOP = 8,
  BOTTOM = 20;
const mm = (/** @type {number} */ value) => (1000 * value).toPrecision(3);
const colourOf = (/** @type {number} */ k) => `var(--${COLOURS[k % COLOURS.length]})`;

export function show(place) {
  new Arena(place);
}

class Arena {
  constructor(place) {
    this.chosen = element("select", { ariaLabel: "result", onchange: () => this.read() });
    this.reason = element("p", { className: "reason", hidden: true });
    this.empty = element("p", { className: "empty", hidden: true });
    this.standings = element("table", { className: "standings" });
    this.courses = element("div", { className: "courses" });
    this.all = element(
      "details",
      { ontoggle: () => this.list() },
      element("summary", {}, "Arena"),
      element("div", { className: "choices" }, this.chosen),
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
      this.chosen.hidden = results.length === 0;
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

  show({ standings, lines }) {
    /** @type {Map<string, string>} */
    const colours = new Map(standings.map(({ law }, k) => [law, colourOf(k)]));
    this.standings.replaceChildren(
      tableHead("law", "first", "within 10 %", "crashed", "error over the first's"),
      element("tbody", {}, ...standings.map((one) => standing(one, colours.get(one.law) ?? ""))),
    );
    const courses = [...new Set(lines.map(({ course }) => course))];
    this.courses.replaceChildren(
      ...courses.map((course) => {
        const own = lines.filter((line) => line.course === course);
        return element(
          "figure",
          {},
          element("figcaption", {}, course, element("small", {}, " mm")),
          drawn(course, own, colours),
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

// Errors of a course in mm, logarithmic: a line for each disturbance, a mark with its interval for each law.
function drawn(course, lines, colours) {
  const values = lines
    .flatMap(({ laws }) => laws.flatMap(({ low, high }) => [low, high]))
    .filter((one) => one);
  const [low, high] = [Math.min(...values) / 1.1, Math.max(...values) * 1.1];
  const x = (value) => LEFT + (Math.log(value / low) / Math.log(high / low)) * (WIDTH - LEFT - RIGHT);
  const height = TOP + ROW * lines.length + BOTTOM;
  const text = (at, y, words, anchor) => svg("text", { x: at, y, "text-anchor": anchor }, words);
  const ticks = decades(low, high).map((value) => [
    svg("line", { x1: x(value), x2: x(value), y1: TOP, y2: height - BOTTOM, class: "grid" }),
    text(x(value), height - 5, `${Number(mm(value))}`, "middle"),
  ]);
  const rows = lines.map(({ disturbance, laws }, k) => {
    const y = TOP + ROW * (k + 0.5);
    return [
      text(LEFT - 8, y + 4, disturbance, "end"),
      ...laws.map((one, n) => mark(one, x, y + 1.6 * (n - (laws.length - 1) / 2), colours.get(one.law))),
    ];
  });
  const label = `median error in mm on ${course}, by disturbance and law`;
  return svg(
    "svg",
    { viewBox: `0 0 ${WIDTH} ${height}`, class: "arena", role: "img", "aria-label": label },
    ...ticks.flat(),
    ...rows.flat(),
  );
}

function mark({ law, median, low, high, crashed, flights }, x, y, colour) {
  if (median === null) return svg("g", {});
  const lost = crashed ? `, ${crashed} of ${flights} crashed` : "";
  const about = `${law}: ${mm(median)} mm${low === null || high === null ? "" : ` (${mm(low)} … ${mm(high)})`}${lost}`;
  const from = low ?? median,
    to = high ?? median;
  const group = svg(
    "g",
    {},
    svg("title", {}, about),
    svg("line", { x1: x(from), x2: x(to), y1: y, y2: y }),
    svg("circle", { cx: x(median), cy: y, r: 3 }),
  );
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
