// One calibration, proposed or kept: its values beside the ones before, how good it is, residuals.

import { motorFit } from "./fit.js";
import { residualBars } from "./residuals.js";
import { BEYOND, compared, figure, GOOD } from "./labels.js";
import { isThere } from "../core/vehicle_path.js";
import { element, tableHead } from "../core/dom.js";
import { digitsOf, exact, words } from "../core/format.js";

// record: of the API. gains: what is in use now; before: the record of the same name before this one;
// isKept: by the vehicle, not only proposed.
export function recordView(record, { gains, before, isKept }) {
  return element(
    "div",
    { className: "record" },
    ...(record.warnings.length
      ? [element("ul", { className: "warnings" }, ...record.warnings.map((text) => element("li", {}, text)))]
      : []),
    ...[
      values(record, gains, before, isKept),
      quality(record.quality),
      residualBars(record.residuals),
      record.name === "motor" ? motorFit(record) : null,
      conditions(record),
    ].filter((part) => part !== null),
  );
}

function values(record, gains, before, isKept) {
  const rows = [
    ...Object.entries(record.values).map(([name, value]) => {
      const { unit = "", step } = gains.rows.get(name)?.description ?? {},
        label = words(name.split(".").slice(1).join(" ") || name);
      return {
        name,
        label: label.startsWith(`${record.name} `) ? label.slice(record.name.length + 1) : label,
        before: isKept ? record.previous[name] : gains.value(name),
        value,
        unit,
        most: step ? digitsOf(step) + 1 : undefined,
      };
    }),
    ...record.figures.map(({ name, value, unit }) => ({
      name,
      label: name,
      before: before?.figures.find((one) => one.name === name)?.value,
      value,
      unit,
    })),
  ];
  if (!rows.length) return null;
  return element(
    "table",
    { className: "found" },
    element("caption", {}, isKept ? "Values before and after" : "Proposed values"),
    tableHead("", "before", "new", "change", ""),
    element(
      "tbody",
      {},
      ...rows.map((row) =>
        element(
          "tr",
          {},
          element("th", { scope: "row", title: row.name }, row.label),
          ...compared(row.before, row.value, row.most).map((text) => element("td", {}, text)),
          element("td", { className: "unit" }, row.unit),
        ),
      ),
    ),
  );
}

function quality(figures) {
  if (!figures.length) return null;
  return element(
    "table",
    { className: "quality" },
    element("caption", {}, "How good it is"),
    tableHead("", "value", "limit", "", ""),
    element(
      "tbody",
      {},
      ...figures.map(({ name, value, unit, limit, good }) =>
        element(
          "tr",
          { className: good ? "" : "beyond" },
          element("th", { scope: "row" }, name),
          element("td", {}, figure(value)),
          element("td", {}, limit === null ? "" : exact(Number(limit.toPrecision(4)))),
          element("td", { className: "unit" }, unit),
          element("td", { className: "verdict" }, ...(limit === null ? [] : [sign(good)])),
        ),
      ),
    ),
  );
}

// A sign and a word beside the colour.
export function sign(isGood) {
  const [mark, word] = isGood ? GOOD : BEYOND;
  return element(
    "span",
    { className: isGood ? "sign good" : "sign beyond" },
    element("i", { ariaHidden: "true" }, mark),
    word,
  );
}

// Whether what it set was changed by hand since.
export function isChanged({ values: set }, gains) {
  return Object.entries(set).some(([name, value]) => {
    const now = gains.value(name);
    if (now === undefined) return false;
    return typeof value === "number"
      ? Math.abs(now - value) > 1e-6 * Math.max(1e-6, Math.abs(value))
      : now !== value;
  });
}

function conditions(record) {
  const rows = Object.entries(record.conditions),
    run = record.run_id;
  if (!rows.length && !run) return null;
  const link = run
    ? [
        element(
          "div",
          {},
          element("dt", {}, "run"),
          element(
            "dd",
            {},
            isThere("replay") ? element("a", { href: `/replay/${encodeURIComponent(run)}` }, run) : run,
            " · ",
            element("a", { href: `/report/${encodeURIComponent(run)}`, target: "_blank" }, "report"),
          ),
        ),
      ]
    : [];
  return element(
    "details",
    { className: "conditions" },
    element("summary", {}, "Made under"),
    element(
      "dl",
      {},
      ...rows.map(([name, text]) =>
        element("div", {}, element("dt", {}, words(name)), element("dd", {}, text)),
      ),
      ...link,
    ),
  );
}
