// What the vehicle flies on, and the way onto bearings and back: three steps in plain words.

import { ConvergenceBar, convergenceOf } from "./convergence.js";
import { partsOf } from "./estimate_names.js";
import { attempt, element, optionsOf, setText } from "../core/dom.js";

const P = {
  estimator: "estimation.estimator",
  source: "estimation.source",
  shadow: "estimation.shadow",
  shadowSource: "estimation.shadow_source",
};
const SOURCES = {
  poses: "the tracker's poses",
  bearings: "bearings to the beacons",
  both: "poses and bearings together",
};
const OVER =
  "the vehicle switches when the estimate has converged and agrees with the one in use; " +
  "otherwise it reports why not";
const CALM = ["hover", "brake", "velocity"]; // what a hand-over is accepted in

export class Session {
  constructor(place, { events, gains, isOperator, ages }) {
    this.events = events;
    this.ages = ages;
    this.gains = gains;
    this.isOperator = isOperator;
    this.presets = {};
    this.line = element("output", { className: "flies" });
    this.line.dataset.topic = "status";
    this.detail = element("span", { className: "detail" });
    this.estimator = element("select", {
      ariaLabel: "estimator on bearings",
      disabled: !isOperator,
      onchange: () => this.draw(),
    });
    this.preset = element("select", {
      ariaLabel: "gains of the complementary filter",
      disabled: !isOperator,
      onchange: () => this.draw(),
      title: "gains of the complementary filter, set when it starts in parallel; the same as on the vehicle",
    });
    this.beside = element("button", { onclick: () => this.runBeside() }, "Run in parallel");
    this.stop = element("button", { onclick: () => this.attempt({ [P.shadow]: "none" }) }, "Stop");
    this.over = element(
      "button",
      { onclick: () => this.attempt({ [P.estimator]: this.estimator.value, [P.source]: "bearings" }) },
      "Fly on bearings",
    );
    this.back = element(
      "button",
      {
        onclick: () => this.attempt({ [P.source]: "poses" }),
        title: "switch back now; before landing the vehicle does so by itself",
      },
      "Back to tracker",
    );
    this.reason = element("div", { className: "reason", hidden: true, role: "status" });
    this.steps = [step("Hover on the tracker"), step("", this.stop, this.beside), step("", this.over)];
    this.bar = new ConvergenceBar();
    const [hover, beside, over] = this.steps.map(({ place: line }) => line);
    this.choice = element(
      "div",
      { className: "choice" },
      element("label", {}, "Estimator", this.estimator),
      element("label", {}, "Gains", this.preset),
    );
    this.way = element(
      "div",
      {},
      this.choice,
      element("ol", { className: "steps" }, hover, beside, this.bar.place, over),
    );
    place.append(
      element("div", { className: "flying" }, element("div", {}, this.line, this.detail), this.back),
      this.way,
      this.reason,
    );
  }

  // presets: gains of the complementary filter by name
  load(presets) {
    this.presets = presets;
    this.parameters();
  }

  parameters() {
    const choices =
      this.gains.rows.get(P.shadow)?.description.choices.filter((name) => name !== "none") ?? [];
    if (choices.join() !== [...this.estimator.options].map((option) => option.value).join()) {
      this.estimator.replaceChildren(...optionsOf(choices.map((name) => [name, partsOf(name)[0]])));
      this.estimator.value = choices.includes("error_state") ? "error_state" : choices[0];
    }
    const options = [
      ["", "as set"],
      ["default", "for the tracker"],
      ...Object.keys(this.presets).map((name) => [name, name]),
    ];
    if (options.length !== this.preset.options.length) {
      this.preset.replaceChildren(...optionsOf(options));
      this.preset.value = "resolved" in this.presets ? "resolved" : "";
    }
    this.draw();
  }

  // Of the values in use; "" when they are nobody's.
  get presetInUse() {
    const names = ["default", ...Object.keys(this.presets)];
    return (
      names.find((name) =>
        Object.entries(this.valuesOf(name)).every(([key, value]) => this.gains.value(key) === value),
      ) ?? ""
    );
  }

