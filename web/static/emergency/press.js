// An emergency from the press to the vehicle's acknowledgement, as this page knows it. What the
// web process says (event `emergency`) counts; until it says anything, what we did ourselves.

import { command, get } from "../core/api.js";
import { isAlone, landing } from "../core/control_authority.js";

export const NAMES = { land: "Emergency land", cut: "Cut motors" };
const DONE = { land: "landing", cut: "motors cut" };
const GIVE_UP = 3000; // ms without an answer of quadlab web; what comes later would surprise
const AGAIN = 400; // ms between tries of ours
const ASK = 300; // ms between questions while the events do not come
const LATE = 7000; // ms: the three tries of the web process take less
const UNTOLD = 12_000; // ms: web has given up by then
const OVERDUE = 1; // s until a press says what else lands
const INSTEAD = "Ctrl-C in quadlab's terminal lands, too";
const FORGET = { acknowledged: 60, failed: 300 }; // s
const FORGET_OFF = 10; // s, of a failed press when the motors are off

const newId = () =>
  [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

export class EmergencyPress {
  constructor(events, label) {
    this.events = events;
    this.label = label;
    this.own = null; // our last press, until the web process tells of it
    this.last = null; // our last press; answers to older ones are about what was
    this.reported = null; // what the web process told last, with `since` on our clock
    events.on("hello", ({ emergency }) => this.report(emergency));
    events.on("emergency", ({ press }) => this.report(press));
  }

  report(press) {
    this.reported = press ? { ...press, since: performance.now() - 1e3 * press.age } : null;
    if (press?.id === this.own?.id) this.own = null;
  }

  // Sent under one id until quadlab web has answered, for 3 s.
  async press(action) {
    const own = {
      id: newId(),
      action,
      by: this.label,
      phase: "sent",
      since: performance.now(),
      web: true,
      reason: "",
      tries: 1,
    };
    this.own = this.last = own;
    for (;;) {
      try {
        const { id } = await Promise.race([
          command("emergency", { action, request_id: own.id }),
          pause(LATE).then(() => {
            throw new Error("this page's server does not answer");
          }),
        ]);
        own.id = id; // of another's press, if ours came while that was under way
        own.phase = "accepted";
        if (this.reported?.id === id && this.own === own) this.own = null;
        if (!this.events.connected) this.ask(own);
        return;
      } catch (error) {
        const late = performance.now() - own.since > GIVE_UP;
        if (error.status !== undefined || late) {
          own.phase = "failed";
          own.reason = error.message;
          return;
        }
        own.web = false;
        await pause(AGAIN);
      }
    }
  }

  // The events do not come, but the API answers.
  async ask(own) {
    const isAsked = () => this.last === own && !this.events.connected;
    while (isAsked() && performance.now() - own.since < 15_000) {
      const summary = await get("/api/summary").catch(() => null);
      if (!isAsked()) return; // a newer press, or the events, know better by now
      if (summary?.emergency) this.report(summary.emergency);
      if (this.reported && !["sent", "accepted"].includes(this.reported.phase)) return;
      await pause(ASK);
    }
  }

  get shown() {
    const own = this.own,
      reported = this.reported;
    if (own?.phase === "accepted" && performance.now() - own.since > UNTOLD) this.own = null; // of a land under a cut
    return own && (!reported || own.since >= reported.since || own.phase === "sent") ? own : reported;
  }

  // {tone: idle, waiting, done, failed or landing, with "alone" while the microcontroller lands;
  // said: for a screen reader too; running: what counts up}
  get state() {
    const press = this.pressState,
      { status } = this.events.summary;
    const who = this.events.age("status") < 1 ? landing(status) : "";
    if (!who || !["idle", "done"].includes(press.tone)) return press;
    const tone = `${press.tone === "idle" ? "landing" : press.tone}${isAlone(status) ? " alone" : ""}`;
    return { tone, said: press.tone === "idle" ? who : `${who} · ${press.answered}`, running: "" };
  }

  get pressState() {
    const press = this.shown;
    if (!press) return { tone: "idle", said: "", running: "" };
    const age = (performance.now() - press.since) / 1e3,
      of = press.by === this.label ? "" : ` by ${press.by}`;
    const name = `${NAMES[press.action]}${of}`,
      ago = `${age.toFixed(1)} s`;
    if (age > (FORGET[press.phase] ?? Infinity)) return { tone: "idle", said: "", running: "" };
    if (press.phase === "acknowledged") {
      const note = press.reason ? `; ${press.reason}` : "",
        answered = `acknowledged after ${press.after.toFixed(2)} s${note}`;
      return {
        tone: "done",
        said: `${DONE[press.action]}${of}, ${answered}`,
        answered: `${of && `pressed${of}, `}${answered}`,
        running: "",
      };
    }
    const isSilent = this.events.age("status") > 1,
      unheard = press.web === false;
    if (press.phase === "failed") {
      const isOff = !isSilent && this.events.summary.status?.armed === false;
      if (isOff && age > FORGET_OFF) return { tone: "idle", said: "", running: "" };
      if (isOff) return { tone: "failed", said: `${name} failed: ${press.reason}.`, running: "" };
      const again = isSilent || unheard ? `Press again; ${INSTEAD}.` : "Press again.";
      return { tone: "failed", said: `${name} failed: ${press.reason}. ${again}`, running: "" };
    }
    const instead = press.phase === "sent" && age > OVERDUE ? `; ${INSTEAD}` : "";
    if (unheard && press.phase === "sent")
      return {
        tone: "waiting",
        said: `${name}: this page's server does not answer, retrying${instead}`,
        running: `, pressed ${ago} ago`,
      };
    const silent = isSilent ? "; no data from the vehicle" : "";
    const isTaken = press.action === "land" && this.events.summary.emergency_land === "emergency";
    const what =
      press.phase === "sent"
        ? "not acknowledged"
        : isTaken
          ? "accepted; the microcontroller does not fly yet"
          : "accepted, not yet shown by the vehicle";
    const tries = press.try > 1 ? `, try ${press.try} of ${press.tries}` : "";
    return {
      tone: "waiting",
      said: `${name}: ${what}${tries}${silent}${instead}`,
      running: `, sent ${ago} ago`,
    };
  }
}
