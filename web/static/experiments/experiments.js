// The Fly tab's experiments: options, start by a hold (it arms), finish, stop, and the verdict.

import { get, request } from "../core/api.js";
import { isCalibration, RUNNING } from "../calibrate/labels.js";
import { figures } from "./figures.js";
import { Guide } from "./guide.js";
import { OptionForm } from "./options.js";
import { element, optionsOf, setText } from "../core/dom.js";
import { duration, words } from "../core/format.js";
import { onHold } from "../core/hold_button.js";

const HELP = "Any command of a person, or a deflected stick, takes over and ends it.";
const BY_HAND = "Flown by hand: hold Shift, or a shoulder button of the pad.";
const RETRY = 3000,
  NEW = 10_000; // ms, while the station does not tell its experiments, and afterwards

export class ExperimentSection {
  constructor(place, events, fly, isOperator, ages) {
    this.events = events;
    this.ages = ages;
    this.fly = fly;
    this.isOperator = isOperator;
    this.place = place;
    this.known = null; // asked for when the section is open
    this.others = []; // names of those in the Calibrate tab
    this.again = 0;
    this.state = element("output");
    this.select = element("select", { ariaLabel: "experiment", onchange: () => this.showOptions() });
    this.about = element("p", { className: "about" });
    this.form = new OptionForm();
    this.guide = new Guide({ isOperator, ask: (action, body) => this.ask(action, body) });
    this.start = element(
      "button",
      { className: "hold", title: "hold for 0.8 s: arms, takes off and flies it" },
      "Start",
    );
    this.finish = element(
      "button",
      {
        title: "end the manoeuvre now: the experiment takes over, lands and judges it",
        onclick: () => this.ask("finish"),
      },
      "Finish",
    );
    this.stop = element(
      "button",
      { title: "stop commanding: the vehicle brakes and hovers; land it", onclick: () => this.ask("stop") },
      "Stop",
    );
    this.bar = element("i");
    this.step = element("p", { className: "step" });
    this.result = element("div", { className: "result" });
    this.state.dataset.topic = this.step.dataset.topic = "experiment_status";
    place.append(
      element("summary", {}, "Experiment", this.state),
      this.select,
      this.about,
      this.form.place,
      element("div", { className: "act" }, this.start, this.finish, this.stop),
      element("div", { className: "progress" }, this.bar),
      this.step,
      this.guide.place,
      this.result,
    );
    onHold(this.start, 800, () => this.begin());
    place.addEventListener("toggle", () => place.open && this.load());
    document.addEventListener("again", (/** @type {any} */ { detail }) => this.prepare(detail));
    events.on("summary", () => this.draw());
    setInterval(() => this.draw(), 500);
  }

  get status() {
    return this.events.summary.experiment ?? null;
  }

  // Again and again while it is open: files of one's own come, go and are mended.
  async load() {
    if (performance.now() < this.again) return;
    this.again = performance.now() + (this.known ? NEW : RETRY);
    try {
      const { experiments } = await get("/api/experiments"),
        text = JSON.stringify(experiments);
      if (!experiments.length) throw new Error("The station offers no experiments.");
      if (text === this.text) return;
      this.text = text;
      this.known = experiments.filter(({ calibration }) => !calibration);
      this.others = experiments.filter(({ calibration }) => calibration).map(({ name }) => name);
    } catch (error) {
      if (this.known) return;
      this.form.place.replaceChildren(element("p", { className: "empty" }, error.message));
      return;
    }
    const before = this.select.value,
      typed = this.form.taken();
    this.select.replaceChildren(
      ...optionsOf(this.known.map(({ name, problem }) => [name, problem ? `${name}: broken` : words(name)])),
    );
    const running = this.known.find(({ name }) => name === this.status?.name);
    this.select.value =
      (
        running ??
        this.known.find(({ name }) => name === before) ??
        this.known.find(({ name }) => name === "bearings") ??
        this.known[0]
      )?.name ?? "";
    this.showOptions();
    if (this.select.value === before) this.form.put(typed);
  }

  // An experiment with the options of a run; what this installation does not have is left out.
  async prepare({ experiment: name, options }) {
    if (!name) return;
    this.place.open = true;
    this.again = 0;
    await this.load();
    if (!this.known?.some((one) => one.name === name)) return;
    this.select.value = name;
    this.showOptions();
    this.form.put(options);
  }

  get chosen() {
    return this.known?.find(({ name }) => name === this.select.value);
  }

  // A file of one's own that is broken can be chosen, to read why, and not started.
  showOptions() {
    const { chosen } = this;
    setText(this.about, chosen?.problem || chosen?.description || "");
    this.about.classList.toggle("reason", Boolean(chosen?.problem));
    this.form.show(chosen?.problem ? undefined : chosen);
    this.draw();
  }

  begin() {
    try {
      this.ask("start", { name: this.select.value, options: this.form.values() });
    } catch (error) {
      this.fly.refuse(error.message);
    }
  }

  ask(action, body = {}) {
    this.fly.attempt(() => request("POST", `/api/experiments/${action}`, body), `experiment: ${action}`);
  }

  draw() {
    const { status, place } = this,
      isElsewhere = Boolean(status) && (isCalibration(status.name) || this.others.includes(status.name));
    const old = this.ages.isOld("experiment_status");
    const runs = Boolean(status) && RUNNING.includes(status.phase);
    if (runs && !this.ran && !isElsewhere) place.open = true;
    this.ran = runs;
    if (place.open) this.load();
    const inTheAir = runs && status.phase !== "evaluating";
    const time = status?.planned ? `${duration(status.elapsed)} of about ${duration(status.planned)}` : "";
    setText(
      this.state,
      !status || status.phase === "idle" ? "" : `${words(status.name)} · ${words(status.phase)}`,
    );
    this.guide.draw(isElsewhere ? null : status, old);
    place.classList.toggle("old", old);
    this.start.disabled = !this.isOperator || runs || old || !this.chosen || Boolean(this.chosen.problem);
    this.finish.disabled = !this.isOperator || status?.phase !== "flying" || old;
    this.stop.disabled = !this.isOperator || !runs || old;
    this.select.disabled = runs;
    this.form.disable(runs);
    this.bar.style.width =
      runs && status.planned ? `${Math.min(100, (100 * status.elapsed) / status.planned)}%` : "0";
    setText(
      this.step,
      isElsewhere && runs
        ? "A calibration runs: see the Calibrate tab."
        : runs
          ? `${status.manual ? BY_HAND : status.step}${inTheAir && time ? ` · ${time}` : ""}`
          : this.known
            ? HELP
            : "",
    );
    const key = JSON.stringify([
      status?.phase,
      status?.run_id,
      status?.reason,
      status?.reports,
      runs,
      isElsewhere,
    ]);
    if (key !== this.drawn) {
      this.drawn = key;
      this.showResult(isElsewhere ? null : status, runs);
    }
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
      ...(status.run_id ? [element("a", { href: `/api/runs/${run}/download`, download: "" }, "Run")] : []),
    ];
    this.result.replaceChildren(
      element(
        "p",
        { className: `verdict ${status.phase}` },
        `${words(status.name)}: ${words(status.phase)}`,
        element("span", { className: "links" }, ...links),
      ),
      ...(status.reason ? [element("p", { className: "reason" }, status.reason)] : []),
      ...(judged ? [figures(status.metrics)] : []),
    );
  }
}
