// Residuals of poses, steps or times: a bar each, from the middle where there are negative ones.
// Kinds of the same unit (a law and another one beside it) have one scale.

import { capital, figure, labelAndUnit } from "./labels.js";
import { element } from "../core/dom.js";

const SEEN = 13; // rows without scrolling

// "step 30" and "step 40" are of one kind, "quadratic 30" is of another; x, y and z are of one.
const kindOf = (label) => (/\d/.test(label) ? label.replace(/[\d.]+/g, "").trim() : "");

// residuals: [["pose 3, m/s²", 0.01], …]; an element, or null for none.
export function residualBars(residuals) {
  if (!residuals.length) return null;
  const rows = residuals.map(([name, value]) => ({
    label: labelAndUnit(name)[0],
    unit: labelAndUnit(name)[1],
    value,
  }));
  const kinds = [...new Set(rows.map(({ label, unit }) => `${kindOf(label)}|${unit}`))];
  return element(
    "section",
    { className: "residuals" },
    ...kinds.map((kind) => {
      const own = rows.filter(({ label, unit }) => `${kindOf(label)}|${unit}` === kind),
        [{ unit }] = own;
      const alike = rows.filter((row) => row.unit === unit),
        most = Math.max(...alike.map(({ value }) => Math.abs(value)), 1e-12);
      const isSigned = alike.some(({ value }) => value < 0),
        isOne = own.length === alike.length;
      const title = isOne ? "Residuals" : `Residuals, ${kindOf(own[0].label)}`;
      return element(
        "div",
        {},
        element("h3", {}, title, element("span", {}, unit ? `, ${unit}` : "")),
        element(
          "ul",
          {
            className: isSigned ? "signed" : "",
            ariaLabel: title,
            ...(own.length > SEEN ? { tabIndex: 0 } : {}),
          },
          ...own.map((row) => line(row, most, isSigned)),
        ),
      );
    }),
  );
}

function line({ label, value }, most, isSigned) {
  const bar = element("i"),
    share = (100 * Math.abs(value)) / most;
  bar.style.width = `${(isSigned ? share / 2 : share).toFixed(1)}%`;
  bar.style.left = isSigned ? `${(value < 0 ? 50 - share / 2 : 50).toFixed(1)}%` : "0";
  return element(
    "li",
    {},
    element("span", {}, capital(label)),
    element("span", { className: "track", ariaHidden: "true" }, bar),
    element("output", {}, figure(value)),
  );
}
