// The values: one quantity a row, vectors in x, y, z columns, each row with its age (static/core/ages.js greys it). A
// pinned row stands on top, and stays in sight while the table is folded. Rows are pinned while a button says so, which
// makes them high enough to be pressed.

import { element, recall, remember, setText } from "../core/dom.js";
import { fixed, seconds } from "../core/format.js";
import { icon } from "../icons/icons.js";

const KEPT = "quadlab.values";
const xyz = (prefix) => ["x", "y", "z"].map((axis) => `${prefix}.${axis}`);
/** @type {[label: string, signals: string[], digits: number][]} */
export const ROWS = [
  ["position", xyz("state.position"), 3],
  ["velocity", xyz("state.velocity"), 3],
  ["roll pitch yaw", ["state.roll", "state.pitch", "state.yaw"], 2],
  ["body rate", xyz("state.rate"), 1],
  ["reference", xyz("reference.position"), 3],
  ["tracking error", xyz("error.position"), 1],
  ["truth", xyz("truth.position"), 3],
  ["torque", xyz("torque"), 3],
  ["thrust", ["thrust"], 2],
  ["mass", ["mass"], 3],
  ["thrust scaling", ["scaling"], 2],
  ["pos. innovation", ["innovation.position"], 1],
  ["att. innovation", ["innovation.attitude"], 2],
  ["pose age", ["measurement.age"], 0],
  ["poses used", ["measurements.used"], 0],
  ["poses refused", ["measurements.refused"], 0],
  ["NIS", ["nis"], 2],
  ["position vs truth", ["truth.position_error"], 1],
  ["velocity vs truth", ["truth.velocity_error"], 3],
];
/** @type {[label: string, of: (tracking: any) => number | undefined][]} */
const FLOWN = [
  ["error rms", (one) => one.position_rms_m],
  ["error max", (one) => one.position_max_m],
  ["lap rms", (one) => one.lap?.position_rms_m],
];
const FLOWN_TITLE =
  "position error of the behavior that is flown, from every pose, as its verdict computes it";

export class StateTable {
  pins = /** @type {string[]} */ ([]); // labels of rows
  folded = false;

  constructor(place, { telemetry, description, ages, events }) {
    const signals = new Map(description.signals.map((signal) => [signal.name, signal]));
    this.place = place;
    this.ages = ages;
    const { pins, folded } = recall(KEPT) ?? {};
    /** @type {{ label: string, names: string[], digits: number, cells: HTMLElement[], age: HTMLElement, topic: string,
     *   line: HTMLElement, pin: HTMLButtonElement }[]} */
    this.rows = ROWS.map(([label, names, digits]) => {
      const { topic, unit } = signals.get(names[0]);
      return this.row(label, { names, digits, unit, topic });
    });
    const flown = FLOWN.map(([label]) =>
      this.row(label, { names: [], digits: 2, unit: "mm", topic: "state", title: FLOWN_TITLE }),
    );
    this.rows.splice(
      ROWS.findIndex(([label]) => label === "truth"),
      0,
      ...flown,
    ); // behind the tracking error
    events.on("summary", ({ tracking }) => {
      if (tracking === undefined) return;
      FLOWN.forEach(([, of], i) =>
        setText(flown[i].cells[0], fixed(tracking ? 1e3 * (of(tracking) ?? NaN) : NaN, 2)),
      );
    });
    this.fold = element(
      "button",
      { className: "icon", onclick: () => this.arrange({ folded: !this.folded }) },
      icon("later"),
    );
    const pick = element(
      "button",
      { title: "choose rows that stay on top", onclick: () => this.pick(pick) },
      "Pin",
    );
    const head = element(
      "tr",
      {},
      element("th", {}, this.fold, pick),
      ...["x", "y", "z"].map((axis) => element("th", { className: `axis-${axis}` }, axis)),
      element("th", {}, "unit"),
      element("th", {}, "age"),
    );
    this.body = element("tbody");
    place.append(element("table", {}, element("thead", {}, head), this.body));
    this.pick(pick, false);
    this.arrange({ pins: Array.isArray(pins) ? pins.map(String) : [], folded: folded === true });
    telemetry.want(
      "table",
      this.rows.flatMap((entry) => entry.names),
    );
    telemetry.addEventListener("frame", ({ detail }) => {
      this.frame = detail;
    });
    setInterval(() => this.draw(), 125);
  }

  row(label, { names, digits, unit, topic, title = "" }) {
    const cells = names.length > 1 ? names.map(() => element("td")) : [element("td", { colSpan: 3 }, "–")],
      age = element("td", { className: "age" }),
      pin = element("button", { className: "pin", onclick: () => this.toggle(label) }, label);
    const line = element(
      "tr",
      { className: "stale", title },
      element("td", {}, pin),
      ...cells,
      element("td", { className: "unit" }, unit),
      age,
    );
    line.dataset.topic = topic;
    return { label, names, digits, cells, age, topic, line, pin };
  }

  pick(button, isOn = button.ariaPressed !== "true") {
    button.ariaPressed = String(isOn);
    this.place.classList.toggle("picking", isOn);
    for (const { pin } of this.rows) pin.disabled = !isOn;
  }

  toggle(label) {
    const isPinned = this.pins.includes(label);
    this.arrange({ pins: isPinned ? this.pins.filter((one) => one !== label) : [...this.pins, label] });
    this.rows.find((row) => row.label === label)?.pin.focus();
  }

  // Pinned rows first; folded, they alone, and the charts have the room.
  arrange({ pins = this.pins, folded = this.folded }) {
    Object.assign(this, { pins, folded });
    const isPinned = ({ label }) => pins.includes(label);
    for (const row of this.rows) {
      row.line.classList.toggle("pinned", isPinned(row));
      row.pin.ariaPressed = String(isPinned(row));
      row.pin.title = isPinned(row) ? "unpin" : "pin: on top, and in sight while the values are folded";
    }
    this.body.append(
      ...[...this.rows.filter(isPinned), ...this.rows.filter((row) => !isPinned(row))].map(
        ({ line }) => line,
      ),
    );
    document.body.classList.toggle("folded", folded);
    document.body.classList.toggle("bare", !this.rows.some(isPinned));
    this.fold.ariaExpanded = String(!folded);
    this.fold.ariaLabel = this.fold.title = folded ? "show all values" : "fold the values; pinned ones stay";
    remember(KEPT, { pins, folded });
  }

  draw() {
    if (!this.frame || document.hidden) return;
    for (const { names, digits, cells, age, topic } of this.rows) {
      const old = this.ages.age(topic);
      names.forEach((name, i) => {
        const value = this.frame.value[name],
          isKnown = Number.isFinite(value);
        if (isKnown)
          setText(cells[i], fixed(value, digits)); // else the last one stays, grey
        else if (cells[i].textContent === "") setText(cells[i], "–");
        cells[i].classList.toggle("stale", !isKnown); // also where another message is missing
      });
      const text = this.ages.isOld(topic) ? `○${coarse(old)}` : `${Math.round(old * 1e3)} ms`;
      setText(age, names.length && Number.isFinite(old) ? text : "–");
    }
  }
}

// Calm: in tenths below ten seconds.
const coarse = (age) => (age < 10 ? `${age.toFixed(1)} s` : seconds(Math.floor(age)).replace(".0", ""));
