// The metrics of an experiment's verdict: names in words, units by their endings, and a table.

import { element, tableHead } from "../core/dom.js";
import { words } from "../core/format.js";

/** @type {[ending: string, unit: string, factor: number][]} */
const UNITS = [
  ["_m_s2", "m/s²", 1],
  ["_deg_s", "°/s", 1],
  ["_m_s", "m/s", 1],
  ["_deg", "°", 1],
  ["_count", "counts", 1],
  ["_kg", "kg", 1],
  ["_N", "N", 1],
  ["_m", "mm", 1e3],
  ["_s", "s", 1],
];

// A table of metrics [{name, value, limit}], those above their limit marked; units end their names.
const endOf = (name) => UNITS.find(([ending]) => name.endsWith(ending)) ?? ["", "", 1];
export const unitOf = (name) => endOf(name)[1];
export const nameOf = (name) => words(name.slice(0, name.length - endOf(name)[0].length));
// A value of this name in its unit, with three digits.
export const number = (value, name = "") =>
  value === null || value === undefined
    ? ""
    : String(Number((endOf(name)[2] * Number(value)).toPrecision(3)));

export function figures(metrics) {
  return element(
    "table",
    { className: "figures" },
    tableHead("", "value", "limit", ""),
    element(
      "tbody",
      {},
      ...metrics.map(({ name, value, limit }) => {
        const above = limit !== null && limit !== undefined && !(value <= limit);
        return element(
          "tr",
          { className: above ? "above" : "" },
          ...[nameOf(name), number(value, name), number(limit, name), unitOf(name)].map((text) =>
            element("td", {}, text),
          ),
        );
      }),
    ),
  );
}
