// The state table: vectors in x, y, z columns, each row with its age (static/core/ages.js greys it), and below
// them numbers, each with its name and unit.

import { element, setText } from "../core/dom.js";
import { fixed, seconds } from "../core/format.js";

const xyz = (prefix) => ["x", "y", "z"].map((axis) => `${prefix}.${axis}`);
const VECTORS = [
  ["position", xyz("state.position"), 3],
  ["velocity", xyz("state.velocity"), 3],
  ["roll pitch yaw", ["state.roll", "state.pitch", "state.yaw"], 2],
  ["body rate", xyz("state.rate"), 1],
  ["reference", xyz("reference.position"), 3],
  ["tracking error", xyz("error.position"), 3],
  ["truth", xyz("truth.position"), 3],
  ["torque", xyz("torque"), 3],
];
/** @type {[label: string, signal: string, digits: number, unit: string][]} */
const SCALARS = [
  ["thrust", "thrust", 2, "N"],
  ["mass", "mass", 3, "kg"],
  ["thrust scaling", "scaling", 2, ""],
  ["innovation", "innovation.position", 1, "mm"],
  ["innovation", "innovation.attitude", 2, "°"],
  ["pose age", "measurement.age", 0, "ms"],
  ["poses used", "measurements.used", 0, ""],
  ["refused", "measurements.refused", 0, ""],
  ["NIS", "nis", 2, ""],
  ["error to truth", "truth.position_error", 1, "mm"],
  ["error to truth", "truth.velocity_error", 3, "m/s"],
];
/** @type {[label: string, of: (tracking: any) => number | undefined][]} */
const FLOWN = [
  ["error rms", (one) => one.position_rms_m],
  ["error max", (one) => one.position_max_m],
  ["lap rms", (one) => one.lap?.position_rms_m],
];

export class StateTable {
  constructor(place, { telemetry, description, ages, events }) {
    const signals = new Map(description.signals.map((signal) => [signal.name, signal]));
    this.ages = ages;
    /** @type {{ names: string[], digits: number[], cells: HTMLElement[], age: HTMLElement | null, topic: string }[]} */
    this.rows = [];
    const body = element("tbody");
    const row = (label, names, digits, unit) => {
      const cells = names.map(() => element("td"));
      const age = element("td", { className: "age" });
      const line = element(
        "tr",
        { className: "stale" },
        element("td", {}, label),
        ...cells,
        element("td", { className: "unit" }, unit),
        age,
      );
      const { topic } = signals.get(names[0]);
      line.dataset.topic = topic;
      body.append(line);
      this.rows.push({ names, digits, cells, age, topic });
    };
    for (const [label, names, digits] of VECTORS)
      row(label, names, [digits, digits, digits], signals.get(names[0]).unit);
    const numbers = element("dl", { className: "numbers" });
    const number = (label, topic, unit, title = "") => {
      const value = element("b", {}, "–"),
        line = element(
          "div",
          { className: "stale", title },
          element("dt", {}, label),
          element("dd", {}, value, element("span", { className: "unit" }, unit)),
        );
      line.dataset.topic = topic;
      numbers.append(line);
      return value;
    };
    const figures = FLOWN.map(([label]) =>
      number(
        label,
        "state",
        "mm",
        "position error of the behavior that is flown, from every pose, as its verdict computes it",
      ),
    );
    for (const [label, name, digits, unit] of SCALARS) {
      const { topic } = signals.get(name);
      this.rows.push({
        names: [name],
        digits: [digits],
        cells: [number(label, topic, unit)],
        age: null,
        topic,
      });
    }
    events.on("summary", ({ tracking }) => {
      if (tracking === undefined) return;
      FLOWN.forEach(([, of], i) =>
        setText(figures[i], fixed(tracking ? 1e3 * (of(tracking) ?? NaN) : NaN, 2)),
      );
    });
    const head = element(
      "tr",
      {},
      element("th"),
      ...["x", "y", "z"].map((axis) => element("th", { className: `axis-${axis}` }, axis)),
      element("th"),
      element("th", {}, "age"),
    );
    place.append(element("table", {}, element("thead", {}, head), body), numbers);
    telemetry.want(
      "table",
      this.rows.flatMap((entry) => entry.names),
    );
    telemetry.addEventListener("frame", ({ detail }) => {
      this.frame = detail;
    });
    setInterval(() => this.draw(), 125);
  }

  draw() {
    if (!this.frame || document.hidden) return;
    for (const { names, digits, cells, age, topic } of this.rows) {
      const old = this.ages.age(topic);
      names.forEach((name, i) => {
        const value = this.frame.value[name],
          isKnown = Number.isFinite(value);
        if (isKnown)
          setText(cells[i], fixed(value, digits[i])); // else the last one stays, grey
        else if (cells[i].textContent === "") setText(cells[i], "–");
        cells[i].classList.toggle("stale", !isKnown); // also where another message is missing
      });
      if (age)
        setText(
          age,
          Number.isFinite(old)
            ? this.ages.isOld(topic)
              ? `○${coarse(old)}`
              : `${Math.round(old * 1e3)} ms`
            : "–",
        );
    }
  }
}

// Calm: in tenths below ten seconds.
const coarse = (age) => (age < 10 ? `${age.toFixed(1)} s` : seconds(Math.floor(age)).replace(".0", ""));
