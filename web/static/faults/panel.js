// Wind and faults of a simulated vehicle, in place of the tabs: the air and the load as sliders, what is set,
// and the faults with their schedules, from the table of their declarations.

import { get } from "../core/api.js";
import { $, attempt, element, optionsOf, setText } from "../core/dom.js";
import { words } from "../core/format.js";
import { OptionForm } from "../experiments/options.js";
import { fill, GainRow } from "../gains/row.js";
import { calm, entriesOf, entryOf, movable, TEXTS, withEntry, withoutEntry } from "./entries.js";

const AIR = ["wind_x", "wind_y", "wind_z", "gust", "gust_time", "push_x", "push_y", "push_z", "payload"].map(
  (name) => `simulator.${name}`,
);
const VIEWERS = "viewers cannot do this; ask an operator";

export class FaultsPanel {
  constructor(place, { gains, isOperator }) {
    this.place = place;
    this.gains = gains;
    this.isOperator = isOperator;
    this.rows = new Map();
    /** @type {any} */
    this.table = null; // of the declarations, once the panel has been opened
    this.offered = new Map(); // by name
    this.calmButton = this.button(
      "Remove all",
      "wind, load and faults away; tracker and bearings without errors of their own",
      () => this.set(calm(gains.known.values())),
    );
    this.count = element("output", { className: "facts" });
    this.answer = element("p", { className: "reason", role: "status", hidden: true });
    this.air = element("div", { className: "air" });
    this.list = element("ul", { className: "set" });
    this.select = element("select", { ariaLabel: "fault", onchange: () => this.showForms() });
    this.physics = element("p", { className: "facts" });
    this.form = new OptionForm();
    this.schedule = new OptionForm();
    this.start = this.button("Start", "set this fault: its clock begins now", () => this.add());
    place.append(
      element(
        "header",
        {},
        element("h2", {}, "Wind and faults"),
        element("button", { title: "back to the tab", onclick: () => this.close() }, "Close"),
      ),
      element("div", { className: "act" }, this.calmButton, this.count),
      this.answer,
      element("h3", {}, "Faults that are set"),
      this.list,
      element("h3", {}, "Start a fault"),
      this.select,
      this.physics,
      this.form.place,
      element("details", {}, element("summary", {}, "Schedule"), this.schedule.place),
      element("div", { className: "act" }, this.start),
      element("h3", {}, "Air and load"),
      this.air,
    );
    gains.addEventListener("read", () => this.draw());
    gains.addEventListener("confirmed", ({ detail }) => this.confirmed(detail.name));
    document.addEventListener("tab", () => this.close());
  }

  button(label, does, onclick) {
    return element(
      "button",
      { disabled: !this.isOperator, title: this.isOperator ? does : VIEWERS, onclick },
      label,
    );
  }

  async open() {
    this.place.hidden = false;
    $("side").classList.add("with-faults");
    this.draw();
    this.place.scrollIntoView({ block: "start" });
    await attempt(this.answer, async () => {
      this.table ??= await get("/static/faults/faults.json");
    });
    if (this.table && !this.select.options.length) this.offer();
  }

  close() {
    this.place.hidden = true;
    $("side").classList.remove("with-faults");
  }

  // Only those of parts that are there: the station's, for a simulated tracker and emulated bearings.
  offer() {
    const named = this.table.faults.filter(({ home }) => this.gains.value(TEXTS[home]) !== undefined),
      moved = movable(this.gains.known.values());
    this.offered = new Map([...named, ...moved].map((one) => [one.name, one]));
    const groups = [...grouped(named)].map(([subject, faults]) => [
      words(subject),
      faults.map(({ name }) => [name, words(name.replace(".", " "))]),
    ]);
    groups.push(["a parameter, by a schedule", moved.map(({ name }) => name)]);
    this.select.replaceChildren(
      ...groups.map(([label, options]) => {
        const group = element("optgroup", { label });
        group.append(...optionsOf(options));
        return group;
      }),
    );
    this.schedule.show({ name: "schedule", options: this.table.schedule });
    this.schedule.put({ to: "" });
    this.showForms();
  }

  get chosen() {
    return this.offered.get(this.select.value);
  }

  showForms() {
    setText(this.physics, this.chosen?.physics ?? "");
    this.form.show(this.chosen && { name: this.chosen.name, options: this.chosen.words });
  }

  add() {
    const { chosen } = this;
    if (!chosen) return;
    const said = { ...this.form.taken(), ...this.schedule.taken() };
    for (const { name, type } of [...chosen.words, ...this.table.schedule])
      if (type !== "str" && type !== "bool" && said[name] !== "") said[name] = Number(said[name]);
    const name = TEXTS[chosen.home];
    this.set({
      [name]: withEntry(
        this.gains.value(name),
        entryOf(chosen.name, chosen.words, this.table.schedule, said),
      ),
    });
  }

  set(values) {
    if (Object.keys(values).length) attempt(this.answer, () => this.gains.set(values));
  }

  confirmed(name) {
    if (this.place.hidden) return;
    this.rows.get(name)?.confirm(this.gains.value(name));
    this.drawSet();
  }

  draw() {
    if (this.place.hidden) return;
    for (const name of AIR) {
      const description = this.gains.known.get(name);
      if (description && !this.rows.has(name)) {
        const row = new GainRow(
          description,
          this.isOperator,
          (value) => this.gains.change(name, value),
          () => {},
        );
        this.rows.set(name, row);
        this.air.append(row.place);
        fill([row]);
      }
      this.rows.get(name)?.confirm(this.gains.value(name));
    }
    this.drawSet();
  }

  drawSet() {
    const texts = Object.values(TEXTS).map((name) => [name, this.gains.value(name) ?? ""]);
    const set = texts.flatMap(([name, text]) =>
      entriesOf(text).map((entry, index) => ({ name, text, entry, index })),
    );
    const drawn = JSON.stringify(set),
      isCalm = Object.keys(calm(this.gains.known.values())).length === 0;
    setText(
      this.count,
      isCalm
        ? "no wind, no faults"
        : set.length
          ? `${set.length} ${set.length === 1 ? "fault" : "faults"} set`
          : "no faults set",
    );
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    this.list.replaceChildren(...set.map((one) => this.line(one)));
    if (!set.length) this.list.append(element("li", { className: "empty" }, "None."));
  }

  line({ name, text, entry, index }) {
    const [fault, ...said] = entry.split(" ");
    const stop = this.button("Stop", `take out ${fault}`, () =>
      this.set({ [name]: withoutEntry(text, index) }),
    );
    stop.ariaLabel = `stop ${entry}`;
    return element(
      "li",
      {},
      element(
        "span",
        {},
        element("b", {}, fault),
        element("span", { className: "facts" }, said.length ? said.join(" ") : "on"),
      ),
      stop,
    );
  }
}

const subjectOf = ({ name }) => name.split(".")[0];

function grouped(faults) {
  const found = new Map();
  for (const one of faults) found.set(subjectOf(one), [...(found.get(subjectOf(one)) ?? []), one]);
  return found;
}
