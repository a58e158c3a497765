// The report of one run: verdict, figures, options, plots.

import { get } from "../core/api.js";
import { figures } from "./figures.js";
import { element } from "../core/dom.js";
import { exact, words } from "../core/format.js";
import { RunReport } from "../runs/report.js";
import { pathname } from "../core/vehicle_path.js";

const run = decodeURIComponent(pathname.split("/")[2]);
const base = `/api/runs/${encodeURIComponent(run)}`;
const main = document.querySelector("main");

function table(options) {
  return element(
    "table",
    { className: "figures" },
    element(
      "tbody",
      {},
      ...Object.entries(options).map(([name, value]) =>
        element(
          "tr",
          {},
          element("td", {}, words(name)),
          element("td", {}, value === "" ? "none" : typeof value === "string" ? words(value) : exact(value)),
        ),
      ),
    ),
  );
}

try {
  const report = await get(`${base}/report`);
  const url = (name) => `${base}/report/${encodeURIComponent(name)}`;
  const pictures = report.files.filter((name) => name.endsWith(".png"));
  const metrics = Object.entries(report.metrics).map(([name, value]) => ({
    name,
    value,
    limit: report.limits[name] ?? null,
  }));
  document.title = `${words(report.experiment)}: ${words(report.verdict)}`;
  main.append(
    element(
      "h1",
      { className: `verdict ${report.verdict}` },
      `${words(report.experiment)}: ${words(report.verdict)}`,
    ),
    element(
      "p",
      { className: "facts" },
      `${run} · `,
      element("a", { href: `${base}/download`, download: "" }, "run"),
      ...report.files.flatMap((name) => [
        " · ",
        element("a", { href: url(name) }, name.slice(name.lastIndexOf(".") + 1)),
      ]),
    ),
    ...(report.reason ? [element("p", { className: "reason" }, report.reason)] : []),
    ...(report.problem ? [element("p", { className: "reason" }, report.problem)] : []),
    ...pictures.map((name) => element("img", { src: url(name), alt: name })),
    element(
      "div",
      { className: "columns" },
      element("section", {}, element("h2", {}, "Figures"), figures(metrics)),
      ...(Object.keys(report.options).length
        ? [element("section", {}, element("h2", {}, "Options"), table(report.options))]
        : []),
    ),
  );
} catch (error) {
  main.append(element("h1", {}, "No report"), element("p", { className: "reason" }, error.message));
}

// One with figures, made on request, of any run there is.
try {
  const [session] = await Promise.all([get("/api/session"), get(`${base}/report_making`)]);
  const made = new RunReport(session.role !== "viewer");
  main.append(made.place);
  made.show({ id: run });
} catch {
  /* an unknown run; said above */
}
