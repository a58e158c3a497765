// The Tune tab: a step or doublet on one axis, drawn and judged from the vehicle's own log.

import { command, get, request } from "/static/core/api.js";
import { flightButton } from "/static/core/flight_button.js";
import { attempt, element, optionsOf, setText, showNote } from "/static/core/dom.js";
import { exact, words } from "/static/core/format.js";
import { colorsOf, TunePlot } from "./plot.js";
import { TuneRuns } from "./runs.js";
import { figuresTable, gainsTable } from "./tables.js";
import { DEGREES } from "./units.js";

const LETTERS = "ABCDEFGHIJKLMNOPQRST";
const BUSY = ["flying", "fetching", "evaluating"];
const SHOWN = {
  idle: "",
  flying: "Flying",
  fetching: "Fetching the vehicle's log",
  evaluating: "Judging",
  done: "Done",
  failed: "Failed",
};
const AXES = ["x", "y", "z", "yaw"],
  SHAPES = ["step", "doublet"];
const CACHED = 20;

export function show(place, { events, session, isOperator }) {
  new Tune(place, { events, session, isOperator });
}

class Tune {
  axis;
  shape;
  amplitude;
  unit;
  duration;
  repeats;
  start;
  stop;
  bar;
  progress;
  line;
  reason;
  figures;
  gains;
  list;
  plot; // made by build()

  // session: of /api/session
  constructor(place, { events, session, isOperator }) {
    this.place = place;
    this.events = events;
    this.session = session;
    this.isOperator = isOperator;
    this.status = { phase: "idle", text: "", share: 0 };
    this.most = {};
    this.runs = [];
    this.chosen = new Set();
    this.samples = new Map(); // of runs that were drawn, by id
    this.isKnown = false;
    this.build();
    events.on("hello", () => this.load());
    events.on("parameters", () => this.load()); // the limits come with them
    events.on("parameter", ({ name }) => {
      if (name.startsWith("behavior.excite_")) this.load();
    });
    events.on("tuning", ({ status, runs }) => this.take(status, runs));
    events.on("summary", () => this.draw());
    document.addEventListener("tab", ({ detail }) => {
      if (detail === "tune") this.redraw();
    });
    setInterval(() => this.draw(), 500); // what is said grows old while nothing comes
  }

  build() {
    const choice = (name, values) =>
      element("select", { ariaLabel: name, onchange: () => this.change(name) }, ...optionsOf(values));
    const number = (name, value, min, max, step) =>
      element("input", {
        type: "number",
        ariaLabel: name,
        value,
        min,
        max,
        step,
        oninput: () => this.draw(),
      });
    this.axis = choice("axis", AXES);
    this.shape = choice("shape", SHAPES);
    this.shape.title = "step: out and back. Doublet: out, to the other side, and back";
    this.amplitude = number("amplitude", 0.3, -10, 10, "any");
    this.amplitude.title = "jump of the set-point, of either sign";
    this.unit = element("small", {}, "m");
    this.duration = number("duration of each level", 2, 0.2, 10, "any");
    this.repeats = number("repeats", 1, 1, 5, 1);
    const field = (text, ...parts) =>
      element("label", { className: parts.length > 1 ? "" : "bare" }, element("span", {}, text), ...parts);
    this.start = flightButton(element("button", { onclick: () => this.run() }, "Run"));
    this.stop = element(
      "button",
      { title: "brake: the test ends, the vehicle stops and hovers", onclick: () => this.brake() },
      "Brake",
    );
    this.bar = element("i");
    this.progress = element(
      "div",
      {
        className: "progress",
        role: "progressbar",
        ariaLabel: "progress of the test",
        ariaValueMin: "0",
        ariaValueMax: "100",
      },
      this.bar,
    );
    this.line = element("p", { className: "line", role: "status" });
    this.reason = element("p", { className: "reason", role: "alert", hidden: true });
    const chart = element("section", { className: "tune-chart" });
    this.figures = element("div", { className: "wide" });
    this.gains = element("div", { className: "wide" });
    const list = element("section", {});
    this.place.append(
      element(
        "div",
        { className: "form" },
        field("Axis", this.axis),
        field("Shape", this.shape),
        field("Amplitude", this.amplitude, this.unit),
        field("Hold", this.duration, element("small", {}, "s")),
        field("Repeats", this.repeats),
        element("div", { className: "act" }, this.start, this.stop),
      ),
      this.progress,
      this.line,
      this.reason,
      chart,
      this.figures,
      this.gains,
      list,
    );
    this.plot = new TunePlot(chart);
    this.list = new TuneRuns(list, {
      isOperator: this.isOperator,
      chosen: this.chosen,
      choose: () => this.redraw(),
      refuse: (text) => this.refuse(text),
    });
  }

