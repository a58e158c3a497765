// The Calibrate tab: choose one, be guided through it, judge what it found, accept or reject it.

import { get, request } from "../core/api.js";
import { CalibrationHistory } from "./history.js";
import { CalibrationList } from "./list.js";
import { CalibrationResult } from "./result.js";
import { CalibrationRun } from "./run.js";
import { CALIBRATIONS, labelOf, RUNNING } from "./labels.js";
import { OptionForm } from "../experiments/options.js";
import { $, element, setIfChanged, setText, showNote } from "../core/dom.js";
import { words } from "../core/format.js";
import { onHold } from "../core/hold_button.js";

const TOPIC = "experiment_status";
const RETRY = 3000; // ms, while the station does not tell its experiments
const AGAIN = 15_000; // ms, between two looks at what the vehicle keeps
const FRESH = 1; // s

export class Calibrate {
  // session: of /api/session
  constructor(place, { events, session, telemetry, gains, isOperator, ages }) {
    this.place = place;
    this.events = events;
    this.session = session;
    this.gains = gains;
    this.isOperator = isOperator;
    this.ages = ages;
    this.known = []; // calibrations of /api/experiments
    this.history = null; // records, newest first; null while the vehicle has not told them
    this.problem = "Not read yet.";
    this.name = "";
    this.kept = new Map(); // options of a start, by name
    this.asked = this.read = -Infinity; // ms, of the last reading
    this.reason = element("p", { className: "reason", role: "alert", hidden: true });
    this.run = new CalibrationRun({ telemetry, isOperator, ask: (action, body) => this.ask(action, body) });
    this.result = new CalibrationResult({
      gains,
      isOperator,
      ask: (action) => this.ask(action),
      repeat: () => {
        this.choose(this.status.name);
        this.begin();
      },
      closed: () => this.draw(),
    });
    this.list = new CalibrationList({ gains, choose: (name) => this.choose(name) });
    this.about = element("p", { className: "about" });
    this.needs = element("p", { className: "needs" });
    this.form = new OptionForm();
    this.start = element("button", { className: "hold", title: "hold for 0.8 s" }, "Start");
    this.line = element("p", { className: "line", role: "status" });
    this.past = new CalibrationHistory(gains);
    this.choice = element(
      "div",
      {},
      this.list.place,
      this.about,
      this.needs,
      this.form.place,
      element("div", { className: "act" }, this.start, this.line),
      this.past.place,
    );
    place.append(this.reason, this.run.place, this.result.place, this.choice);
    onHold(this.start, 800, () => this.begin());
    events.on("hello", () => {
      this.asked = this.read = -Infinity;
    });
    events.on("summary", () => this.draw());
    gains.addEventListener("read", () => this.draw());
    document.addEventListener("tab", ({ detail }) => {
      if (detail === "calibrate") {
        this.read = -Infinity;
        this.draw();
      }
    });
    setInterval(() => this.draw(), 500); // what is said grows old while nothing comes
  }

  get status() {
    return this.events.summary.experiment ?? null;
  }
  get chosen() {
    return this.known.find(({ name }) => name === this.name);
  }
  isOurs(name) {
    return Object.hasOwn(CALIBRATIONS, name) || this.known.some((one) => one.name === name);
  }

  // What there is, and what the vehicle keeps: when the tab is open, and again when either was not told.
  look() {
    const now = performance.now();
    if (now - this.asked > (this.known.length ? AGAIN : RETRY)) {
      this.asked = now;
      this.loadKnown();
    }
    const isKept =
      this.status?.decision !== "accepted" ||
      this.history?.some(({ run_id: run }) => run === this.status.run_id);
    if (now - this.read > (this.history && isKept ? AGAIN : RETRY)) {
      this.read = now;
      this.loadHistory();
    }
  }

  // Files of one's own come, go and are mended.
  async loadKnown() {
    try {
      const { experiments } = await get("/api/experiments"),
        known = experiments.filter(({ calibration }) => calibration);
      if (!known.length) throw new Error("The station offers no calibrations.");
      if (JSON.stringify(known) === JSON.stringify(this.known)) return;
      this.known = known;
    } catch (error) {
      this.list.empty(error.message);
      return;
    }
    const typed = this.form.taken(),
      { name } = this;
    this.choose(this.isOurs(this.status?.name) ? this.status.name : name || this.known[0].name);
    if (this.name === name) this.form.put(typed);
  }

  async loadHistory() {
    try {
      const { history, problem } = await get("/api/calibrations");
      this.history = history;
      this.problem = problem;
    } catch (error) {
      this.history = null;
      this.problem = error.message;
    }
    this.draw();
  }

  recordsOf(name) {
    return this.history?.filter((record) => record.name === name) ?? null;
  }

