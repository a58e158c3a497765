// A calibration while it runs: the guide, what it measures, and how to end it.

import { LivePlots } from "./plot.js";
import { isPose, PoseSphere, posesOf } from "./sphere.js";
import { labelOf, RUNNING } from "./labels.js";
import { Guide } from "../experiments/guide.js";
import { element, setText } from "../core/dom.js";
import { duration } from "../core/format.js";

const FORCE = ["x", "y", "z"].map((axis) => `imu.linear_acceleration.${axis}`); // at rest it points up
const UNPLOTTED = ["gyroscope", "accelerometer"]; // numbers and the sphere say more
const STEADY = 2; // m/s² from gravity, beyond which it does not say where up is

export class CalibrationRun {
  constructor({ telemetry, isOperator, ask }) {
    this.telemetry = telemetry;
    /** @type {{ done: Map<string, number[]>, next: number[] | null }} */
    this.poses = { done: new Map(), next: null };
    this.isOperator = isOperator;
    this.title = element("b");
    this.time = element("span", { className: "time" });
    this.guide = new Guide({ isOperator, ask });
    this.step = element("p", { className: "step" });
    this.sphere = new PoseSphere();
    this.plots = new LivePlots();
    this.finish = element(
      "button",
      { title: "end the experiment now and judge it", onclick: () => ask("finish") },
      "Finish",
    );
    this.stop = element(
      "button",
      {
        title:
          "end without a result: on the ground the motors stop, in the air the vehicle brakes and hovers; land it",
        onclick: () => ask("stop"),
      },
      "Stop",
    );
    this.place = element(
      "section",
      { className: "run", hidden: true },
      element("div", { className: "head" }, this.title, this.time),
      this.guide.place,
      this.step,
      this.sphere.place,
      this.plots.place,
      element("div", { className: "act" }, this.finish, this.stop),
    );
    this.title.dataset.topic = "experiment_status";
    telemetry.addEventListener("frame", ({ detail }) => {
      this.frame = detail;
    });
  }

  // Each status, also while the tab is hidden, so that the plots are whole when it is opened.
  take(status) {
    const runs = Boolean(status) && RUNNING.includes(status.phase);
    if (!runs || status.name !== this.name || status.elapsed < this.elapsed) {
      this.plots.clear();
      this.poses = { done: new Map(), next: null };
      this.name = runs ? status.name : "";
    }
    this.elapsed = runs ? status.elapsed : 0;
    if (!runs) return;
    const live = status.live.filter(({ name }) => !isPose(name));
    if (live.length && status.phase !== "evaluating") this.plots.add(status.elapsed, live);
  }

  // Nobody looks: nothing is asked for.
  rest() {
    this.want(false);
  }

  want(isWanted) {
    if (isWanted === this.wants) return;
    this.wants = isWanted;
    this.telemetry.want("calibrate", isWanted ? FORCE : []);
  }

  draw(status, isOld) {
    this.place.hidden = !status;
    this.want(status?.name === "accelerometer");
    if (!status) {
      this.guide.draw(null, isOld);
      return;
    }
    const time = status.planned
      ? `${duration(status.elapsed)} of about ${duration(status.planned)}`
      : duration(status.elapsed);
    setText(this.title, labelOf(status.name));
    setText(
      this.time,
      status.phase === "evaluating"
        ? "being judged"
        : status.phase === "finishing"
          ? `finishing · ${time}`
          : time,
    );
    this.guide.draw(status, isOld);
    setText(this.step, status.instruction || status.question ? "" : status.step); // an instruction says more
    this.finish.disabled = !this.isOperator || status.phase !== "flying" || isOld;
    this.stop.disabled = !this.isOperator || isOld;
    this.plots.place.hidden = UNPLOTTED.includes(status.name);
    if (!this.plots.place.hidden) this.plots.draw();
    this.sphere.place.hidden = status.name !== "accelerometer";
    if (status.name !== "accelerometer") return;
    const poses = posesOf(status.live);
    if (poses.done.size || poses.next) this.poses = poses; // those held stay while they are judged
    this.sphere.show(this.poses, this.up());
  }

  // Where up is in body axes by the accelerometer, while nothing else pulls at it.
  up() {
    const force = FORCE.map((name) => this.frame?.value[name] ?? NaN),
      length = Math.hypot(...force);
    return Math.abs(length - 9.81) < STEADY ? force : null;
  }
}
