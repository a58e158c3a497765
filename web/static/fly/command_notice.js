// What became of this page's last command. While its answer is late it is pending; then it is done,
// refused, or not known, by its answer and by what the vehicle shows. A notice goes when it is no
// longer true: with the next command, when the vehicle's state is another, when it is ready to arm
// again, or after a while.

import { element, setText } from "../core/dom.js";
import { icon } from "../icons/icons.js";
import { reasonOf, seconds, words } from "../core/format.js";

const SOON = 400; // ms without an answer, after which it is told how long
const UNKNOWN = 10_000; // ms from the press: what is not shown by then is not known
const GOOD = 4000,
  BAD = 60_000; // ms a notice stays at most
const READ = 3000; // ms bad news stays at least
const TICK = 100; // ms
// What has happened when the answer comes.
/** @type {Record<string, string>} */
const DONE = { arm: "Armed", disarm: "Disarmed", "Experiment start": "Experiment started" };
const NOBODY = 503,
  NO_ANSWER = 504; // statuses of the API

// Whether an error leaves it open what became of a command.
const isOpen = ({ status }) => status === undefined || status === NO_ANSWER;

export class CommandNotice {
  began;

  constructor(place, events) {
    this.place = place;
    this.events = events;
    this.text = element("span", { className: "said" });
    this.since = element("span", { className: "running", ariaHidden: "true" });
    place.append(
      this.text,
      this.since,
      element(
        "button",
        { className: "small", ariaLabel: "dismiss", onclick: () => this.clear() },
        icon("close"),
      ),
    );
    this.asked = null; // {label, shows, pressed, before} of a command without an answer
    this.clear();
    setInterval(() => this.draw(), TICK);
  }

  /**
   * Runs act() and says what became of it. shows(status): whether the vehicle shows it done; null
   * where it cannot be seen. Returns whether it was accepted.
   * @param {((status: any) => boolean) | null} shows
   */
  async run(label, act, shows = null) {
    this.clear();
    const status = this.status; // without it, what the vehicle shows later may have been so before
    const asked = (this.asked = {
      label,
      shows: !status || shows?.(status) ? null : shows,
      pressed: performance.now(),
      problem: "",
    });
    this.show(`${label || "Command"}: sent`, "pending", Infinity); // at once: the press was heard
    try {
      await act();
    } catch (error) {
      if (this.asked !== asked) return false; // shown by the vehicle meanwhile, or a newer command
      if (isOpen(error) && asked.shows) asked.problem = error.message;
      else if (isOpen(error) && shows) this.unknown(label);
      else
        this.refuse(label ? `${label}: ${reasonOf(error.message)}` : error.message, error.status === NOBODY);
      this.isArming = label === "arm";
      return false;
    }
    if (this.asked === asked) {
      if (label) this.say(DONE[label] ?? `${label}: accepted`);
      else this.clear();
      this.asked = null;
    }
    return true;
  }

  // Good news; content of elements stays until the next notice.
  say(content) {
    this.show(content, "good", typeof content === "string" ? GOOD : Infinity);
  }

  // isStation: the station was not reached; true only while it is not heard.
  refuse(content, isStation = false) {
    this.asked = null;
    this.show(content, "bad", BAD);
    this.isStation = isStation;
    this.state = this.stateKey();
  }

  clear() {
    this.asked = null;
    this.place.hidden = true;
  }

  show(content, tone, stays) {
    this.place.className = tone;
    this.place.hidden = false;
    this.text.replaceChildren(content);
    this.place.title = this.text.textContent;
    this.since.textContent = "";
    this.tone = tone;
    this.began = performance.now();
    this.ends = this.began + stays;
    this.state = undefined;
    this.isStation = this.isArming = this.wasUnready = false;
    this.unheard = ""; // label of a command that is open while the vehicle is not heard
  }

  // The newest status, if it came after the press.
  get status() {
    return this.events.age("status") < 1 ? this.events.summary.status : null;
  }
  stateKey() {
    const status = this.status;
    return status && JSON.stringify([status.mode, status.behavior, status.airborne]);
  }

  draw() {
    if (this.asked) this.reconcile(this.asked);
    else if (!this.place.hidden && this.isOver()) this.clear();
  }

  isOver() {
    const shown = performance.now() - this.began;
    const isReady = this.events.summary.preflight?.ready;
    this.wasUnready ||= isReady === false;
    if (performance.now() > this.ends) return true;
    if (this.tone !== "bad" || shown < READ) return false;
    if (this.isStation) return 1e3 * this.events.age("station_status") < shown - READ / 2; // heard again
    if (this.isArming && this.wasUnready && isReady) return true;
    const now = this.stateKey();
    if (now && this.unheard) this.unknown(this.unheard); // now it is, and shows something
    return Boolean(this.state) && Boolean(now) && now !== this.state;
  }

  unknown(label) {
    const { status } = this,
      shown = status
        ? `The vehicle shows ${words(status.mode)}, ${words(status.behavior)}.`
        : "No data from the vehicle.";
    this.asked = null;
    this.show(`${label}: not known whether it was carried out. ${shown}`, "bad", BAD);
    this.state = this.stateKey();
    this.unheard = status ? "" : label;
  }

  reconcile(asked) {
    const { label, shows, pressed, problem } = asked,
      waited = performance.now() - pressed,
      status = this.status;
    const isNewer = status !== null && 1e3 * this.events.age("status") < waited;
    if (isNewer && shows?.(status)) {
      this.asked = null;
      this.say(`${label}: done${problem ? "; its answer was lost" : ", shown by the vehicle"}`);
    } else if (waited > UNKNOWN && problem) {
      this.unknown(label);
    } else if (waited > SOON) {
      const ago = `, no answer yet, ${seconds(Math.round(waited / 100) / 10)}`;
      setText(this.since, ago);
    }
  }
}
