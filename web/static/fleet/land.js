// Emergency land of all vehicles: one press, and what each one made of it until it shows it.

import { request } from "../core/api.js";
import { flightButton } from "../core/flight_button.js";
import { element, setText } from "../core/dom.js";
import { onKey } from "../core/keys.js";

const FORGET = 60; // s after which an acknowledged landing is not told any more

export function addLandAll(place, { id = "land-all" } = {}) { return new LandAll(place, id); }

// What a vehicle's newest emergency came to, in a few words; "" of none. press: of web's summary.
export function landed(press) {
  if (!press || (press.phase === "acknowledged" && press.age > FORGET)) return { text: "", tone: "" };
  const name = press.action === "cut" ? "cut" : "landing";
  if (press.phase === "acknowledged") return { text: `${press.action === "cut" ? "motors cut" : "landing"} ✓ after ${press.after.toFixed(2)} s`, tone: "done" };
  if (press.phase === "failed") return { text: `⚠ ${name} failed: ${press.reason}`, tone: "failed" };
  return { text: `◌ ${name}: ${press.phase === "sent" ? "not acknowledged" : "accepted, not yet shown"}`, tone: "waiting" };
}

class LandAll {
  constructor(place, id) {
    this.vehicles = [];
    this.button = flightButton(element("button", { id, className: "caution", title: "emergency: every vehicle lands now, overriding everything else. Every command but Cut is refused until it is down (key e)", onclick: () => this.press() }, "Land all"));
    this.line = element("p", { id: "land-all-state", ariaLive: "assertive" });
    place.append(this.button, this.line);
    onKey("e", "emergency land of all vehicles", () => this.press());
  }

  async press() {
    this.since = performance.now();
    this.answers = null;
    this.problem = "";
    this.draw();
    const mine = this.since;
    try {
      const { vehicles } = await request("POST", "/api/fleet/land", {});
      if (this.since === mine) this.answers = vehicles;
    } catch (error) {
      if (this.since === mine) this.problem = error.message;
    }
    this.draw();
  }

  show(vehicles) {
    this.vehicles = vehicles;
    this.draw();
  }

  get text() {
    if (this.since === undefined) return "";
    if (this.problem) return `⚠ Land all failed: ${this.problem}. Press again.`;
    if (!this.answers) return "◌ Land all: sent, not acknowledged";
    const of = (outcome) => this.answers.filter((one) => one.outcome === outcome);
    const failed = of("failed"), sent = of("accepted").map(({ name }) => name), off = of("motors off").length;
    const shown = this.vehicles.filter(({ name, emergency }) => sent.includes(name) && emergency?.phase === "acknowledged").length;
    const parts = [];
    if (failed.length) parts.push(`⚠ ${failed.map(({ name, reason }) => `${name}: ${reason}`).join("; ")}`);
    if (sent.length) parts.push(`${shown === sent.length ? "✓ " : "◌ "}${shown} of ${sent.length} landing`);
    if (off) parts.push(`${off} with motors off`);
    return parts.join(" · ");
  }

  draw() {
    const text = this.text;
    setText(this.line, text);
    this.line.className = text.startsWith("⚠") ? "failed" : text.startsWith("◌") ? "waiting" : "done";
    this.line.title = text;
  }
}
