// The sticks on the Fly tab: where they are (ring: the stick, dot: what is sent), whether they
// move the vehicle and if not why, how fast full stick is, and the round trip to the station.

import { flightButton } from "../core/flight_button.js";
import { $, element, hide, setIfChanged, setText } from "../core/dom.js";
import { fixed, words } from "../core/format.js";
import { StickEditor } from "./editor.js";
import { presetOf } from "./mapping.js";
import { OBEYING, commanded, limits } from "./meaning.js";
import { Sticks } from "./sticks.js";
import { TouchPads } from "./touch.js";
import { landing } from "../core/control_authority.js";

const REACH = 15; // px from the centre of a pad to full stick
const KEYS = {
  velocity: "Hold Shift: W A S D move, arrows up, down and turn. On a pad hold a shoulder button.",
  near_hovering: "Hold Shift: W A S D tilt, arrows up, down and turn. On a pad hold a shoulder button.",
};
const STALE = 1; // s
const OTHERS = "someone else has control"; // as web and station say it
const IDLE = 10; // ticks of the clock

export function addSticks(place, { events, isOperator, fly, emergency, gains, label }) {
  if (!isOperator) {
    place.append(element("p", { className: "note" }, "Viewers cannot use the sticks."));
    return null;
  }
  return new StickPanel(place, events, fly, emergency, gains, label);
}

class StickPanel {
  constructor(place, events, fly, emergency, gains, label) {
    this.place = place;
    this.events = events;
    this.fly = fly;
    this.label = label;
    this.limit = (name) => gains.value(`behavior.${name}`);
    this.sticks = new Sticks(emergency);
    this.editor = new StickEditor($("view"), this.sticks);
    this.pads = ["up and turn", "forward and left"].map((title) => {
      const ring = element("i", { className: "ring" }),
        dot = element("i", { className: "dot" });
      return {
        ring,
        dot,
        box: element(
          "span",
          { className: "pad", title: `${title}; ring: the stick, dot: what is sent` },
          ring,
          dot,
        ),
      };
    });
    this.note = element("p", { className: "note", ariaLive: "polite" });
    this.limits = element("p", { className: "limits" });
    this.source = element("span", { className: "source" });
    this.trip = element("output", {
      className: "trip",
      title: "from this page to the station and back: median, and the time 95 % stay below",
    });
    this.velocity = flightButton(
      element(
        "button",
        {
          title: "start the behavior velocity: the sticks command the velocity while their button is held",
          onclick: () => fly.start("velocity"),
        },
        "Velocity",
      ),
    );
    this.said = element("p");
    this.begin = flightButton(
      element(
        "button",
        {
          title: "the pads command the velocity while a finger is on them",
          onclick: () => fly.start("velocity"),
        },
        "Velocity",
      ),
    );
    this.touch = new TouchPads(this.sticks.touch, [this.said, this.begin]);
    const open = element(
      "button",
      { className: "link", hidden: !navigator.maxTouchPoints, onclick: () => this.touch.open(true) },
      "Touch sticks",
    );
    this.setUp = element(
      "button",
      {
        className: "link",
        title: "assign the gamepad's sticks and buttons",
        onclick: () => this.editor.toggle(),
      },
      "Set up pad",
    );
    place.append(
      element("span", { className: "pads", ariaHidden: "true" }, ...this.pads.map(({ box }) => box)),
      element("div", { className: "words" }, this.note, this.limits),
      this.velocity,
      element("div", { className: "foot" }, this.source, this.trip, open, this.setUp),
    );
    this.ticks = 0;
    this.sticks.clock.addEventListener("message", () => this.tick());
  }

  // Without a pad and a held key nothing here moves: a browser that draws 50 times a second all
  // the same takes a tenth of a core more.
  tick() {
    const { on, held, pad } = this.sticks,
      was = this.moves;
    this.moves = Boolean(on || held || pad || this.touch.isOpen);
    if (this.moves || was || this.ticks++ % IDLE === 0) this.draw();
  }

