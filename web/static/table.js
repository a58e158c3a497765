// The state table: vectors in x, y, z columns, each row grey when its topic is old.

import { element, fixed, seconds } from "./format.js";

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
  ["error to truth", ["truth.position_error", "truth.velocity_error", null], [1, 3, 0], "mm, m/s"],
];

export class StateTable {
  constructor(place, telemetry, description) {
    const signals = new Map(description.signals.map((signal) => [signal.name, signal]));
    this.stale = description.stale;
    this.rows = [];
    const body = element("tbody");
    const row = (label, names, digits, unit) => {
      const cells = names.map(() => element("td"));
      const age = element("td", { className: "age" });
      const line = element("tr", { className: "stale" }, element("td", {}, label), ...cells, element("td", { className: "unit" }, unit), age);
      body.append(line);
      this.rows.push({ names, digits, cells, age, line, topic: signals.get(names[0]).topic });
    };
    for (const [label, names, digits] of VECTORS) row(label, names, [digits, digits, digits], signals.get(names[0]).unit);
    for (const [label, names, digits, unit] of SCALARS) row(label, names, digits, unit);
    const head = element("tr", {}, element("th"), ...["x", "y", "z"].map((axis) => element("th", { className: `axis-${axis}` }, axis)), element("th"), element("th", {}, "age"));
    place.append(element("table", {}, element("thead", {}, head), body));
    telemetry.want("table", this.rows.flatMap((entry) => entry.names).filter(Boolean));
    telemetry.addEventListener("frame", ({ detail }) => { this.frame = detail; this.received = performance.now(); });
    setInterval(() => this.draw(), 125);
  }

  draw() {
    if (!this.frame || document.hidden) return;
    const waited = (performance.now() - this.received) / 1e3;
    for (const { names, digits, cells, age, line, topic } of this.rows) {
      const old = this.frame.age[topic] + (waited > 0.3 ? waited : 0);
      const isStale = !(old < this.stale[topic]);
      line.classList.toggle("stale", isStale);
      names.forEach((name, i) => {
        const value = name && this.frame.value[name];
        if (name && Number.isFinite(value)) set(cells[i], fixed(value, digits[i])); // else the last one stays, grey
        else if (name && cells[i].textContent === "") set(cells[i], "–");
      });
      set(age, Number.isFinite(old) ? (isStale ? seconds(old) : `${Math.round(old * 1e3)} ms`) : "–");
    }
  }
}

function set(cell, text) { if (cell.textContent !== text) cell.textContent = text; }
