// What stands in place of the tree when asked for: history, presets, files, and comparisons.

import { get } from "../core/api.js";
import { $, element } from "../core/dom.js";
import { timeOf } from "../core/format.js";
import { Diff } from "./diff.js";
import { Files } from "./files.js";
import { Presets } from "./presets.js";
import { TimeLine } from "./timeline.js";

const VIEWS = [
  ["timeline", "History", "every change: who, when, old and new value; each can be restored"],
  ["presets", "Presets", "named sets of values"],
  ["flight", "Changes since take-off", "back to the values at the start of this flight, or of the last one"],
  ["files", "File", "save and load values"],
];

const BRIEF = ["flight", "again"]; // shown once, without a list to go back to

export class ParameterPanel {
  // instead: the places that are hidden while something is shown here.
  constructor(gains, place, instead) {
    this.gains = gains;
    this.place = place;
    this.instead = instead;
    this.buttons = new Map(
      VIEWS.map(([view, label, title]) => [
        view,
        element("button", { title, ariaPressed: "false", onclick: () => this.toggle(view) }, label),
      ]),
    );
    $("parameter-views").append(...this.buttons.values());
    document.addEventListener("again", (/** @type {any} */ { detail }) => this.again(detail));
  }

  toggle(view) {
    if (this.view === view) this.close();
    else this.open(view);
  }

  open(view) {
    this.clear();
    this.view = view;
    if (view === "timeline") {
      this.line = new TimeLine(this.gains, this.place);
      this.line.start();
    }
    if (view === "presets") new Presets(this.gains, this.place, (options) => this.show(options));
    if (view === "files") new Files(this.gains, this.place, (options) => this.show(options));
    if (view === "flight") this.flight();
    this.draw();
  }

  close() {
    this.clear();
    this.view = null;
    this.draw();
  }

  clear() {
    this.line?.stop();
    this.diff?.stop();
    this.line = this.diff = null;
    this.place.replaceChildren();
  }

  draw() {
    for (const [view, button] of this.buttons)
      button.setAttribute("aria-pressed", String(view === this.view));
    this.place.hidden = !this.view;
    for (const place of this.instead) place.hidden = Boolean(this.view);
    this.place.closest(".tab").scrollTop = 0;
  }

  show(options) {
    const { view } = this;
    this.clear();
    const back = element(
      "button",
      { onclick: () => (BRIEF.includes(view) ? this.close() : this.open(view)) },
      "Back",
    );
    this.diff = new Diff(this.gains, {
      done: (applied) => this.applied(view, Object.keys(applied).length),
      ...options,
    });
    this.place.append(back, this.diff.place);
  }

  applied(view, count) {
    if (BRIEF.includes(view)) this.close();
    else this.open(view);
    this.place.prepend(
      element(
        "div",
        { className: "answer applied", role: "status" },
        `Applied ${count} ${count === 1 ? "value" : "values"}.`,
      ),
    );
  }

  // The settings of a run; its experiment is prepared on the Fly tab.
  again({ run, problem, experiment, lines, same }) {
    this.clear();
    this.view = "again";
    this.draw();
    if (problem) {
      const close = element("button", { onclick: () => this.close() }, "Back");
      this.place.append(close, element("div", { className: "reason", role: "status" }, problem));
      return;
    }
    const then = experiment ? " Its experiment is ready on the Fly tab." : "";
    this.show({
      title: `Fly ${run} again`,
      note: `Gains, estimator, behaviors and beacons as they were at its start.${then}`,
      empty: "All of them are as they were.",
      lines,
      same,
    });
  }

  async flight() {
    try {
      const flight = await get("/api/parameters/flight");
      if (this.view !== "flight") return; // another was pressed meanwhile
      const began = flight.start === null ? "" : timeOf(flight.start);
      this.show({
        title: flight.is_over ? "Back to before the last flight" : "Back to before this flight",
        note: began && `It began at ${began}. Beacons stay where they are.`,
        empty:
          flight.start === null
            ? "The vehicle has not been armed yet."
            : "All parameters are as they were at take-off.",
        ...flight,
      });
    } catch (error) {
      this.place.replaceChildren(element("div", { className: "reason", role: "status" }, error.message));
    }
  }
}
