// How a run compares with what the vehicle itself logged, and filling its holes from there.

import { request } from "../core/api.js";
import { element } from "../core/dom.js";
import { bytes } from "../core/format.js";

export const ENDED = ["done", "incomplete", "failed", "cancelled"];
const DOES = { waiting: "Waiting", fetching: "Fetching", checking: "Comparing", merging: "Merging" };

// One line and a share of 0 to 1 (null: not known) of a quadlab_msgs/Transfer.
export function standing({ phase, bytes: came, total_bytes: total, rate, problem }) {
  const share = total && phase === "fetching" ? came / total : null;
  if (ENDED.includes(phase))
    return [problem || { done: "Done", cancelled: "Cancelled" }[phase] || phase, null];
  const amount =
    share === null ? "" : ` ${bytes(came)} of ${bytes(total)}${rate > 0 ? `, ${bytes(rate)}/s` : ""}`;
  return [`${DOES[phase] ?? phase}${amount}${problem ? `: ${problem}` : ""}`, share];
}

// A bar that stays while its value changes.
export class Progress {
  constructor(label) {
    this.bar = element("progress", { max: 1, ariaLabel: label });
    this.text = element("span", { className: "dim" });
    this.place = element("div", { className: "fetching" }, this.text, this.bar);
  }

  show(transfer) {
    const [text, share] = standing(transfer);
    this.text.textContent = text;
    this.text.classList.toggle("warn", Boolean(transfer.problem));
    this.bar.hidden = ENDED.includes(transfer.phase);
    if (share === null) this.bar.removeAttribute("value");
    else this.bar.value = share;
  }
}

export class RunFill {
  // page: isOperator, attempt(act).
  constructor(page, events) {
    this.page = page;
    this.line = element("p", { className: "ticks" });
    this.fill = element(
      "button",
      {
        className: "link",
        title: "compare with the vehicle's own log and fetch what is missing",
        onclick: () => this.ask(""),
      },
      "Check against onboard log",
    );
    this.cancel = element("button", { className: "link", onclick: () => this.ask("/cancel") }, "Cancel");
    this.progress = new Progress("filling the run");
    this.place = element(
      "section",
      { className: "fill", ariaLabel: "the vehicle's own log" },
      this.line,
      this.progress.place,
      element("span", {}, this.fill, this.cancel),
    );
    events.on("summary", ({ transfers }) => {
      if (transfers) {
        this.transfers = transfers;
        this.draw();
      }
    });
    this.transfers = events.summary.transfers ?? [];
  }

  show(run) {
    this.run = run;
    this.draw();
  }

  draw() {
    const { run } = this;
    this.place.hidden = !run || run.recording;
    if (this.place.hidden) return;
    const transfer = this.transfers.find(({ kind, name }) => kind === "backfill" && name === run.id);
    const isUnderWay = Boolean(transfer) && !ENDED.includes(transfer.phase);
    const { line = "not compared with the vehicle's own log", state = "" } = run.completeness ?? {};
    this.line.textContent = `${line[0].toUpperCase()}${line.slice(1)}.`;
    this.line.classList.toggle("warn", state === "missing");
    this.progress.place.hidden = !isUnderWay;
    if (isUnderWay) this.progress.show(transfer);
    this.cancel.hidden = !isUnderWay || !this.page.isOperator;
    this.fill.hidden = isUnderWay || !this.page.isOperator || !run.complete;
  }

  ask(what) {
    const { id } = this.run;
    this.page.attempt(() => request("POST", `/api/runs/${encodeURIComponent(id)}/backfill${what}`));
  }
}
