// Which runs are shown, and how the second lies against the first: a moment of each, and a hand's
// width beside it.

import { element } from "/static/core/dom.js";
import { stamp } from "./play_head.js";

const BEST = ["take_off", "arming", "start"];

// Event `shift`: the second run's shift is another.
export class Alignment extends EventTarget {
  /** @type {any} */ offset;

  constructor(place, runs, choices, choose) {
    super();
    this.runs = runs;
    this.hand = 0; // s the second run was moved to the right by hand
    const [lead, other] = runs;
    const second = element(
      "select",
      { ariaLabel: "second run, laid over the first", onchange: () => choose(second.value) },
      element("option", { value: "" }, "Compare with: none"),
      ...choices.map((id) => element("option", { value: id, selected: id === other?.id }, id)),
    );
    place.append(element("b", {}, lead.id));
    if (other || choices.length) place.append(second);
    if (!other) return;
    const kind = BEST.find((one) => runs.every((run) => moment(run, one) !== undefined));
    this.selects = runs.map((run, k) =>
      element(
        "select",
        { ariaLabel: `moment of the ${k ? "second" : "first"} run`, onchange: () => this.update() },
        ...run.description.moments.map((one) =>
          element(
            "option",
            { value: one.label, selected: one === moment(run, kind) },
            `${one.label}, ${stamp(one.t, 1)}`,
          ),
        ),
      ),
    );
    this.offset = element("input", {
      type: "number",
      step: "0.01",
      value: "0",
      ariaLabel: "second run shifted by hand, s",
      onchange: () => {
        this.hand = Number(this.offset.value) || 0;
        this.update();
      },
    });
    place.append(
      element("span", { className: "note" }, "aligned at"),
      this.selects[0],
      element("span", { className: "note" }, "="),
      this.selects[1],
      element("label", { className: "note" }, "shifted by ", this.offset, " s"),
    );
    this.update();
  }

  // By labels and seconds, of a link.
  restore(first, second, hand) {
    if (!this.selects) return;
    [first, second].forEach((label, k) => {
      if ([...this.selects[k].options].some((one) => one.value === label)) this.selects[k].value = label;
    });
    this.move(hand - this.hand);
  }

  get labels() {
    return this.selects?.map((select) => select.value) ?? null;
  }

  move(seconds) {
    this.hand += seconds;
    this.offset.value = this.hand.toFixed(2);
    this.update();
  }

  update() {
    const [at, other] = this.runs.map(
      (run, k) => run.description.moments.find((one) => one.label === this.selects[k].value)?.t ?? 0,
    );
    this.runs[1].shift = other - at - this.hand;
    this.dispatchEvent(new Event("shift"));
  }
}

const moment = (run, kind) => run.description.moments.find((one) => one.kind === kind);