  async load() {
    let tuning;
    try {
      tuning = await get("/api/tuning");
    } catch {
      return;
    } // web is away; its hello loads again
    this.status = tuning.status;
    this.most = {
      ...Object.fromEntries(["x", "y", "z"].map((axis) => [axis, tuning.amplitude_max.position])),
      yaw: tuning.amplitude_max.yaw,
    };
    this.runs = tuning.runs;
    for (const id of this.chosen) if (!this.runs.some((run) => run.id === id)) this.chosen.delete(id);
    if (!this.isKnown && this.runs.length) this.chosen.add(this.runs[0].id);
    this.isKnown = true;
    this.redraw();
  }

  async take(status, haveChanged) {
    const isNew = status.phase === "done" && status.id && status.id !== this.status.id;
    this.status = status;
    this.draw();
    if (!haveChanged) return;
    if (isNew) await this.choose(status.id);
    else await this.load();
  }

  // A new test is drawn with the last one that is drawn already, when they can be compared.
  async choose(id) {
    const before = this.runs.filter((run) => this.chosen.has(run.id)).at(0);
    this.chosen.clear();
    this.chosen.add(id);
    await this.load();
    const made = this.runs.find((run) => run.id === id);
    if (before && made && before.plan.axis === made.plan.axis && before.plan.shape === made.plan.shape)
      this.chosen.add(before.id);
    this.redraw();
  }

  // Chart, tables and list anew, of what is chosen.
  async redraw() {
    this.draw();
    const turn = (this.turn = (this.turn ?? 0) + 1);
    const chosen = this.runs.filter((run) => this.chosen.has(run.id)).reverse(); // oldest first
    const letters = chosen.map((_, i) => LETTERS[i]),
      colors = colorsOf(chosen);
    if (this.isKnown)
      this.list.show(
        this.runs,
        new Map(chosen.map((run, i) => [run.id, letters[i]])),
        new Map(chosen.map((run, i) => [run.id, colors[i]])),
      );
    this.figures.replaceChildren(figuresTable(chosen, letters, colors));
    this.gains.replaceChildren(
      gainsTable(chosen, letters, colors, (run) => this.putBack(run), this.isOperator),
    );
    if (this.place.hidden) return; // the chart has no size; drawn when the tab is opened
    const drawn = [];
    for (const run of chosen) {
      try {
        const content =
          this.samples.get(run.id) ?? (await get(`/api/tuning/runs/${encodeURIComponent(run.id)}`));
        this.samples.set(run.id, content);
        drawn.push(content);
      } catch (error) {
        this.refuse(error.message);
      }
    }
    while (this.samples.size > CACHED) this.samples.delete(this.samples.keys().next().value);
    if (turn === this.turn) this.plot.show(drawn, letters);
  }

  change(name) {
    if (name === "axis") {
      const isAngle = this.axis.value === "yaw",
        was = this.unit.textContent === "°";
      if (isAngle !== was) this.amplitude.value = isAngle ? 20 : 0.3;
      this.unit.textContent = isAngle ? "°" : "m";
    }
    this.draw();
  }

  get plan() {
    const scale = this.axis.value === "yaw" ? 1 / DEGREES : 1;
    return {
      axis: this.axis.value,
      shape: this.shape.value,
      amplitude: this.amplitude.valueAsNumber * scale,
      duration: this.duration.valueAsNumber,
      repeats: this.repeats.valueAsNumber,
    };
  }

