// Where a recorded flight says that the beacons are: asked for, judged, accepted or rejected.

import { get, request } from "../core/api.js";
import { attempt, element, hide, optionsOf, setText, showNote, tableHead } from "../core/dom.js";

const POLL = 1000; // ms, while a survey is under way
const NEWEST = 20; // runs to choose from
const SAID = {
  "": "Nothing is changed until it is accepted.",
  accepted: "✓ Accepted. It is the layout in use.",
  rejected: "Rejected. Nothing was changed.",
};

export class Survey {
  /** @type {any} */
  timer;

  constructor(place, isOperator) {
    this.isOperator = isOperator;
    this.locked = "";
    this.run = element("select", { ariaLabel: "flight to survey", disabled: !isOperator });
    this.begin = element(
      "button",
      {
        disabled: true,
        title: "replays the flight several hundred times, which takes minutes; changes nothing",
        onclick: () => this.ask("", { run_id: this.run.value }),
      },
      "Survey",
    );
    this.accept = element("button", { disabled: true, onclick: () => this.ask("/accept") }, "Accept");
    this.reject = element(
      "button",
      { disabled: true, title: "discard the result; nothing changes", onclick: () => this.ask("/reject") },
      "Reject",
    );
    this.said = element("p", { className: "said", role: "status", hidden: true });
    this.reason = element("div", { className: "reason", role: "alert", hidden: true });
    this.body = element("tbody");
    this.table = element(
      "table",
      { className: "layout surveyed", hidden: true },
      tableHead("id", "x [m]", "y [m]", "z [m]", "moved [mm]", "± [mm]"),
      this.body,
    );
    this.left = element("p", { className: "empty", hidden: true });
    this.acts = element("div", { className: "line", hidden: true }, element("i"), this.reject, this.accept);
    place.append(
      element("h2", {}, "Survey from a flight"),
      element("div", { className: "line" }, element("label", {}, "Run", this.run), this.begin),
      this.said,
      this.reason,
      this.table,
      this.left,
      this.acts,
    );
  }

  // While the tab is open; both may have changed meanwhile.
  async load() {
    const [runs, state] = await Promise.all([
      get("/api/runs").catch(() => []),
      get("/api/beacons/survey").catch(() => null),
    ]);
    const ids = (Array.isArray(runs) ? runs : (runs.runs ?? [])).map(({ id }) => id).slice(0, NEWEST),
      chosen = this.run.value;
    this.run.replaceChildren(...optionsOf(ids));
    if (ids.includes(chosen)) this.run.value = chosen;
    if (state) this.show(state);
  }

  // reason: why the layout cannot change now; "" when it can
  lock(reason) {
    this.locked = reason;
    this.accept.disabled = !this.isOperator || Boolean(reason);
    this.accept.title = reason || "station and vehicle check the layout";
  }

  hide() {
    clearTimeout(this.timer);
  }

  async ask(action, body = {}) {
    await attempt(this.reason, async () => {
      this.show(await request("POST", `/api/beacons/survey${action}`, body));
    });
  }

  async poll() {
    const state = await get("/api/beacons/survey").catch(() => null);
    if (state) this.show(state);
    else this.again();
  }

  again() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.poll(), POLL);
  }

  show({ state, progress, reason, run_id: run, decision, proposal }) {
    const isUnderWay = state === "waiting" || state === "working";
    const words = isUnderWay
      ? `Surveying ${run}: ${Math.round(100 * progress)} %`
      : proposal
        ? `${run}: ${SAID[decision]}`
        : "";
    showNote(this.said, words);
    showNote(this.reason, state === "failed" ? `${run}: ${reason}` : "");
    this.begin.disabled = !this.isOperator || isUnderWay || !this.run.options.length;
    this.reject.disabled = !this.isOperator;
    this.lock(this.locked);
    for (const one of [this.table, this.left]) hide(one, !proposal);
    hide(this.acts, !proposal || Boolean(decision));
    if (proposal) {
      setText(
        this.left,
        `Residual of the bearings: ${proposal.before.toFixed(2)} mrad rms with the flight's layout, ` +
          `${proposal.after.toFixed(2)} mrad with this one.`,
      );
      this.body.replaceChildren(
        ...proposal.beacons.map(({ id, position, moved, deviation }) =>
          element(
            "tr",
            {},
            ...[
              String(id),
              ...position.map((metres) => metres.toFixed(3)),
              moved.map((one) => one.toFixed(0)).join(", "),
              deviation === null ? "–" : deviation.toFixed(0),
            ].map((text) => element("td", {}, text)),
          ),
        ),
      );
    }
    if (isUnderWay) this.again();
  }
}
