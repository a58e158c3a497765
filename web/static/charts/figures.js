// Mean, rms, least and greatest of what a chart shows, as a table above its plot.

import { element, setText } from "../core/dom.js";

/**
 * @typedef {{ count: number, mean: number | null, rms: number | null, min: number | null, max: number | null }} Figures
 */

/** @type {("mean" | "rms" | "min" | "max")[]} */
const SHOWN = ["mean", "rms", "min", "max"];

// Of the samples [from, to) that have a value.
/** @param {ArrayLike<number>} values @param {number} from @param {number} to @returns {Figures} */
export function figuresOf(values, from, to) {
  let count = 0,
    sum = 0,
    squares = 0,
    min = Infinity,
    max = -Infinity;
  for (let i = from; i < to; i++) {
    const value = values[i];
    if (!Number.isFinite(value)) continue;
    count += 1;
    sum += value;
    squares += value * value;
    min = Math.min(min, value);
    max = Math.max(max, value);
  }
  return count
    ? { count, mean: sum / count, rms: Math.sqrt(squares / count), min, max }
    : { count, mean: null, rms: null, min: null, max: null };
}

export class FigureTable {
  /** @param {any} chart */
  constructor(chart) {
    this.chart = chart;
    this.body = element("tbody");
    this.place = element(
      "table",
      { className: "statistics", tabIndex: 0, ariaLabel: "statistics of the time shown" },
      element(
        "thead",
        {},
        element(
          "tr",
          {},
          element("th", {}, ""),
          ...SHOWN.map((name) => element("th", { scope: "col" }, name)),
        ),
      ),
      this.body,
    );
    this.key = "";
  }

  // Rows of the lines that are shown now; their numbers when they are known.
  async draw() {
    const { chart } = this,
      lines = chart.lines.filter((/** @type {any} */ { name }) => name),
      [from, to] = chart.axis.span;
    const key = lines.map((/** @type {any} */ { name, run }) => `${run?.id}${name}`).join();
    if (key !== this.key) {
      this.key = key;
      this.body.replaceChildren(
        ...lines.map((/** @type {any} */ { name, label, second, stroke, dash }) => {
          const words =
            label ||
            `${chart.isMerged(name) ? "reference " : ""}${chart.signal(name).label}${second ? ", second run" : ""}`;
          const head = element("th", { scope: "row", title: chart.title(name) }, words);
          head.style.setProperty("--line-style", chart.pattern(stroke, dash));
          return element("tr", {}, head, ...SHOWN.map(() => element("td")));
        }),
      );
    }
    if (this.isAsking) {
      this.again = true;
      return;
    }
    this.isAsking = true;
    const found = await Promise.all(
      lines.map((/** @type {any} */ line) => chart.source.figures(line, from, to)),
    ).catch(() => []);
    this.isAsking = false;
    if (key === this.key) {
      [...this.body.rows].forEach((row, i) =>
        SHOWN.forEach((name, k) => setText(row.cells[k + 1], chart.figure(found[i]?.[name]))),
      );
    }
    if (this.again) {
      this.again = false;
      this.draw();
    }
  }
}
