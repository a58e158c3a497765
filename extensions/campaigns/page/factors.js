// What the factors do: main effects, Sobol' indices, single flights as a scatter matrix and as parallel coordinates,
// and the course of a search or its Pareto front. Flights that are drawn can be chosen.

import { svg } from "/static/core/dom.js";
import { titleOf } from "/static/experiments/figures.js";
import { short } from "./drawings.js";

const WIDTH = 360,
  EDGE = 8,
  LEFT = 52,
  BOTTOM = 30;

const last = (name) => (name.includes(".") ? name.slice(name.lastIndexOf(".") + 1) : titleOf(name));
const text = (x, y, words, anchor = "middle", more = {}) =>
  svg("text", { x, y, "text-anchor": anchor, ...more }, words);
const cut = (words) => (words.length > 8 ? `${words.slice(0, 7)}…` : words);
const titled = (made, words) => {
  made.append(svg("title", {}, words));
  return made;
};

// The scale from values to places.
function scale(values, from, to) {
  const low = Math.min(...values),
    high = Math.max(...values),
    span = high - low || Math.abs(high) || 1;
  return Object.assign((value) => from + ((value - low) / span) * (to - from), { low, high });
}

const figure = (kind, height, label, ...parts) =>
  svg(
    "svg",
    { viewBox: `0 0 ${WIDTH} ${height}`, class: `plot ${kind}`, role: "img", "aria-label": label },
    ...parts,
  );

// Ends of both axes, with their values.
const ends = (x, y, left, right, top, bottom) => [
  ...[y.low, y.high].flatMap((value) => [
    svg("line", { x1: left, x2: right, y1: y(value), y2: y(value), class: "grid" }),
    text(left - 5, y(value) + 4, short(value, 3), "end"),
  ]),
  text(left, bottom + 12, short(x.low, 3), "start"),
  text(right, bottom + 12, short(x.high, 3), "end"),
];

// A flight can be chosen by a click, and by the keyboard in the list of flights.
function choosable(made, words, choose) {
  made.addEventListener("click", choose);
  return titled(made, words);
}

export function drawEffects(effects, metric) {
  const columns = Math.min(3, effects.length),
    wide = (WIDTH - LEFT) / columns,
    tall = 104;
  const every = effects.flatMap(({ levels }) => levels.flatMap(({ low, high }) => [low, high]));
  const parts = effects.flatMap(({ factor, levels }, k) => {
    const left = LEFT + (k % columns) * wide + EDGE,
      top = Math.floor(k / columns) * tall + EDGE,
      bottom = top + tall - BOTTOM - EDGE;
    const y = scale(every, bottom, top),
      x = scale([0, levels.length - 1], left, left + wide - 2 * EDGE);
    const line = levels.map(({ median }, i) => `${i ? "L" : "M"}${x(i)} ${y(median)}`).join("");
    const marks = levels.flatMap(({ level, median, low, high }, i) => [
      svg("line", { x1: x(i), x2: x(i), y1: y(low), y2: y(high), class: "interval" }),
      titled(
        svg("circle", { cx: x(i), cy: y(median), r: 3 }),
        `${factor} = ${level}: median ${short(median)}, 95 % ${short(low)} … ${short(high)}`,
      ),
    ]);
    const values = [y.low, y.high].flatMap((value) => [
      svg("line", { x1: left, x2: left + wide - 2 * EDGE, y1: y(value), y2: y(value), class: "grid" }),
      ...(k % columns ? [] : [text(LEFT - 5, y(value) + 4, short(value, 3), "end")]),
    ]);
    // A bin's label has both of its ends.
    const [start, end] = [levels[0].level.split(" … ")[0], levels.at(-1).level.split(" … ").at(-1)];
    const names = [
      text(left, bottom + 12, cut(start), "start"),
      text(left + wide - 2 * EDGE, bottom + 12, cut(end), "end"),
    ];
    const name = titled(text(left + wide / 2 - EDGE, bottom + 24, last(factor)), factor);
    return [
      ...values,
      svg("path", { d: line, class: "curve" }),
      ...marks,
      ...(levels.length > 1 ? names : []),
      name,
    ];
  });
  const rows = Math.ceil(effects.length / columns);
  return figure("effects", rows * tall, `medians of ${metric} at each level of a factor`, ...parts);
}

