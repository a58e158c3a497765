// The sticks of the formation: those of a vehicle, by keyboard, gamepad or touch, and one more axis that makes
// the formation grow (R) or shrink (F); on a gamepad the cross, up and down.

import { element, setText } from "/static/core/dom.js";
import { fixed } from "/static/core/format.js";
import { TYPING, characterOf } from "/static/core/keys.js";
import { StickLink } from "/static/sticks/socket.js";
import { Sticks } from "/static/sticks/sticks.js";

const REACH = 15, // px from the centre of a pad to full stick
  RISE = 0.5, // s to full
  GROW = { r: 1, f: -1 },
  CROSS = { 12: 1, 13: -1 }, // buttons of a standard gamepad
  AGAIN = " Release the button, then press it again.",
  HOW =
    "Hold Shift: W A S D move all, arrows up, down and turn about the middle, R and F grow and shrink. " +
    "On a gamepad hold a shoulder button; the cross grows and shrinks.";

export class Steering {
  // emergency: {press(action)}; speeds(): {speed, yaw_rate, scale_rate} of full sticks.
  constructor(emergency, speeds) {
    this.speeds = speeds;
    this.sticks = new Sticks(emergency, () => new StickLink("/formation/sticks", () => [this.grow]));
    this.keys = new Set();
    this.grow = 0;
    this.ticked = performance.now();
    addEventListener("keydown", (/** @type {any} */ event) => {
      const key = characterOf(event);
      if (key in GROW && !event.ctrlKey && !event.metaKey && !event.altKey && !event.target.closest?.(TYPING))
        this.keys.add(key);
    });
    addEventListener("keyup", (event) => this.keys.delete(characterOf(event)));
    addEventListener("blur", () => this.keys.clear());
    this.pads = ["up and turn", "forward and left", "grow"].map((title) => {
      const dot = element("i", { className: "dot" });
      return { dot, box: element("span", { className: "pad", title: `${title}: what is sent` }, dot) };
    });
    this.note = element("p", { className: "note", ariaLive: "polite" }, HOW);
    this.place = element(
      "div",
      { className: "steering" },
      element("span", { className: "pads", ariaHidden: "true" }, ...this.pads.map(({ box }) => box)),
      this.note,
    );
    this.sticks.clock.addEventListener("message", () => this.tick());
  }

  tick() {
    const now = performance.now(),
      most = Math.min(0.1, (now - this.ticked) / 1e3) / RISE,
      buttons = this.sticks.pad?.buttons ?? [];
    this.ticked = now;
    let wanted = 0;
    for (const key of this.keys) wanted += GROW[key];
    for (const [index, sign] of Object.entries(CROSS)) if (buttons[index]?.pressed) wanted += sign;
    wanted = this.sticks.on ? Math.sign(wanted) : 0;
    this.grow = wanted ? this.grow + Math.max(-most, Math.min(most, wanted - this.grow)) : 0;
    this.draw();
  }

  draw() {
    const { on, sent } = this.sticks,
      [turn, move, grow] = this.pads;
    put(turn.dot, sent[3], sent[2]);
    put(move.dot, sent[1], sent[0]);
    put(grow.dot, 0, on ? this.grow : 0);
    this.place.classList.toggle("on", on);
    this.place.classList.toggle("refused", !on && Boolean(this.sticks.held || this.sticks.dropped));
    setText(this.note, this.words());
  }

  words() {
    const { sticks } = this,
      { speed, yaw_rate: rate, scale_rate: scale } = this.speeds();
    if (sticks.on) {
      const [forward, left, up, turn] = sticks.sent;
      return (
        `On: forward ${fixed(speed * forward, 2)}, left ${fixed(speed * left, 2)}, up ${fixed(speed * up, 2)} m/s, ` +
        `turn ${fixed(rate * turn, 2)} rad/s, grow ${fixed(100 * scale * this.grow, 0)} %/s.`
      );
    }
    const why = sticks.held && sticks.refusal;
    if (why) return `Off: ${why}.${/release|press/.test(why) ? "" : AGAIN}`;
    const next = sticks.held ? AGAIN : " Press the button again.";
    return sticks.dropped ? `Dropped: ${sticks.dropped}.${next}` : HOW;
  }
}

// Our left is the screen's left, our up (and forward) its up.
function put(mark, left, up) {
  const text = `translate(${-REACH * left}px, ${-REACH * up}px)`;
  if (mark.style.transform !== text) mark.style.transform = text;
}
