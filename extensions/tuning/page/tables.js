// Figures of the chosen tests side by side, and the gains that differ between them.

import { element } from "/static/core/dom.js";
import { exact, fixed, NONE } from "/static/core/format.js";
import { FIGURES, figure, unitOf } from "./units.js";

const letterHead = (letter, color) => {
  const head = element("th", { scope: "col" }, letter);
  head.style.setProperty("--c", color);
  return head;
};

// runs oldest first; a column with the difference when there are two.
export function figuresTable(runs, letters, colors) {
  if (!runs.length) return element("div");
  const isPair = runs.length === 2,
    axis = runs[0].plan.axis;
  const sameKind = runs.every(({ plan }) => (plan.axis === "yaw") === (axis === "yaw"));
  const shown = FIGURES.filter(([name]) => runs.some(({ figures }) => figures[name] !== undefined));
  const rows = shown.map(([name, text, hint]) => {
    const values = runs.map(({ figures }) => figures[name]),
      { unit, digits, scale } = unitOf(name, axis);
    const cells = runs.map((run, i) => value(name, values[i], run));
    const known = isPair && sameKind && values.every((one) => Number.isFinite(one));
    const [before, after] = values.map((one) => Number((one * scale).toFixed(digits))); // as they are shown
    const difference = known ? signed(after - before, digits) : NONE;
    return element(
      "tr",
      {},
      element("th", { scope: "row", title: hint }, text),
      ...cells,
      ...(isPair ? [element("td", { className: "difference" }, difference)] : []),
      element("td", { className: "unit" }, unit),
    );
  });
  const head = element(
    "tr",
    {},
    element("th"),
    ...letters.map((letter, i) => letterHead(letter, colors[i])),
    ...(isPair ? [element("th", { scope: "col" }, `${letters[1]} − ${letters[0]}`)] : []),
    element("th"),
  );
  return element(
    "table",
    { className: "figures-of-tests" },
    element("caption", {}, "Means over the edges; – is not measured, > not reached while the level was held"),
    element("thead", {}, head),
    element("tbody", {}, ...rows),
  );
}

function value(name, number, { plan, figures }) {
  const isJudged = Number.isFinite(figures.rms_error);
  const late = isJudged && number === null && ["delay", "rise", "settling"].includes(name);
  return element(
    "td",
    late ? { title: `not reached within ${plan.duration} s` } : {},
    late ? `> ${fixed(plan.duration, 1)}` : figure(name, number, plan.axis),
  );
}

const signed = (number, digits) => `${Number(number.toFixed(digits)) > 0 ? "+" : ""}${fixed(number, digits)}`;

// putBack(run): the gains of one column.
export function gainsTable(runs, letters, colors, putBack, canPutBack) {
  if (!runs.length) return element("div");
  const names = [...new Set(runs.flatMap(({ gains }) => Object.keys(gains)))];
  const differing = names.filter((name) => new Set(runs.map(({ gains }) => gains[name])).size > 1);
  const buttons = runs.map((run, i) =>
    element(
      "td",
      {},
      element(
        "button",
        {
          className: "small",
          disabled: !canPutBack,
          title:
            `set the gains that were in force in test ${letters[i]}; the vehicle checks them ` +
            "like any other change",
          ariaLabel: `restore the gains of test ${letters[i]}`,
          onclick: () => putBack(run),
        },
        "Restore",
      ),
    ),
  );
  const rows = differing.map((name) =>
    element(
      "tr",
      {},
      element("th", { scope: "row", title: name }, short(name)),
      ...runs.map(({ gains }) => element("td", {}, name in gains ? exact(gains[name]) : NONE)),
    ),
  );
  const note =
    runs.length < 2
      ? "Tick a second test to compare gains"
      : differing.length
        ? "Gains that differ"
        : "The gains are the same";
  return element(
    "table",
    { className: "gains-of-tests" },
    element("caption", {}, note),
    element(
      "thead",
      {},
      element("tr", {}, element("th"), ...letters.map((letter, i) => letterHead(letter, colors[i]))),
    ),
    element(
      "tbody",
      {},
      ...rows,
      element("tr", {}, element("th", { scope: "row" }, "all gains"), ...buttons),
    ),
  );
}

const short = (name) => name.split(".").slice(-2).join(".");