  valuesOf(name) {
    if (name !== "default") return this.presets[name] ?? {};
    const keys = Object.keys(Object.values(this.presets)[0] ?? {});
    return Object.fromEntries(keys.map((key) => [key, this.gains.rows.get(key)?.description.default]));
  }

  runBeside() {
    const gains = this.estimator.value === "complementary" ? this.valuesOf(this.preset.value) : {};
    this.attempt({ ...gains, [P.shadow]: this.estimator.value, [P.shadowSource]: "bearings" });
  }

  async attempt(values) {
    this.busy = true;
    this.draw();
    await attempt(this.reason, () => this.gains.set(values));
    this.busy = false;
    this.draw();
  }

  draw() {
    const value = (name) => this.gains.value(P[name]);
    const { status } = this.events.summary,
      isStale = this.ages.isOld("status");
    const flags = status?.flags ?? [],
      source = value("source");
    const onBearings = flags.includes("on_bearings") || source === "bearings";
    const filter = value("estimator"),
      gains = filter === "complementary" && this.presetInUse;
    setText(
      this.line,
      source === undefined
        ? "The vehicle's parameters have not been read yet"
        : `${status?.airborne === false ? "Estimate from" : "Flies on"} ${SOURCES[onBearings ? "bearings" : source]}`,
    );
    setText(
      this.detail,
      [
        filter && partsOf(filter)[0],
        gains === "default" ? "gains for the tracker" : gains && `${gains} gains`,
        flags.includes("fell_back") && "fell back automatically; see the events",
      ]
        .filter(Boolean)
        .join(" · "),
    );
    this.detail.classList.toggle("amber", flags.includes("fell_back") && !isStale);
    this.way.hidden = source !== "poses";
    this.back.hidden = source === undefined || source === "poses";
    this.drawSteps(status, isStale, value);
    for (const button of [this.beside, this.stop, this.over, this.back]) {
      button.disabled = !this.isOperator || Boolean(this.busy);
    }
    // What comes before a step is done first; on the ground the choice would only keep it from arming.
    if (this.missing) this.over.disabled = true;
    this.over.title = this.missing || OVER;
    this.preset.disabled = !this.isOperator || this.estimator.value !== "complementary";
  }

  // Whether an armed vehicle uses bearings, which it then lets nobody move.
  get isFlown() {
    const source = this.gains.value(P.source);
    return Boolean(this.events.summary.status?.armed) && source !== undefined && source !== "poses";
  }

  drawSteps(status, isStale, value) {
    const [hover, beside, over] = this.steps;
    const bound = (key) => this.gains.value(`beacons.${key}`),
      low = bound("height_min"),
      high = bound("envelope_z_max"),
      wide = bound("envelope_xy");
    const room = [low, high, wide].includes(undefined) ? "" : `, ${low} to ${high} m high, within ±${wide} m`;
    const hovers = !isStale && Boolean(status?.airborne) && CALM.includes(status?.behavior?.toLowerCase());
    mark(hover, `Hover on the tracker${room}`, hovers);
    const runs = value("shadow") === this.estimator.value && value("shadowSource") === "bearings";
    const isSet =
      this.estimator.value !== "complementary" ||
      this.preset.value === "" ||
      this.presetInUse === this.preset.value;
    mark(
      beside,
      runs ? "It runs in parallel, on bearings" : "Run it in parallel, on bearings",
      runs && isSet,
    );
    this.beside.hidden = runs && isSet;
    setText(this.beside, runs ? "Set gains" : "Run in parallel");
    this.stop.hidden = !runs;
    this.beside.parentElement?.classList.toggle("two", runs && !isSet);
    const convergence = runs && !isStale ? convergenceOf(status) : null;
    this.bar.show(convergence);
    this.missing = "hover on the tracker first";
    if (hovers) this.missing = runs && isSet ? (convergence?.lack ?? "") : "run it in parallel first";
    mark(
      over,
      `Hand over, ${this.missing || (convergence ? "it has converged" : "once it has converged")}`,
      false,
    );
  }
}

function step(text, ...buttons) {
  const label = element("span", {}, text);
  return { label, place: element("li", {}, label, ...buttons) };
}

function mark({ label, place }, text, isDone) {
  setText(label, text);
  place.classList.toggle("done", isDone);
}
