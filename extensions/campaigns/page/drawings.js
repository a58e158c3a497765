// A distribution as a curve, and medians over two factors as a map.

import { element, svg } from "/static/core/dom.js";
import { titleOf } from "/static/experiments/figures.js";

const WIDTH = 360,
  HEIGHT = 132,
  LEFT = 42,
  BOTTOM = 18,
  TOP = 6;

/** @type {(metric: string) => [string, string]} */
export const titled = (metric) => [metric, titleOf(metric)];

// Some digits, as people read them.
export function short(value, digits = 4) {
  const size = Math.abs(value);
  const isPlain = size === 0 || (size >= 1e-3 && size < 1e5);
  return isPlain ? String(Number(value.toPrecision(digits))) : value.toExponential(digits - 2);
}

export function drawEcdf({ values, shares, median, interval }, metric) {
  const low = values[0],
    high = values.at(-1),
    span = high - low || Math.abs(high) || 1;
  const x = (value) => LEFT + ((value - low) / span) * (WIDTH - LEFT - 8);
  const y = (share) => TOP + (1 - share) * (HEIGHT - TOP - BOTTOM);
  let path = `M${x(low)} ${y(0)}`;
  values.forEach((value, i) => {
    path += `H${x(value)}V${y(shares[i])}`;
  });
  const text = (at, place, words, anchor) => svg("text", { x: at, y: place, "text-anchor": anchor }, words);
  const [least, most] = interval.map((value) => short(value));
  const title = `${metric}: median ${short(median)}, 95 % ${least} … ${most}; from ${short(low)} to ${short(high)}`;
  return svg(
    "svg",
    { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "ecdf", role: "img", "aria-label": title },
    svg("title", {}, title),
    ...[0, 0.5, 1].flatMap((share) => [
      svg("line", { x1: LEFT, x2: WIDTH - 8, y1: y(share), y2: y(share), class: "grid" }),
      text(LEFT - 5, y(share) + 4, `${100 * share} %`, "end"),
    ]),
    svg("rect", {
      class: "interval",
      x: x(interval[0]),
      width: Math.max(1, x(interval[1]) - x(interval[0])),
      y: TOP,
      height: HEIGHT - TOP - BOTTOM,
    }),
    svg("line", { x1: x(median), x2: x(median), y1: TOP, y2: HEIGHT - BOTTOM, class: "median" }),
    svg("path", { d: path, class: "curve" }),
    text(LEFT, HEIGHT - 4, short(low), "start"),
    text(WIDTH - 8, HEIGHT - 4, short(high), "end"),
    ...(x(median) > LEFT + 50 && x(median) < WIDTH - 60
      ? [text(x(median), HEIGHT - 4, short(median), "middle")]
      : []),
  );
}

export function drawHeat({ x, y, medians }) {
  const finite = medians.flat().filter((value) => value !== null);
  const low = Math.min(...finite),
    span = Math.max(...finite) - low || 1;
  const cell = (value, i, j) => {
    const where = y[i] ? `${x[j]} × ${y[i]}` : x[j];
    const title = `${where}: ${value === null ? "no flight has it" : short(value)}`;
    const made = element("td", { title }, value === null ? "" : short(value, 3));
    if (value !== null) made.style.setProperty("--share", `${Math.round(8 + (47 * (value - low)) / span)}%`);
    return made;
  };
  const columns = x.map((label) => element("th", { scope: "col" }, label));
  const head = element("tr", {}, ...(y[0] ? [element("th")] : []), ...columns);
  const label = (text) => (text ? [element("th", { scope: "row" }, text)] : []);
  const body = medians.map((row, i) =>
    element("tr", {}, ...label(y[i]), ...row.map((value, j) => cell(value, i, j))),
  );
  return element(
    "table",
    { className: "heat" },
    element("thead", {}, head),
    element("tbody", {}, ...body.reverse()),
  );
}