  // Why no test can begin now; "" when one can.
  get blockedReason() {
    const { status, control } = this.events.summary,
      holder = control?.holder ?? "";
    if (!this.isOperator) return "Viewers cannot run tests; ask an operator.";
    if (BUSY.includes(this.status.phase)) return "A test is running.";
    if (!this.events.connected || !(this.events.age("status") < 1))
      return "No recent status from the vehicle. Try again in a moment.";
    if (holder && holder !== this.session.label) return `${holder} has control; ask for it to fly a test.`;
    if (!status?.airborne) return "The vehicle is on the ground: take off first.";
    if (status.behavior !== "hover")
      return `The vehicle's behavior is ${words(status.behavior)}; a test starts from hover.`;
    return this.wrong;
  }

  // What of the form cannot be asked for.
  get wrong() {
    const { axis, amplitude, duration, repeats } = this.plan,
      isAngle = axis === "yaw",
      unit = isAngle ? "°" : "m";
    const most = this.most[axis],
      shown = (value) => exact(Number((isAngle ? value * DEGREES : value).toFixed(2)));
    if (!Number.isFinite(amplitude) || Math.abs(amplitude) < 0.01)
      return `Amplitude: at least ${shown(0.01)} ${unit}.`;
    if (Number.isFinite(most) && Math.abs(amplitude) > most + 1e-6)
      return `Amplitude: at most ${shown(most)} ${unit} (behavior.excite_${isAngle ? "yaw" : "position"}_max).`;
    if (!(duration >= 0.2 && duration <= 10)) return "Hold: 0.2 to 10 s.";
    if (![1, 2, 3, 4, 5].includes(repeats)) return "Repeats: 1 to 5.";
    return "";
  }

  async run() {
    if (this.blockedReason) {
      this.refuse(this.blockedReason);
      return;
    }
    this.start.disabled = true;
    await attempt(this.reason, () => request("POST", "/api/tuning/run", this.plan));
    this.draw();
  }

  brake() {
    attempt(this.reason, () => command("start_behavior", { name: "brake" }));
  }

  async putBack(run) {
    await attempt(this.reason, async () => {
      const { applied, left } = await request(
        "POST",
        `/api/tuning/runs/${encodeURIComponent(run.id)}/gains`,
        {},
      );
      const names = Object.entries(applied).map(
        ([name, value]) => `${name.split(".").slice(-2).join(".")} ${exact(value)}`,
      );
      this.said = `Restored: ${names.join(", ")}${left.length ? `; unchanged: ${left.join(", ")}` : ""}`;
    });
    this.draw();
  }

  refuse(text) {
    showNote(this.reason, text);
  }

  draw() {
    const { status } = this,
      isBusy = BUSY.includes(status.phase),
      blockedReason = this.blockedReason;
    if (isBusy) this.said = "";
    this.start.disabled = Boolean(blockedReason);
    this.start.title = blockedReason || "jump, hold, jump back; ends in hover where it began";
    this.stop.disabled = !this.isOperator || status.phase !== "flying";
    const percent = isBusy ? Math.round(100 * status.share) : 0;
    this.bar.style.width = `${percent}%`;
    this.progress.ariaValueNow = String(percent);
    this.progress.classList.toggle("old", !this.events.connected);
    this.line.classList.toggle(
      "amber",
      status.phase === "failed" || Boolean(status.phase === "done" && status.text),
    );
    const last =
      status.phase === "idle" || (status.phase === "done" && !status.text)
        ? ""
        : `${SHOWN[status.phase]}${status.text ? `: ${status.text}` : ""}`;
    setText(
      this.line,
      isBusy ? last : this.said || [last, blockedReason].filter(Boolean).join(". ").replaceAll("..", "."),
    );
    for (const input of [this.axis, this.shape, this.amplitude, this.duration, this.repeats])
      input.disabled = isBusy || !this.isOperator;
    this.amplitude.classList.toggle("invalid", this.wrong.startsWith("Amplitude"));
  }
}
