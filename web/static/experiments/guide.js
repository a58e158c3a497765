// What an experiment tells the person beside the vehicle: which step, what to do, live figures, and
// a question that waits for a yes. The yes is held, not clicked: motors may turn after it.

import { figure, RUNNING } from "../calibrate/labels.js";
import { element, hide, setText } from "../core/dom.js";
import { onHold } from "../core/hold_button.js";
import { isPose } from "../calibrate/sphere.js";

const JUDGED = "Nothing to do now: the recording is being judged.";
const SPREAD = " deviation";

export class Guide {
  // ask(action, body): to the station, as somebody who may.
  constructor({ isOperator, ask }) {
    this.isOperator = isOperator;
    this.number = element("p", { className: "number" });
    this.instruction = element("p", { className: "instruction", role: "status" });
    this.bar = element("i");
    this.progress = element(
      "div",
      {
        className: "progress",
        role: "progressbar",
        ariaLabel: "progress of all steps",
        ariaValueMin: "0",
        ariaValueMax: "100",
      },
      this.bar,
    );
    this.text = element("p");
    this.yes = element(
      "button",
      { className: "hold caution", title: "hold for 0.8 s to continue; motors may spin" },
      "Yes",
    );
    this.question = element("div", { className: "question", role: "alert" }, this.text, this.yes);
    this.live = element("dl", { className: "live" });
    this.place = element(
      "div",
      { className: "guide", hidden: true },
      this.number,
      this.progress,
      this.instruction,
      this.question,
      this.live,
    );
    this.cells = new Map();
    onHold(
      this.yes,
      800,
      (question) => ask("confirm", { question }),
      () => this.asked,
    );
  }

  // status: of the summary; isOld: nobody has told it for a while.
  draw(status, isOld) {
    const runs = Boolean(status) && RUNNING.includes(status.phase);
    const {
      instruction = "",
      question = "",
      step_count: count = 0,
      step_number: number = 0,
      step_share: share = 0,
      live = [],
    } = runs ? status : {};
    hide(this.place, !runs || !(instruction || question || count || live.length));
    if (this.place.hidden) {
      this.asked = "";
      return;
    }
    this.place.classList.toggle("old", isOld);
    setText(this.number, count ? `Step ${number} of ${count}` : "");
    setText(this.instruction, status.phase === "evaluating" ? JUDGED : instruction);
    hide(this.progress, !count);
    const all = count ? Math.min(1, Math.max(0, (number - 1 + share) / count)) : 0;
    this.bar.style.width = `${(100 * all).toFixed(1)}%`;
    this.progress.ariaValueNow = String(Math.round(100 * all));
    this.asked = question;
    hide(this.question, !question);
    setText(this.text, question);
    this.yes.disabled = !this.isOperator || isOld;
    this.drawLive(live.filter(({ name }) => !isPose(name)));
  }

  // A figure's standard deviation stands behind it.
  drawLive(all) {
    const live = all.filter(
      ({ name }) => !name.endsWith(SPREAD) || !all.some((one) => name === one.name + SPREAD),
    );
    const names = live.map(({ name, unit }) => `${name} ${unit}`).join("|");
    if (names !== this.names) {
      this.names = names;
      this.cells = new Map(live.map(({ name }) => [name, element("output")]));
      this.live.replaceChildren(
        ...live.map(({ name, unit }) =>
          element(
            "div",
            {},
            element("dt", {}, name),
            element("dd", {}, this.cells.get(name), unit ? ` ${unit}` : ""),
          ),
        ),
      );
    }
    for (const { name, value } of live) {
      const spread = all.find((one) => one.name === name + SPREAD)?.value;
      setText(
        this.cells.get(name),
        spread === undefined
          ? figure(value)
          : `${figure(value)} ± ${spread === null ? "?" : Number(spread.toPrecision(2))}`,
      );
    }
  }
}
