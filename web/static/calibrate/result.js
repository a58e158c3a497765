// How a calibration ended: what it proposes beside what was, and accept, reject or repeat.

import { get } from "../core/api.js";
import { recordView } from "./record.js";
import { labelOf } from "./labels.js";
import { isThere } from "../core/vehicle_path.js";
import { element } from "../core/dom.js";
import { words } from "../core/format.js";
import { onHold } from "../core/hold_button.js";
import { RunReport } from "../runs/report.js";

const SAID = {
  accepted: "✓ Accepted. It is in force, and kept by the vehicle with its history.",
  rejected: "Rejected. Nothing was changed.",
  "": "Nothing is changed until it is accepted.",
};
// Without values, as the gyroscope's drift: the vehicle uses it from the moment it found it.
const IN_USE = {
  accepted: "✓ Accepted. It is in use, and kept by the vehicle with its history.",
  rejected: "Rejected. It is not kept; the vehicle uses it until its next start.",
  "": "The vehicle uses it already; accepted, it is kept with its history.",
};

export class CalibrationResult {
  constructor({ gains, isOperator, ask, repeat, closed }) {
    this.gains = gains;
    this.isOperator = isOperator;
    this.title = element("b");
    this.close = element(
      "button",
      {
        className: "link",
        onclick: () => {
          this.away = this.id;
          closed();
        },
      },
      "Close",
    );
    this.reason = element("p", { className: "reason" });
    this.said = element("p", { className: "said", role: "status" });
    this.content = element("div");
    this.accept = element("button", { onclick: () => ask("accept") }, "Accept");
    this.reject = element(
      "button",
      { title: "discard the result; nothing changes", onclick: () => ask("reject") },
      "Reject",
    );
    this.repeat = element("button", { className: "hold" }, "Repeat");
    onHold(this.repeat, 800, repeat);
    this.report = new RunReport(isOperator);
    this.links = element("span", { className: "links" });
    this.place = element(
      "section",
      { className: "outcome", hidden: true },
      element("div", { className: "head" }, this.title, this.links, this.close),
      this.reason,
      this.said,
      element("div", { className: "act" }, this.accept, this.reject, this.repeat),
      this.content,
      this.report.place,
    );
    this.drawn = "";
    this.was = new Map(); // the vehicle's values when the result came
    gains.addEventListener("read", () => {
      this.was.clear();
      this.drawn = "";
    });
    this.away = undefined; // what was closed, or was decided before this page came
  }

  // status: of a calibration that ended, or null; blockedReason: why none can be repeated now.
  draw(status, proposal, { isOld, history, options, blockedReason }) {
    const hasEnded = Boolean(status) && status.phase !== "idle";
    this.id = hasEnded ? `${status.name} ${status.run_id} ${status.elapsed}` : "";
    if (hasEnded && this.away === undefined) this.away = status.decision ? this.id : "";
    else if (this.away === undefined && status) this.away = "";
    this.place.hidden = !hasEnded || this.id === this.away;
    if (this.place.hidden) return;
    const { decision } = status,
      record = proposal?.problem ? null : proposal,
      isOpen = Boolean(record) && !decision;
    this.place.classList.toggle("old", isOld);
    for (const button of [this.accept, this.reject]) {
      button.hidden = !isOpen;
      button.disabled = !this.isOperator || isOld;
    }
    this.accept.title = isOld
      ? "no recent data from the station"
      : record && !record.good
        ? "a figure is beyond its limit; the vehicle applies the values anyway"
        : "the vehicle applies all values or none";
    this.accept.classList.toggle("caution", Boolean(record) && !record.good);
    this.accept.textContent = record && !record.good ? "Accept anyway" : "Accept";
    this.repeat.disabled = Boolean(blockedReason);
    this.repeat.title = blockedReason || "hold for 0.8 s: run it again with the options below";
    const kept =
      decision === "accepted" && record
        ? history?.find((one) => one.name === record.name && one.run_id === status.run_id)
        : null;
    const before = record && history?.find((one) => one.name === record.name && one !== kept);
    const key = JSON.stringify([
      this.id,
      decision,
      status.phase,
      status.reason,
      kept?.stamp_ns,
      before?.stamp_ns,
      Boolean(record),
    ]);
    if (key === this.drawn) return;
    const isNew = this.id !== this.shown;
    this.drawn = key;
    this.shown = this.id;
    if (isNew) this.was.clear();
    if (isNew) this.report.show(status.run_id ? { id: status.run_id } : null);
    this.title.textContent = `${labelOf(status.name)}: ${words(status.phase)}`;
    this.title.className = `verdict ${status.phase}`;
    this.reason.textContent = proposal?.problem
      ? `The result cannot be used: ${proposal.problem}`
      : status.reason || (!record && status.phase === "passed" ? "It proposes nothing." : "");
    const said = record && !Object.keys(record.values).length ? IN_USE : SAID;
    this.said.textContent = !record
      ? "The previous calibration stays in force."
      : !decision && !this.isOperator
        ? "An operator accepts or rejects it."
        : said[decision];
    const run = encodeURIComponent(status.run_id);
    this.links.replaceChildren(
      ...(status.run_id
        ? [
            element("a", { href: `/report/${run}`, target: "_blank" }, "Report"),
            ...(isThere("replay") ? [element("a", { href: `/replay/${run}` }, "Replay")] : []),
          ]
        : []),
    );
    this.content.replaceChildren(
      ...(record
        ? [
            recordView(kept ?? record, {
              gains: { rows: this.gains.rows, value: (name) => this.valueBefore(name) },
              before,
              isKept: Boolean(kept),
            }),
          ]
        : []),
    );
    if (isNew && status.run_id && status.metrics.length)
      get(`/api/runs/${run}/report`).then(
        (report) => options(report.options),
        () => undefined,
      ); // a run that was not judged has none
  }

  valueBefore(name) {
    if (!this.was.has(name)) this.was.set(name, this.gains.value(name));
    return this.was.get(name);
  }
}
