// The metrics of an experiment's verdict: names in words, units by their endings, and a table.

import { element, tableHead } from "../core/dom.js";
import { words } from "../core/format.js";

const UNITS = [["_m_s2", "m/s²"], ["_deg_s", "°/s"], ["_m_s", "m/s"], ["_deg", "°"], ["_count", "counts"], ["_kg", "kg"], ["_N", "N"], ["_m", "m"], ["_s", "s"]];

// A table of metrics [{name, value, limit}], those above their limit marked; units end their names.
const endOf = (name) => UNITS.find(([ending]) => name.endsWith(ending)) ?? ["", ""];
export const unitOf = (name) => endOf(name)[1];
export const nameOf = (name) => words(name.slice(0, name.length - endOf(name)[0].length));
export const number = (value) => (value === null || value === undefined ? "" : String(Number(Number(value).toPrecision(3))));

export function figures(metrics) {
  return element("table", { className: "figures" }, tableHead("", "value", "at most", ""),
    element("tbody", {}, ...metrics.map(({ name, value, limit }) => {
      const above = limit !== null && limit !== undefined && !(value <= limit);
      return element("tr", { className: above ? "above" : "" }, ...[nameOf(name), number(value), number(limit), unitOf(name)].map((text) => element("td", {}, text)));
    })));
}
