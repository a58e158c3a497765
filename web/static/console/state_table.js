// The state table: vectors in x, y, z columns, each row with its age (static/core/ages.js greys it).

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
const SCALARS = [
  ["thrust, λ, mass", ["thrust", "scaling", "mass"], [2, 2, 3], "N, –, kg"],
  ["innov., pose age", ["innovation.position", "innovation.attitude", "measurement.age"], [1, 2, 0], "mm, °, ms"],
  ["used, ref., NIS", ["measurements.used", "measurements.refused", "nis"], [0, 0, 2], "meas., –"],
  ["error to truth", ["truth.position_error", "truth.velocity_error", null], [1, 3, 0], "mm, m/s"],
];

export class StateTable {
  constructor(place, { telemetry, description, ages, events }) {
    const signals = new Map(description.signals.map((signal) => [signal.name, signal]));
    this.ages = ages;
    this.rows = [];
    const body = element("tbody");
    const row = (label, names, digits, unit) => {
      const cells = names.map(() => element("td"));
      const age = element("td", { className: "age" });
      const line = element("tr", { className: "stale" }, element("td", {}, label), ...cells, element("td", { className: "unit" }, unit), age);
      const { topic } = signals.get(names[0]);
      line.dataset.topic = topic;
      body.append(line);
      this.rows.push({ names, digits, cells, age, topic });
    };
    for (const [label, names, digits] of VECTORS) row(label, names, [digits, digits, digits], signals.get(names[0]).unit);
    for (const [label, names, digits, unit] of SCALARS) row(label, names, digits, unit);
    const figures = [0, 1, 2].map(() => element("td", {}, "–"));
    const flown = element("tr", { title: "position error of the behavior that is flown, from every pose, and rms of the present lap: as its verdict computes them" },
      element("td", {}, "rms, max, lap rms"), ...figures, element("td", { className: "unit" }, "mm"), element("td", { className: "age" }));
    flown.dataset.topic = "state";
    body.append(flown);
    events.on("summary", ({ tracking }) => {
      if (tracking === undefined) return;
      const { position_rms_m: rms, position_max_m: most, lap } = tracking ?? {};
      [rms, most, lap?.position_rms_m].forEach((value, i) => setText(figures[i], fixed(1e3 * value, 2)));
    });
    const head = element("tr", {}, element("th"), ...["x", "y", "z"].map((axis) => element("th", { className: `axis-${axis}` }, axis)), element("th"), element("th", {}, "age"));
    place.append(element("table", {}, element("thead", {}, head), body));
    telemetry.want("table", this.rows.flatMap((entry) => entry.names).filter(Boolean));
    telemetry.addEventListener("frame", ({ detail }) => { this.frame = detail; });
    setInterval(() => this.draw(), 125);
  }

  draw() {
    if (!this.frame || document.hidden) return;
    for (const { names, digits, cells, age, topic } of this.rows) {
      const old = this.ages.age(topic);
      names.forEach((name, i) => {
        if (!name) return;
        const value = this.frame.value[name], isKnown = Number.isFinite(value);
        if (isKnown) setText(cells[i], fixed(value, digits[i])); // else the last one stays, grey
        else if (cells[i].textContent === "") setText(cells[i], "–");
        cells[i].classList.toggle("stale", !isKnown); // also where another message is missing
      });
      setText(age, Number.isFinite(old) ? (this.ages.isOld(topic) ? `○${coarse(old)}` : `${Math.round(old * 1e3)} ms`) : "–");
    }
  }
}

// Calm: in tenths below ten seconds.
const coarse = (age) => (age < 10 ? `${age.toFixed(1)} s` : seconds(Math.floor(age)).replace(".0", ""));