  draw() {
    const { sticks } = this,
      [left, right] = this.pads;
    at(left.ring, sticks.raw[3], sticks.raw[2]);
    at(right.ring, sticks.raw[1], sticks.raw[0]);
    at(left.dot, sticks.sent[3], sticks.sent[2]);
    at(right.dot, sticks.sent[1], sticks.sent[0]);
    this.place.classList.toggle("on", sticks.on);
    this.place.classList.toggle("refused", !sticks.on && Boolean(sticks.dropped || sticks.held));
    setText(this.note, this.words());
    if (this.touch.isOpen) {
      this.touch.draw(sticks.on);
      setText(this.said, this.note.textContent);
      setIfChanged(this.begin, "disabled", this.behavior === "velocity" || !this.isFlying);
    }
    setText(this.limits, limits(this.behavior, this.limit, this.holds));
    setText(this.source, this.sourceText());
    const trip = sticks.on ? sticks.link.trip : null,
      late = sticks.on && sticks.link.overdue > 250;
    setText(
      this.trip,
      late
        ? `no answer for ${fixed(sticks.link.overdue, 0)} ms`
        : trip
          ? `${fixed(trip.median, 1)} ms, 95 % below ${fixed(trip.most, 1)} ms`
          : "",
    );
    this.trip.classList.toggle("warn", late);
    hide(this.setUp, !sticks.pad && !this.editor.isOpen);
    this.velocity.disabled = this.behavior === "velocity" || !this.isFlying;
    if (this.behavior && this.behavior !== this.was) this.changed();
  }

  // Another page may start it next, otherwise.
  changed() {
    if (this.was === "near_hovering") this.fly.started = null;
    this.was = this.behavior;
  }

  get status() {
    return this.events.age("status") < STALE ? this.events.summary.status : null;
  }
  get behavior() {
    return this.status?.behavior?.toLowerCase() ?? "";
  }
  get isFlying() {
    return Boolean(this.status?.airborne);
  }

  // What the sticks do at present, or why they do nothing.
  words() {
    const { sticks } = this;
    if (sticks.on) {
      if (sticks.note) return `On: ${sticks.note}.`;
      if (!this.status) return "On, but there is no data from the vehicle.";
      if (landing(this.status)) return `On, but ${landing(this.status)}.`;
      if (OBEYING[this.behavior])
        return `On: ${commanded(this.behavior, sticks.sent, this.limit, this.holds)}.`;
      return this.isFlying
        ? `On, but ${words(this.behavior)} ignores the sticks: start ${Object.values(OBEYING).join(" or ")}.`
        : "On, but sticks work only in flight: arm and take off first.";
    }
    const why = sticks.held && sticks.refusal;
    if (why) return /release|press/.test(why) ? `Off: ${why}.` : `Off: ${this.reason(why)}. ${this.step}`;
    if (sticks.editing) return "Off while the pad is being set up.";
    if (sticks.pad && !sticks.mapping) return "This pad is not known: set it up first.";
    if (this.touch.isOpen)
      return sticks.dropped
        ? `Dropped: ${this.reason(sticks.dropped)}. ${this.step}`
        : OBEYING[this.behavior]
          ? "Touch a pad to fly; lift your fingers to brake."
          : "Press Velocity in flight, then touch a pad.";
    if (document.activeElement?.tagName === "IFRAME")
      return "W A S D and the arrows move the 3D view's camera now: click here to fly by keyboard.";
    if (!window.isSecureContext) return `A gamepad works over https or on this computer only. ${this.keys}`;
    if (sticks.dropped) return `Dropped: ${this.reason(sticks.dropped)}. ${this.step}`;
    return sticks.pad ? "Hold the pad's button (a shoulder) with all sticks centred." : this.keys;
  }

  // Whoever has control in our place; "" for nobody.
  get other() {
    const holder = this.events.summary.control?.holder ?? "";
    return holder === this.label ? "" : holder;
  }

  // Why they were dropped; of control that has been given back, that it was away.
  reason(why) {
    return why === OTHERS && !this.other ? "another had control" : why;
  }

  // The one thing to do to have the sticks again.
  get step() {
    const { held, centred } = this.sticks;
    if (this.other) return `Ask ${this.other} for control.`;
    if (this.touch.isOpen) return held ? "Lift your fingers, then touch a pad again." : "Touch a pad again.";
    if (held)
      return centred
        ? "Release the button and press it again."
        : "Release the button and all sticks, then press it again.";
    return centred ? "Press the button again." : "Centre all sticks, then press the button again.";
  }

  get keys() {
    return KEYS[this.behavior] ?? KEYS.velocity;
  }

  // Whether near-hovering holds the height, as far as this page knows.
  get holds() {
    return this.fly.started?.name === "near_hovering" ? this.fly.started.values.hold_altitude : undefined;
  }

  sourceText() {
    const { pad, mapping } = this.sticks;
    if (!pad) return this.touch.isOpen ? "touch" : "keyboard";
    const name = pad.id.replace(/\s*\((?:STANDARD GAMEPAD|Vendor).*$/i, "") || "pad";
    return mapping ? `${name} · ${presetOf(mapping) || "own mapping"}` : name;
  }
}

// Our left is the screen's left, our up (and forward) its up.
function at(mark, left, up) {
  mark.style.transform = `translate(${-REACH * left}px, ${-REACH * up}px)`;
}
