// The keyboard as sticks: a key that goes down moves its axis smoothly, not at once.

import { characterOf } from "../core/keys.js";
import { AXES } from "./mapping.js";

const KEYS = {
  w: ["forward", 1], s: ["forward", -1], a: ["left", 1], d: ["left", -1],
  arrowup: ["up", 1], arrowdown: ["up", -1], arrowleft: ["yaw", 1], arrowright: ["yaw", -1],
};
const DEAD_MAN = "shift";
const RISE = 0.5, FALL = 0.2; // s from centre to full, and back
const nameOf = (event) => characterOf(event).toLowerCase();
const TYPING = "input, select, textarea, [contenteditable]";

export class StickKeys {
  constructor() {
    this.pressed = new Set();
    this.axes = [0, 0, 0, 0];
    addEventListener("keydown", (event) => {
      if (event.key === "Meta") this.clear(); // macOS reports no release of other keys while it is held
      const key = nameOf(event);
      if (event.target?.closest?.(TYPING) || !(key in KEYS || key === DEAD_MAN) || event.ctrlKey || event.metaKey || event.altKey) return;
      if (key in KEYS && this.deadMan) event.preventDefault();
      this.pressed.add(key);
    });
    addEventListener("keyup", (event) => this.pressed.delete(nameOf(event)));
    addEventListener("blur", () => this.clear());
  }

  clear() {
    this.pressed.clear();
    this.axes.fill(0);
  }

  get deadMan() { return this.pressed.has(DEAD_MAN); }
  get moving() { return [...this.pressed].some((key) => key in KEYS); }

  // dt: s since the last call.
  step(dt) {
    const wanted = [0, 0, 0, 0];
    for (const key of this.pressed) if (key in KEYS) wanted[AXES.indexOf(KEYS[key][0])] += KEYS[key][1];
    this.axes = this.axes.map((value, i) => {
      const to = wanted[i], grows = to !== 0 && Math.sign(to) === (Math.sign(value) || Math.sign(to));
      const most = dt / (grows ? RISE : FALL);
      return value + Math.max(-most, Math.min(most, to - value));
    });
    return this.axes;
  }
}
