// The pre-flight check list at the top of the Fly tab. The station judges it and refuses to arm by
// it; here it is shown, and read out with the Arm button. The list opens over what stands below.

import { badge, checkList } from "../core/check_list.js";
import { element, setText } from "../core/dom.js";

const STALE = 2; // s
const order = ["fail", "warn", "unknown", "ok"];

const failing = (preflight) => (preflight?.checks ?? []).filter(({ state }) => state === "fail");
const several = (number, word) => `${number} ${word}${number === 1 ? "" : "s"}`;

// What the Arm button says of the list; "" when nothing is known or all is well.
export function armNote(preflight) {
  const bad = failing(preflight);
  if (!bad.length) return "";
  const reasons = bad.map(({ name, found, advice }) => `${name} ${found}${advice ? `: ${advice}` : ""}`);
  return `not ready: ${reasons.join("; ")}`;
}

export class Preflight {
  constructor(place, button, events) {
    this.place = place;
    this.events = events;
    this.summary = element("summary");
    this.body = element("div");
    this.note = element("span", { id: "preflight-note", hidden: true });
    place.append(this.summary, this.body);
    place.after(this.note);
    button.setAttribute("aria-describedby", this.note.id);
    events.on("summary", () => this.draw());
    this.timer = setInterval(() => this.draw(), 1000);
    place.addEventListener("toggle", () => {
      this.drawn = "";
      this.draw();
    });
    this.draw();
  }

  draw() {
    const { preflight, status } = this.events.summary,
      old = !preflight || !(this.events.age("preflight") < STALE);
    const armed = Boolean(status?.armed);
    const note = armed || old ? "" : armNote(preflight);
    setText(this.note, note);
    const open = this.place.open,
      key = JSON.stringify([
        armed,
        old,
        preflight?.ready,
        preflight?.blocks,
        ...(old
          ? []
          : preflight.checks.map((one) =>
              open || one.state !== "ok" ? [one.name, one.state, one.found] : one.state,
            )),
      ]);
    if (key === this.drawn) return;
    this.drawn = key;
    if (armed) {
      // it keeps its row: what stands below must not come under the pointer
      this.head("ok", "Armed", "checked before arming");
      return;
    }
    if (old) {
      this.head("unknown", "No pre-flight checks received", "the station does not publish them");
      this.body.replaceChildren();
      return;
    }
    const checks = [...preflight.checks].sort(
      (one, other) => order.indexOf(one.state) - order.indexOf(other.state),
    );
    const bad = failing(preflight),
      warned = checks.filter(({ state }) => state === "warn");
    if (bad.length)
      this.head("fail", `Not ready: ${several(bad.length, "reason")}`, `${bad[0].name}: ${bad[0].found}`);
    else if (warned.length) this.head("warn", "Ready to arm", `${warned[0].name}: ${warned[0].found}`);
    else this.head("ok", "Ready to arm", "");
    this.body.replaceChildren(
      ...(preflight.blocks
        ? []
        : [element("p", {}, "These checks do not prevent arming (station.preflight.blocks).")]),
      ...(open ? [checkList(checks)] : []),
    );
  }

  head(state, text, first) {
    this.place.className = state;
    this.summary.replaceChildren(
      badge(state),
      element("b", {}, text),
      element("span", { className: "first" }, first),
    );
  }
}
