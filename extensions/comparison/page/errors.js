// Errors against the truth, a row for each estimate compared; the name chooses it as the ghost.

import { colorOf, partsOf, wordsOf } from "/static/beacons/estimate_names.js";
import { attempt, element, setText } from "/static/core/dom.js";
import { duration, fixed, NONE } from "/static/core/format.js";

export const COMPARED = "station.comparison.estimators";
const OFFERED = ["error_state", "complementary:resolved", "complementary:bearings", "complementary:paper"];
const TRUTHS = { truth: "the simulator's truth", tracker: "the tracker" };
const DIGITS = [0, 0, 0, 2, 0, 0, 1]; // of the figures of ../routes.py, in their order

export class Errors {
  // choose(name): the ghost and the residuals
  constructor(place, { gains, isOperator, choose }) {
    this.gains = gains;
    this.isOperator = isOperator;
    this.choose = choose;
    this.rows = new Map();
    this.note = element("span", { className: "limit" });
    this.reason = element("div", { className: "reason", hidden: true });
    this.boxes = element("div", { className: "boxes" });
    this.body = element("tbody");
    this.beside = element("tr", { hidden: true });
    const head = element(
      "thead",
      {},
      element("tr", {}, th("estimator"), th("now"), th("last 10 s", 3), th("session", 2), th("core")),
      element(
        "tr",
        { className: "units" },
        element("th"),
        th("mm"),
        th("rms"),
        th("max"),
        th("rms °"),
        th("rms"),
        th("max"),
        th("%"),
      ),
    );
    this.table = element(
      "table",
      { className: "errors" },
      head,
      this.body,
      element("tfoot", {}, this.beside),
    );
    this.empty = element(
      "p",
      { className: "empty" },
      "No comparison yet: it needs telemetry and a truth, the simulator's or the tracker's.",
    );
    place.append(element("h2", {}, "Errors", this.note), this.table, this.empty, this.boxes, this.reason);
    this.table.hidden = true;
    this.note.dataset.topic = this.table.dataset.topic = "comparison";
  }

  show(comparison, chosen) {
    if (!comparison) return;
    this.table.hidden = false;
    this.empty.hidden = true;
    setText(
      this.note,
      `against ${TRUTHS[comparison.truth] ?? "nothing"}, session ${duration(comparison.duration)}`,
    );
    const names = comparison.estimators.map(({ name }) => name);
    if (names.join() !== [...this.rows.keys()].join()) this.build(names);
    for (const one of comparison.estimators) {
      const { cells, button, state } = this.rows.get(one.name);
      DIGITS.forEach((digits, i) => setText(cells[i], figure(one.figures[i], digits)));
      button.setAttribute("aria-pressed", String(one.name === chosen));
      setText(state, stateOf(one));
    }
  }

  // The vehicle's own estimator in parallel, which is known by its distance from the one in use alone.
  showShadow(name, convergence, distance) {
    this.beside.hidden = !convergence;
    if (!convergence) return;
    const figures = ["now", ""].map(() => element("td"));
    figures[0].textContent = figure(distance === null ? null : 1000 * distance, 0);
    Object.assign(figures[1], { colSpan: DIGITS.length - 1, textContent: "from the vehicle's estimate" });
    const words = [element("b", {}, partsOf(name)[0]), element("small", {}, "on board")];
    const label = element("td", {}, element("span", { className: "estimate" }, ...words));
    this.beside.replaceChildren(label, ...figures);
  }

  build(names) {
    this.rows.clear();
    this.body.replaceChildren(
      ...names.map((name) => {
        const state = element("small"),
          cells = DIGITS.map(() => element("td"));
        const title =
          `${wordsOf(name)}: ` +
          `${this.isOperator ? "show it as the ghost in the 3D view, and its residuals" : "show its residuals"}`;
        const button = element(
          "button",
          { className: "estimate", title, onclick: () => this.choose(name) },
          element("b", {}, partsOf(name)[0]),
          state,
        );
        button.style.setProperty("--c", colorOf(name));
        button.dataset.name = name;
        this.rows.set(name, { cells, button, state });
        return element("tr", {}, element("td", {}, button), ...cells);
      }),
    );
  }

  // Check boxes of what the station compares; each shows the confirmed choice.
  parameters() {
    const text = this.gains.value(COMPARED);
    this.boxes.hidden = text === undefined;
    if (text === undefined) return;
    const present = text.split(/\s+/).filter(Boolean);
    const names = [...OFFERED, ...present.filter((name) => !OFFERED.includes(name))];
    const groups = new Map(); // by estimator, a box for each of its gains
    for (const name of names) {
      const [estimator, gains] = partsOf(name);
      groups.set(estimator, [
        ...(groups.get(estimator) ?? []),
        this.box(name, present.includes(name), gains || "default"),
      ]);
    }
    this.boxes.replaceChildren(
      element("span", {}, "Compared at the station; not used in flight"),
      ...[...groups].map(([estimator, boxes]) =>
        element("div", {}, element("span", {}, estimator), ...boxes),
      ),
    );
  }

  box(name, checked, text) {
    const box = element("input", { type: "checkbox", checked, disabled: !this.isOperator });
    box.dataset.name = name;
    box.addEventListener("change", () => this.change(name, box));
    return element("label", { title: name }, box, text.replace(" gains", ""));
  }

  async change(name, box) {
    const present = this.gains.value(COMPARED).split(/\s+/).filter(Boolean),
      wanted = box.checked;
    box.checked = !wanted; // until it is confirmed
    const names = wanted ? [...present, name] : present.filter((other) => other !== name);
    const order = (one) => (OFFERED.includes(one) ? OFFERED.indexOf(one) : OFFERED.length);
    if (
      await attempt(this.reason, () =>
        this.gains.set({ [COMPARED]: names.sort((a, b) => order(a) - order(b)).join(" ") }),
      )
    )
      this.parameters();
  }
}

// Its gains, and what keeps it from being taken at its word.
function stateOf({ name, state }) {
  const gains = partsOf(name)[1];
  return state ? [gains.replace(" gains", ""), state].filter(Boolean).join(", ") : gains;
}

const th = (text, colSpan = 1) => element("th", { colSpan }, text);
const figure = (value, digits) =>
  value === null ? NONE : fixed(value, value < 10 && digits === 0 ? 1 : digits);
