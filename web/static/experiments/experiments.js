// The Experiments tab: cards with their last verdicts, start by a hold (it arms), series, finish, stop, the verdict,
// and notes of the run.

import { get, request } from "../core/api.js";
import { isCalibration, RUNNING } from "../calibrate/labels.js";
import { Cards } from "./cards.js";
import { badge, figures } from "./figures.js";
import { Guide } from "./guide.js";
import { OptionForm } from "./options.js";
import { Series } from "./series.js";
import { SessionNotes } from "./session_notes.js";
import { isThere } from "../core/vehicle_path.js";
import { element, hide, setText } from "../core/dom.js";
import { duration, words } from "../core/format.js";
import { onHold } from "../core/hold_button.js";

const HELP = "Any command of a person, or a deflected stick, takes over and ends it.";
const BY_HAND = "Flown by hand: hold Shift, or a shoulder button of the pad.";
const RETRY = 3000,
  NEW = 10_000; // ms, while the station does not tell its experiments, and afterwards
const BETWEEN = 5000; // ms between two flights of a simulated series

export class ExperimentSection {
  constructor(place, { events, fly, isOperator, ages, gains }) {
    this.events = events;
    this.ages = ages;
    this.fly = fly;
    this.gains = gains;
    this.isOperator = isOperator;
    this.place = place;
    this.known = null; // asked for when the tab is open
    this.others = []; // names of those in the Calibrate tab
    this.again = 0;
    this.form = new OptionForm();
    this.series = new Series();
    this.notes = new SessionNotes(events, isOperator);
    this.guide = new Guide({ isOperator, ask: (action, body) => this.ask(action, body) });
    const button = (className, label, title, onclick) =>
      element("button", { className, title, onclick }, label);
    this.start = button("start hold", "Start", "hold for 0.8 s: arms, takes off and flies it");
    this.finish = button(
      "finish",
      "Finish",
      "end the manoeuvre now: the experiment takes over, lands and judges it",
      () => this.ask("finish"),
    );
    this.stop = button("stop", "Stop", "stop commanding: the vehicle brakes and hovers; land it", () =>
      this.ask("stop"),
    );
    this.bar = element("i");
    this.step = element("p", { className: "step" });
    this.state = element("output");
    this.result = element("div", { className: "result" });
    this.now = element(
      "section",
      { className: "now", ariaLabel: "the experiment that runs" },
      element("h2", {}, this.state),
      element("div", { className: "progress" }, this.bar),
      this.step,
      this.guide.place,
      element("div", { className: "act" }, this.finish, this.stop),
    );
    this.now.dataset.topic = "experiment_status";
    this.problem = element("p", { className: "empty" });
    const body = element(
      "div",
      {},
      this.form.place,
      this.series.form,
      element("div", { className: "act" }, this.start, element("span", {}, HELP)),
    );
    this.cards = new Cards(body, () => this.showOptions());
    place.append(this.now, this.result, this.series.place, this.problem, this.cards.place, this.notes.place);
    onHold(this.start, 800, () => this.begin());
    document.addEventListener("tab", ({ detail }) => this.show(detail === "experiments"));
    document.addEventListener("again", (/** @type {any} */ { detail }) => this.prepare(detail));
    events.on("summary", () => this.draw());
    setInterval(() => this.draw(), 500);
  }

  get status() {
    return this.events.summary.experiment ?? null;
  }

  show(isOpen) {
    this.isOpen = isOpen;
    if (!isOpen) return;
    this.notes.open();
    this.draw();
  }

  // Again and again while it is open: files of one's own come, go and are mended.
  async load() {
    if (performance.now() < this.again) return;
    this.again = performance.now() + (this.known ? NEW : RETRY);
    this.judge();
    try {
      const { experiments } = await get("/api/experiments"),
        text = JSON.stringify(experiments);
      if (!experiments.length) throw new Error("The station offers no experiments.");
      if (text === this.text) return;
      this.text = text;
      this.known = experiments.filter(({ calibration }) => !calibration);
      this.others = experiments.filter(({ calibration }) => calibration).map(({ name }) => name);
    } catch (error) {
      if (!this.known) setText(this.problem, error.message);
      return;
    }
    hide(this.problem, true);
    const { chosen } = this.cards,
      typed = this.form.taken();
    this.cards.show(this.known, this.running ? this.status.name : chosen);
    if (this.cards.chosen === chosen) this.form.put(typed);
  }

  async judge() {
    const found = await get("/api/experiments/results").catch(() => null);
    if (found) this.cards.judge(found);
  }

  // An experiment with the options of a run; what this installation does not have is left out.
  async prepare({ experiment: name, options }) {
    if (!name) return;
    this.again = 0;
    await this.load();
    if (!this.known?.some((one) => one.name === name)) return;
    this.cards.open(name);
    this.form.put(options);
  }

