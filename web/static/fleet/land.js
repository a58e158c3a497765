// All vehicles down: by a landing of each, or by emergency; and what each one made of it until it shows it.

import { request } from "../core/api.js";
import { flightButton } from "../core/flight_button.js";
import { element, setText } from "../core/dom.js";
import { onHold } from "../core/hold_button.js";
import { onKey } from "../core/keys.js";

const HOLD = 500; // ms
const FORGET = 60; // s after which an acknowledged landing is not told any more

// What a vehicle's newest emergency came to, in a few words; "" of none. press: of web's summary.
export function landed(press) {
  if (!press || (press.phase === "acknowledged" && press.age > FORGET)) return { text: "", tone: "" };
  const name = press.action === "cut" ? "cut" : "landing";
  if (press.phase === "acknowledged")
    return {
      text: `${press.action === "cut" ? "motors cut" : "landing"} ✓ after ${press.after.toFixed(2)} s`,
      tone: "done",
    };
  if (press.phase === "failed") return { text: `⚠ ${name} failed: ${press.reason}`, tone: "failed" };
  return {
    text: `◌ ${name}: ${press.phase === "sent" ? "not acknowledged" : "accepted, not yet shown"}`,
    tone: "waiting",
  };
}

export class LandAll {
  constructor(place, isOperator) {
    this.vehicles = [];
    this.calm = flightButton(
      element(
        "button",
        {
          id: "land-all",
          disabled: !isOperator,
          title: isOperator
            ? "each vehicle in the air lands where it is"
            : "viewers cannot do this; ask an operator",
          onclick: () => this.land(),
        },
        "Land all",
      ),
    );
    this.button = flightButton(
      element(
        "button",
        {
          id: "emergency-land-all",
          className: "caution",
          title:
            "emergency: every vehicle lands now, overriding everything else. Every command but Cut " +
            "is refused until it is down (hold, or key e)",
        },
        "Emergency land all",
      ),
    );
    onHold(this.button, HOLD, () => this.press());
    this.line = element("p", { id: "land-all-state", ariaLive: "assertive" });
    place.append(this.button, this.calm, this.line);
    onKey("e", "emergency land of all vehicles", () => this.press());
  }

  // As the button Land of each vehicle's page.
  async land() {
    const flying = this.vehicles.filter(({ airborne }) => airborne);
    this.since = undefined;
    this.calmly = flying.length ? "◌ Land all: sent" : "no vehicle is in the air";
    this.draw();
    const answers = await Promise.all(
      flying.map(({ name }) =>
        request("POST", `/v/${name}/api/commands/start_behavior`, { name: "land", arguments: {} }).then(
          () => "",
          ({ message }) => `${name}: ${message}`,
        ),
      ),
    );
    const refused = answers.filter(Boolean);
    if (flying.length)
      this.calmly = refused.length
        ? `⚠ ${refused.join("; ")}`
        : `✓ ${flying.map(({ name }) => name).join(", ")} landing`;
    this.draw();
  }

  async press() {
    this.calmly = "";
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
    if (this.since === undefined) return this.calmly ?? "";
    if (this.problem) return `⚠ Emergency land all failed: ${this.problem}. Press again.`;
    if (!this.answers) return "◌ Emergency land all: sent, not acknowledged";
    const of = (outcome) => this.answers.filter((one) => one.outcome === outcome);
    const failed = of("failed"),
      sent = of("accepted").map(({ name }) => name),
      off = of("motors off").length;
    const shown = this.vehicles.filter(
      ({ name, emergency }) => sent.includes(name) && emergency?.phase === "acknowledged",
    ).length;
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