const about = (value, half) => `${value.toFixed(3)} ± ${half.toFixed(3)}`;

export function drawIndices(rows, metric) {
  const name = 118,
    right = WIDTH - 84,
    tall = 28;
  const x = (share) => name + Math.min(1, Math.max(0, share)) * (right - name);
  const parts = rows.flatMap(({ factor, first, first_95: firstHalf, total, total_95: totalHalf }, k) => {
    const top = k * tall + 4;
    const bar = (share, half, y, kind) => [
      svg("rect", { x: name, y, width: Math.max(0.5, x(share) - name), height: 8, class: kind }),
      svg("line", { x1: x(share - half), x2: x(share + half), y1: y + 4, y2: y + 4, class: "interval" }),
    ];
    const words = `${factor}: first order ${about(first, firstHalf)}, total ${about(total, totalHalf)}`;
    const drawn = [
      text(name - 6, top + 13, last(factor), "end"),
      ...bar(first, firstHalf, top, "first"),
      ...bar(total, totalHalf, top + 10, "total"),
      text(WIDTH - 2, top + 13, `${first.toFixed(2)} · ${total.toFixed(2)}`, "end"),
    ];
    return [titled(svg("g", {}, ...drawn), words)];
  });
  return figure(
    "indices",
    rows.length * tall + 4,
    `Sobol' indices of ${metric}: first order, total`,
    ...parts,
  );
}

export function drawScatter({ names, indices, values }, choose) {
  const shown = [...names.keys()].slice(-4),
    wide = (WIDTH - LEFT) / shown.length,
    tall = Math.min(wide, 92);
  const column = (k) => values.map((row) => row[k]);
  const parts = shown.flatMap((down, i) =>
    shown.flatMap((across, j) => {
      const left = LEFT + j * wide + 3,
        top = i * tall + 3;
      const x = scale(column(across), left + 3, left + wide - 9),
        y = scale(column(down), top + tall - 9, top + 3);
      const cell = svg("rect", { x: left, y: top, width: wide - 6, height: tall - 6, class: "cell" });
      if (i === j) return [cell, ...histogram(column(across), x, top + tall - 6, tall - 14)];
      const dots = values.map((row, n) =>
        choosable(
          svg("circle", { cx: x(row[across]), cy: y(row[down]), r: 1.8 }),
          `flight ${indices[n]}: ${[across, down].map((k) => `${last(names[k])} ${short(row[k])}`).join(", ")}`,
          () => choose(indices[n]),
        ),
      );
      return [cell, ...dots];
    }),
  );
  const height = shown.length * tall;
  const labels = shown.flatMap((k, i) => {
    const y = (i + 0.5) * tall;
    return [
      titled(
        text(LEFT - 6, y, last(names[k]), "middle", { transform: `rotate(-90 ${LEFT - 6} ${y})` }),
        names[k],
      ),
      titled(text(LEFT + (i + 0.5) * wide, height + 12, last(names[k])), names[k]),
    ];
  });
  return figure("scatter", height + 18, `${values.length} flights: ${names.join(", ")}`, ...parts, ...labels);
}

function histogram(values, x, bottom, tall) {
  const bins = 12,
    counts = Array(bins).fill(0),
    span = x.high - x.low || 1;
  for (const value of values) counts[Math.min(bins - 1, Math.floor(((value - x.low) / span) * bins))] += 1;
  const most = Math.max(...counts),
    wide = (x(x.low + span) - x(x.low)) / bins;
  return counts.map((count, k) =>
    svg("rect", {
      x: x(x.low) + k * wide,
      y: bottom - (count / most) * tall,
      width: wide,
      height: (count / most) * tall,
      class: "bar",
    }),
  );
}

