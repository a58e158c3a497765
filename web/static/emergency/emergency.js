// The two emergency controls, always in sight: land is pressed, cut is pressed and held; and the
// state of the last press, whoever pressed, until the vehicle has acknowledged it.

import { EmergencyPress } from "./press.js";
import { flightButton } from "../core/flight_button.js";
import { element, setIfChanged, setText } from "../core/dom.js";
import { onHold } from "../core/hold_button.js";
import { onKey } from "../core/keys.js";
import { pressed } from "../core/control_authority.js";

const CUT_HOLD = 500; // ms
const KEYS = { operator: "e: emergency land · hold x: cut", viewer: "e: emergency land" };

// place: where the buttons go; session: of /api/session. Returns {press(action)}.
export function addEmergency(place, events, session) {
  return new Emergency(place, events, session);
}

class Emergency {
  constructor(place, events, session) {
    this.events = events;
    this.mayCut = session.role !== "viewer";
    this.sent = new EmergencyPress(events, session.label);
    this.land = flightButton(
      element(
        "button",
        { id: "emergency-land", className: "caution", onclick: () => this.press("land") },
        "Emergency land",
      ),
    );
    this.cut = element(
      "button",
      {
        id: "cut",
        className: "cut hold",
        disabled: !this.mayCut,
        title: this.mayCut
          ? "emergency: stop the motors; the vehicle falls. Hold for 0.5 s (key x)"
          : "viewers may land the vehicle but not cut its motors",
      },
      "Cut motors",
    );
    onHold(this.cut, CUT_HOLD, () => this.press("cut"));
    this.said = element("span", { ariaLive: "assertive" });
    this.running = element("span", { ariaHidden: "true" });
    this.line = element("p", { id: "emergency-state", className: "idle" }, this.said, this.running);
    place.classList.add("emergency");
    place.replaceChildren(this.land, this.cut, this.line); // in place of the form that needs no script
    onKey("e", "emergency land", () => this.press("land"));
    if (this.mayCut) onKey("x", "cut the motors", () => this.press("cut"), { hold: CUT_HOLD });
    for (const type of ["emergency", "summary"]) events.on(type, () => this.draw());
    setInterval(() => this.draw(), 100);
    this.draw();
  }

  press(action) {
    this.sent.press(action);
    this.draw();
  }

  draw() {
    const { tone, said, running } = this.sent.state,
      how = pressed(this.events.summary.emergency_land);
    const rest = "Every command but Cut is refused until it is down (key e)";
    const title = `emergency: land now, overriding everything else${how && `: ${how}`}. ${rest}`;
    setIfChanged(this.land, "title", title);
    const idle = this.mayCut ? KEYS.operator : KEYS.viewer;
    setText(this.said, tone === "idle" ? "" : said);
    setText(this.running, tone === "idle" ? idle : running);
    setIfChanged(this.line, "className", tone);
    this.line.title = tone === "idle" ? "" : said + running;
  }
}
