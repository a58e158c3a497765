// Two sticks under the fingers, over the lower part of a phone's page. A finger's first place is the stick's
// centre; while a finger is down the button counts as held, and lifting the last one lets go.

import { element, hide } from "../core/dom.js";
import { shape } from "./mapping.js";

const REACH = 56; // px from a finger's first place to full stick
const FEEL = { deadZone: 0.06, expo: 0.3 };
const PADS = [
  ["up and turn", "yaw", "up"],
  ["forward and left", "left", "forward"],
]; // what left and up on a pad mean
const CENTRE = { forward: 0, left: 0, up: 0, yaw: 0 };

// How far a finger is from its first place, as [left, up], -1 to 1.
/** @param {number[]} first @param {number[]} now */
export const deflection = (first, now) =>
  first.map((c, i) => Math.max(-1, Math.min(1, (c - now[i]) / REACH)));

export class TouchSticks {
  constructor() {
    this.fingers = new Map(); // pad → {id, first}
    this.raw = { ...CENTRE };
  }

  get deadMan() {
    return this.fingers.size > 0;
  }
  // As the sticks are sent: forward, left, up, yaw.
  get axes() {
    return this.rawAxes.map((value) => shape(value, FEEL));
  }
  get rawAxes() {
    return [this.raw.forward, this.raw.left, this.raw.up, this.raw.yaw];
  }

  press(pad, id, place) {
    if (!this.fingers.has(pad)) this.fingers.set(pad, { id, first: place });
  }

  move(pad, id, place) {
    const finger = this.fingers.get(pad);
    if (finger?.id !== id) return;
    const [, across, along] = PADS[pad];
    [this.raw[across], this.raw[along]] = deflection(finger.first, place);
  }

  lift(pad, id) {
    if (this.fingers.get(pad)?.id !== id) return;
    this.fingers.delete(pad);
    for (const axis of PADS[pad].slice(1)) this.raw[axis] = 0;
  }

  // Fingers that are down must be lifted and put down again.
  clear() {
    this.fingers.clear();
    Object.assign(this.raw, CENTRE);
  }
}

// The pads on the page; `more`: what stands between them.
export class TouchPads {
  constructor(sticks, more) {
    this.sticks = sticks;
    this.knobs = [];
    const pads = PADS.map(([title], pad) => {
      const knob = element("i"),
        box = element(
          "div",
          { className: "touch-pad", ariaLabel: `stick: ${title}` },
          knob,
          element("span", {}, title),
        );
      const place = (event) => [event.clientX, event.clientY];
      box.addEventListener("pointerdown", (event) => {
        event.preventDefault();
        box.setPointerCapture(event.pointerId);
        sticks.press(pad, event.pointerId, place(event));
      });
      box.addEventListener("pointermove", (event) => sticks.move(pad, event.pointerId, place(event)));
      for (const type of ["pointerup", "pointercancel", "lostpointercapture"])
        box.addEventListener(type, (/** @type {any} */ event) => sticks.lift(pad, event.pointerId));
      box.addEventListener("contextmenu", (event) => event.preventDefault());
      this.knobs.push(knob);
      return box;
    });
    this.place = element(
      "div",
      { id: "touch", hidden: true },
      pads[0],
      element(
        "div",
        { className: "middle" },
        ...more,
        element("button", { onclick: () => this.open(false) }, "Close"),
      ),
      pads[1],
    );
    document.body.append(this.place);
  }

  get isOpen() {
    return !this.place.hidden;
  }

  open(wanted) {
    hide(this.place, !wanted);
    document.body.classList.toggle("touches", wanted);
    if (wanted)
      scrollTo(0, 0); // to the 3D view
    else this.sticks.clear();
  }

  draw(isOn) {
    const { raw } = this.sticks;
    PADS.forEach(([, across, along], pad) => {
      this.knobs[pad].style.transform = `translate(${-REACH * raw[across]}px, ${-REACH * raw[along]}px)`;
    });
    this.place.classList.toggle("on", isOn);
  }
}
