// The state at the play-head: one quantity a row, vectors in x, y, z columns; of a second run below each value.

import { element, setText } from "/static/core/dom.js";
import { fixed, seconds, words } from "/static/core/format.js";
import { ROWS } from "/static/console/state_table.js";

const OWN = /** @type {typeof ROWS} */ ([
  ["battery", ["battery.voltage"], 2],
  ["link age", ["link.age"], 0],
]);
const STALE = { battery: 3, link: 1.5, mass: 0.3 }; // s
const DEFAULT_STALE = 0.3;

export class ReplayTable {
  rows;

  constructor(place) {
    this.place = place;
    this.names = [...ROWS, ...OWN].flatMap(([, names]) => names);
  }

  setRuns(runs) {
    this.runs = runs;
    const { signals } = runs[0],
      body = element("tbody");
    this.facts = runs.map(() => element("td", { colSpan: 5 }));
    runs.forEach((_, k) =>
      body.append(
        element("tr", { className: k ? "second" : "" }, element("td", {}, k ? "" : "mode"), this.facts[k]),
      ),
    );
    this.rows = [];
    for (const [label, names, digits] of [...ROWS, ...OWN]) {
      if (!names.some((name) => runs.some((run) => run.signals.has(name)))) continue;
      runs.forEach((run, k) => {
        const cells = [0, 1, 2].map(() => element("td")),
          age = element("td", { className: "age" });
        const line = element(
          "tr",
          { className: k ? "second" : "" },
          element("td", {}, k ? "" : label),
          ...cells,
          element("td", { className: "unit" }, k ? "" : (signals.get(names[0])?.unit ?? "")),
          age,
        );
        body.append(line);
        this.rows.push({ run, names, digits, cells: cells.slice(-names.length), age, line }); // one number: below z
      });
    }
    const head = element(
      "tr",
      {},
      element("th"),
      ...["x", "y", "z"].map((axis) => element("th", { className: `axis-${axis}` }, axis)),
      element("th"),
      element("th", {}, "age"),
    );
    this.place.replaceChildren(element("table", {}, element("thead", {}, head), body));
  }

  put(values, t) {
    this.runs.forEach((run, k) => {
      const own = t + run.shift,
        flags = run.text("status/flags", own);
      const text =
        [run.span("mode", own), run.span("behavior", own), ...flags.split(", ")]
          .filter(Boolean)
          .map(words)
          .join(" · ") || "–";
      setText(this.facts[k], text);
    });
    for (const { run, names, digits, cells, age, line } of this.rows) {
      const found = values.get(run) ?? {},
        old = found[names[0]]?.[1];
      const isStale = !(old <= (STALE[names[0].split(".")[0]] ?? DEFAULT_STALE));
      line.classList.toggle("stale", isStale);
      names.forEach((name, i) => setText(cells[i], fixed(found[name]?.[0], digits)));
      setText(
        age,
        old === null || old === undefined ? "–" : isStale ? seconds(old) : `${Math.round(old * 1e3)} ms`,
      );
    }
  }
}