export function drawParallel({ names, indices, values }, choose) {
  const top = 16,
    bottom = 136;
  const place = scale([0, names.length - 1], EDGE, WIDTH - EDGE);
  const scales = names.map((_, k) =>
    scale(
      values.map((row) => row[k]),
      bottom,
      top,
    ),
  );
  const metric = scales.at(-1);
  const side = (k) => (k === 0 ? "start" : k === names.length - 1 ? "end" : "middle");
  const axes = names.flatMap((name, k) => [
    svg("line", { x1: place(k), x2: place(k), y1: top, y2: bottom, class: "grid" }),
    text(place(k), top - 5, short(scales[k].high, 3), side(k)),
    text(place(k), bottom + 11, short(scales[k].low, 3), side(k)),
    titled(text(place(k), bottom + (k % 2 ? 37 : 24), last(name), side(k)), name),
  ]);
  const lines = values.map((row, n) => {
    const d = row.map((value, k) => `${k ? "L" : "M"}${place(k)} ${scales[k](value)}`).join("");
    const made = svg("path", { d, class: "flight" });
    made.style.setProperty(
      "--share",
      `${Math.round((100 * (bottom - metric(row.at(-1)))) / (bottom - top))}%`,
    );
    return choosable(made, `flight ${indices[n]}: ${last(names.at(-1))} ${short(row.at(-1))}`, () =>
      choose(indices[n]),
    );
  });
  return figure(
    "parallel",
    bottom + 42,
    `${values.length} flights as lines through ${names.join(", ")}`,
    ...lines,
    ...axes,
  );
}

// The trials of a search: by their two first aims, or by their number and the only one.
export function drawSearch({ aims, best, trials }) {
  const whole = trials.filter(({ values }) => values.length);
  if (!whole.length) return null;
  const isFront = aims.length > 1,
    height = 150,
    right = WIDTH - EDGE,
    bottom = height - BOTTOM;
  const at = isFront ? ({ values }) => [values[0], values[1]] : ({ trial, values }) => [trial, values[0]];
  const x = scale(
      whole.map((one) => at(one)[0]),
      LEFT,
      right,
    ),
    y = scale(
      whole.map((one) => at(one)[1]),
      bottom,
      EDGE,
    );
  const dots = whole.map((one) => {
    const [a, b] = at(one),
      isBest = best.includes(one.trial);
    const words = Object.entries(one.parameters).map(([name, value]) => `${name}=${anyShort(value)}`);
    const values = one.values.map((value, k) => `${aims[k]} ${short(value)}`).join(", ");
    const dot = svg("circle", { cx: x(a), cy: y(b), r: isBest ? 3.5 : 2.2, class: isBest ? "best" : "" });
    return titled(dot, `trial ${one.trial}: ${values}; ${words.join(" ")}`);
  });
  let least = Infinity;
  const corners = isFront
    ? whole
        .filter(({ trial }) => best.includes(trial))
        .map(at)
        .sort(([a], [b]) => a - b)
    : whole.map(({ trial, values }) => [trial, (least = Math.min(least, values[0]))]);
  const line = corners.map(([a, b], k) => (k ? `H${x(a)}V${y(b)}` : `M${x(a)} ${y(b)}`)).join("");
  const name = text((LEFT + right) / 2, bottom + 12, isFront ? aims[0] : "trial");
  const other = text(LEFT, height - 3, `↑ ${isFront ? aims[1] : aims[0]}`, "start");
  const label = isFront
    ? `Pareto front of ${aims.join(" and ")}`
    : `${aims[0]} of each trial, and the least so far`;
  return figure(
    "search",
    height,
    label,
    ...ends(x, y, LEFT, right, EDGE, bottom),
    svg("path", { d: line, class: "curve" }),
    ...dots,
    name,
    other,
  );
}

const anyShort = (value) => (typeof value === "number" ? short(value) : value);
