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
// The name in words with the unit in which its values are stored.
const stored = (name) => (name.endsWith("_m") ? "m" : unitOf(name));
export const titleOf = (name) => (unitOf(name) ? `${nameOf(name)} [${stored(name)}]` : nameOf(name));
// A value of this name in its unit, with three digits.
export const number = (value, name = "") =>
  value === null || value === undefined
    ? ""
    : String(Number((endOf(name)[2] * Number(value)).toPrecision(3)));

/** @type {(metric: { value: number | null, limit: number | null }) => number} */
const share = ({ value, limit }) =>
  value === null || limit === null ? Infinity : limit > 0 ? value / limit : value > limit ? Infinity : 0;

// The figure that decided: the one furthest above its limit; else the position error, or the one nearest its limit.
export function decisive(metrics) {
  const judged = metrics
    .filter(({ limit }) => limit !== null && limit !== undefined)
    .sort((one, other) => share(other) - share(one));
  const error = metrics.find(({ name }) => name === "position_rms_m") ?? null;
  return judged.length && share(judged[0]) > 1 ? judged[0] : (error ?? judged[0] ?? null);
}

// A verdict with its number.
export function badge({ verdict, metrics }) {
  const figure = decisive(metrics),
    { name = "", value = null, limit = null } = figure ?? {};
  const said = figure && value !== null ? ` ${number(value, name)} ${unitOf(name)}` : "";
  const title = figure
    ? `${nameOf(name)}${limit === null ? "" : `, limit ${number(limit, name)} ${unitOf(name)}`}`
    : "";
  return element("span", { className: `chip ${verdict}`, title }, `${words(verdict)}${said}`.trim());
}

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