  get chosen() {
    return this.known?.find(({ name }) => name === this.cards.chosen);
  }

  // A file of one's own that is broken can be opened, to read why, and not started.
  showOptions() {
    const shown = this.chosen?.problem ? undefined : this.chosen;
    this.form.show(shown);
    this.series.offer(shown);
    this.draw();
  }

  // The next flight of a series that waits, or the first one of what is chosen.
  begin() {
    clearTimeout(this.timer);
    try {
      if (!this.series.goesOn)
        this.fire(this.cards.chosen, this.series.begin(this.cards.chosen, this.form.values()));
      else this.fire(this.series.name, this.series.next.options);
    } catch (error) {
      this.fly.refuse(error.message);
    }
  }

  async fire(name, options) {
    if (!(await this.ask("start", { name, options }))) this.series.stop();
  }

  ask(action, body = {}) {
    return this.fly.attempt(
      () => request("POST", `/api/experiments/${action}`, body),
      `Experiment ${action}`,
    );
  }

  // A simulated series goes on by itself.
  ended(status) {
    if (!this.series.took(status)) return;
    const isSimulated = this.gains.value("simulator.battery_charge") !== undefined;
    if (isSimulated) this.timer = setTimeout(() => this.begin(), BETWEEN);
    this.series.draw(isSimulated ? ` begins in ${BETWEEN / 1000} s` : ": hold Start");
  }

  draw() {
    const { status } = this,
      isElsewhere = Boolean(status) && (isCalibration(status.name) || this.others.includes(status.name)),
      old = this.ages.isOld("experiment_status"),
      runs = Boolean(status) && RUNNING.includes(status.phase);
    if (this.running && !runs) this.ended(status);
    this.running = runs && !isElsewhere;
    if (this.isOpen) this.load();
    const tab = document.getElementById("open-experiments");
    tab?.classList.toggle("busy", this.running);
    tab?.classList.toggle("asks", this.running && Boolean(status.question));
    this.drawNow(status, { runs, old, isElsewhere });
    const key = JSON.stringify([
      status?.phase,
      status?.run_id,
      status?.reason,
      status?.reports,
      runs,
      isElsewhere,
    ]);
    if (key === this.drawn) return;
    this.drawn = key;
    this.again = 0; // the cards, too
    this.showResult(isElsewhere ? null : status, runs);
  }

  drawNow(status, { runs, old, isElsewhere }) {
    const inTheAir = runs && status.phase !== "evaluating";
    const time = status?.planned ? `${duration(status.elapsed)} of about ${duration(status.planned)}` : "";
    hide(this.now, !runs);
    setText(this.state, runs ? `${words(status.name)} · ${words(status.phase)}` : "");
    this.guide.draw(isElsewhere ? null : status, old);
    this.place.classList.toggle("old", old);
    this.start.disabled = !this.isOperator || runs || old || !this.chosen || Boolean(this.chosen.problem);
    setText(this.start, this.series.goesOn && this.series.at ? `Start ${this.series.count}` : "Start");
    this.finish.disabled = !this.isOperator || status?.phase !== "flying" || old;
    this.stop.disabled = !this.isOperator || !runs || old;
    this.form.disable(runs);
    this.bar.style.width =
      runs && status.planned ? `${Math.min(100, (100 * status.elapsed) / status.planned)}%` : "0";
    const flown = runs
      ? `${status.manual ? BY_HAND : status.step}${inTheAir && time ? ` · ${time}` : ""}`
      : "";
    setText(this.step, isElsewhere && runs ? "A calibration runs: see the Calibrate tab." : flown);
  }

  showResult(status, runs) {
    if (!status || runs || status.phase === "idle") {
      this.result.replaceChildren();
      return;
    }
    const judged = status.metrics.length > 0,
      run = encodeURIComponent(status.run_id);
    const links = [
      ...(judged ? [element("a", { href: `/report/${run}`, target: "_blank" }, "Report")] : []),
      ...(status.run_id && isThere("replay") ? [element("a", { href: `/replay/${run}` }, "Replay")] : []),
      ...(status.run_id ? [element("a", { href: `/api/runs/${run}/download`, download: "" }, "Log")] : []),
    ];
    this.result.replaceChildren(
      element(
        "p",
        { className: `verdict ${status.phase}` },
        words(status.name),
        badge({ verdict: status.phase, metrics: status.metrics }),
        element("span", { className: "links" }, ...links),
      ),
      ...(status.reason ? [element("p", { className: "reason" }, status.reason)] : []),
      ...(judged ? [figures(status.metrics)] : []),
    );
  }
}