  choose(name) {
    this.name = this.known.some((one) => one.name === name) ? name : (this.known[0]?.name ?? "");
    const { chosen } = this,
      text = CALIBRATIONS[this.name];
    this.form.show(chosen?.problem ? undefined : chosen);
    this.form.put(this.kept.get(this.name) ?? {});
    setText(this.about, chosen?.problem || chosen?.description || "");
    this.about.classList.toggle("amber", Boolean(chosen?.problem));
    setText(this.needs, text ? `Needs: ${text.needs}.` : "");
    this.draw();
  }

  begin() {
    this.reason.hidden = true;
    if (this.blockedReason) {
      this.refuse(this.blockedReason);
      return;
    }
    let options;
    try {
      options = this.form.values();
    } catch (error) {
      this.refuse(error.message);
      return;
    }
    this.kept.set(this.name, options);
    this.ask("start", { name: this.name, options });
  }

  async ask(action, body = {}) {
    this.reason.hidden = true;
    try {
      await request("POST", `/api/experiments/${action}`, body);
    } catch (error) {
      this.refuse(error.message);
    }
    this.read = -Infinity;
  }

  refuse(text) {
    showNote(this.reason, text);
    this.reason.scrollIntoView({ block: "nearest" });
  }

  // Why none can begin now; "" when one can.
  get blockedReason() {
    const { status, control } = this.events.summary,
      { status: experiment } = this,
      holder = control?.holder ?? "";
    if (!this.isOperator) return "Viewers cannot calibrate; ask an operator.";
    if (!this.events.connected) return "No connection to this page's server.";
    if (!this.known.length) return "No calibrations received from the station.";
    if (this.chosen?.problem) return "This file cannot run; the reason is given above.";
    if (!status) return "No data from the vehicle.";
    if (!(this.events.age("status") < FRESH))
      return "No recent status from the vehicle. Try again in a moment.";
    if (this.ages.isOld(TOPIC)) return "No experiment status received from the station.";
    if (RUNNING.includes(experiment?.phase)) {
      const by = experiment.requester ? `, started by ${experiment.requester}` : "";
      return `${labelOf(experiment.name)} is running${by}.`;
    }
    if (holder && holder !== this.session.label) return `${holder} has control; ask for it to calibrate.`;
    if (status.armed) return "The vehicle is armed; a calibration starts on the ground with the motors off.";
    if (status.mode && status.mode.toLowerCase() !== "ready")
      return (
        `The vehicle is ${words(status.mode)}; a calibration starts on the ground with the ` +
        "motors off (mode ready)."
      );
    return "";
  }

  draw() {
    const { status } = this,
      isOurs = Boolean(status?.name) && this.isOurs(status.name),
      runs = isOurs && RUNNING.includes(status.phase),
      isOld = this.ages.isOld(TOPIC);
    this.flag(isOurs && !isOld ? status : null);
    this.run.take(isOurs ? status : null);
    if (document.hidden || this.place.hidden) {
      this.run.rest();
      return;
    }
    this.look();
    if (runs && this.name !== status.name && this.known.length) this.choose(status.name); // started elsewhere
    const key = `${status?.run_id} ${status?.phase} ${status?.decision}`;
    if (key !== this.key) {
      // it may keep another one now; what was refused before is no news
      this.key = key;
      this.read = -Infinity;
      this.reason.hidden = true;
    }
    this.run.draw(runs ? status : null, isOld);
    this.result.draw(isOurs && !runs ? status : null, this.events.summary.proposal ?? null, {
      isOld,
      history: this.history,
      options: (options) => this.putOptions(status.name, options),
      blockedReason: this.blockedReason,
    });
    this.choice.hidden = runs;
    this.list.show(this.known, this.name, (name) => this.recordsOf(name));
    const { blockedReason } = this;
    this.start.disabled = Boolean(blockedReason);
    this.form.disable(!this.isOperator);
    setText(this.line, blockedReason);
    const { chosen } = this;
    this.past.place.hidden = !chosen;
    if (chosen) this.past.show(labelOf(chosen.name), this.recordsOf(chosen.calibration), this.problem);
  }

  // Of a run that another page started, so that Repeat is the same.
  putOptions(name, options) {
    if (this.kept.has(name)) return;
    this.kept.set(name, options);
    if (name === this.name) this.form.put(options);
  }

  // A dot at the tab while something waits for a person.
  flag(status) {
    const waits = status?.question
      ? "a question is waiting for your confirmation"
      : status && !RUNNING.includes(status.phase) && this.events.summary.proposal && !status.decision
        ? "a result is waiting to be accepted or rejected"
        : "";
    const tab = $("open-calibrate");
    tab.classList.toggle("waits", Boolean(waits));
    setIfChanged(tab, "title", waits);
  }
}
