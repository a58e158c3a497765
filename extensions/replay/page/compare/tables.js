// Metrics of the experiments' verdicts, and the parameters in which runs differ: a column a run.

import { copied, element, setText } from "/static/core/dom.js";
import { save } from "/static/charts/save.js";
import { exact, words } from "/static/core/format.js";
import { nameOf, number, unitOf } from "/static/experiments/figures.js";
import { look } from "./source.js";
import { rowsOf, TEXTS } from "./table_text.js";

const ENDINGS = { LaTeX: "tex", Markdown: "md", CSV: "csv" };
const MOST = 40; // parameters, until all are asked for

const heads = (runs, ...more) =>
  element(
    "thead",
    {},
    element(
      "tr",
      {},
      element("th", {}, ""),
      ...runs.map((run) => {
        const head = element("th", { scope: "col", className: "run" }, look(run.number).letter);
        head.style.setProperty("--line-style", look(run.number).stroke);
        return head;
      }),
      ...more.map((text) => element("th", { scope: "col" }, text)),
    ),
  );
const frame = (title, ...content) => [element("h2", {}, title), ...content];
const table = (head, rows) =>
  element(
    "div",
    { className: "wide", tabIndex: 0, role: "group" },
    element("table", {}, head, element("tbody", {}, ...rows)),
  );

const COPIED = 2000; // ms for which a copy is confirmed

// Buttons that copy a table; where a browser gives no clipboard, they save a file.
const copies = (shown) =>
  element(
    "p",
    { className: "note copies" },
    "Copy as ",
    ...Object.keys(TEXTS).map((name) =>
      element(
        "button",
        { className: "link", onclick: ({ currentTarget }) => copy(name, shown, currentTarget) },
        name,
      ),
    ),
  );

async function copy(name, shown, button) {
  const text = TEXTS[name](rowsOf(shown));
  if (await copied(text)) {
    setText(button, "Copied");
    setTimeout(() => setText(button, name), COPIED);
  } else save(new Blob([text], { type: "text/plain" }), `metrics.${ENDINGS[name]}`);
}

// reports: of each run what /api/runs/…/report answers, or null.
export function metricsTable(runs, reports) {
  if (!reports.some(Boolean))
    return frame(
      "Metrics",
      element("p", { className: "note" }, "No run has a verdict: metrics come from experiments."),
    );
  const names = [...new Set(reports.flatMap((report) => Object.keys(report?.metrics ?? {})))];
  const verdict = (report) =>
    element("td", { className: report?.verdict ?? "" }, report ? words(report.verdict) : "–");
  const rows = [
    element(
      "tr",
      {},
      element("th", { scope: "row" }, "experiment"),
      ...reports.map((report) => element("td", {}, report ? words(report.experiment) : "–")),
      element("td"),
      element("td"),
    ),
    element(
      "tr",
      {},
      element("th", { scope: "row" }, "verdict"),
      ...reports.map(verdict),
      element("td"),
      element("td"),
    ),
  ];
  for (const name of names) {
    const limits = [
      ...new Set(reports.map((report) => report?.limits[name]).filter((limit) => limit !== undefined)),
    ];
    rows.push(
      element(
        "tr",
        {},
        element("th", { scope: "row" }, nameOf(name)),
        ...reports.map((report) => {
          const value = report?.metrics[name],
            limit = report?.limits[name];
          return element(
            "td",
            { className: value > limit ? "above" : "" },
            value === undefined ? "–" : number(value, name),
          );
        }),
        element("td", {}, limits.map((limit) => number(limit, name)).join(" or ")),
        element("td", { className: "unit" }, unitOf(name)),
      ),
    );
  }
  const shown = table(heads(runs, "limit", ""), rows);
  return frame("Metrics", shown, copies(shown.querySelector("table")));
}

// By their values when the recordings began; those changed in flight say how often.
export function parametersTable(runs) {
  const all = runs.map((run) => run.description.parameters),
    names = [...new Set(all.flatMap(Object.keys))].sort();
  const without = runs.filter((_, k) => !Object.keys(all[k]).length).map((run) => look(run.number).letter);
  const changes = (run, name) => run.description.changes.filter((one) => one.name === name);
  const differ = names.filter(
    (name) =>
      new Set(all.filter((one) => Object.keys(one).length).map((one) => JSON.stringify(one[name]))).size >
        1 || runs.some((run) => changes(run, name).length),
  );
  const cell = (run, name) => {
    const value = run.description.parameters[name],
      made = changes(run, name);
    return element(
      "td",
      {},
      value === undefined ? "–" : exact(value),
      ...(made.length
        ? [
            element(
              "small",
              {},
              `then ${exact(made.at(-1).new)}${made.length > 1 ? `, ${made.length} changes` : ""}`,
            ),
          ]
        : []),
    );
  };
  const notes = without.length
    ? [element("p", { className: "problem" }, `${without.join(", ")}: the log has no parameters`)]
    : [];
  if (!differ.length)
    return frame(
      "Parameters that differ",
      ...notes,
      element("p", { className: "note" }, `None: all ${names.length} parameters are the same.`),
    );
  const rows = differ.map((name) =>
    element("tr", {}, element("th", { scope: "row" }, name), ...runs.map((run) => cell(run, name))),
  );
  rows.slice(MOST).forEach((row) => {
    row.hidden = true;
  });
  const more =
    rows.length > MOST
      ? [
          element(
            "button",
            {
              className: "link",
              onclick: ({ target }) => {
                rows.forEach((row) => {
                  row.hidden = false;
                });
                target.remove();
              },
            },
            `Show all ${rows.length}`,
          ),
        ]
      : [];
  return frame(
    `Parameters that differ: ${differ.length} of ${names.length}`,
    ...notes,
    table(heads(runs), rows),
    ...more,
  );
}
