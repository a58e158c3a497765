// The keyboard as sticks: a key that goes down moves its axis smoothly, not at once.

import { characterOf } from "../core/keys.js";
import { AXES } from "./mapping.js";

const KEYS = {
  w: ["forward", 1],
  s: ["forward", -1],
  a: ["left", 1],
  d: ["left", -1],
  arrowup: ["up", 1],
  arrowdown: ["up", -1],
  arrowleft: ["yaw", 1],
  arrowright: ["yaw", -1],
};
const DEAD_MAN = "shift";
const TOGETHER = 300; // ms before the dead-man key in which a key still counts as pressed with it
const RISE = 0.5,
  FALL = 0.2; // s from centre to full, and back
const nameOf = (event) => characterOf(event).toLowerCase();
const TYPING = "input, select, textarea, [contenteditable]";

export class StickKeys {
  constructor() {
    /** @type {Map<string, number>} the keys that are down, and since when, ms */
    this.pressed = new Map();
    this.axes = [0, 0, 0, 0];
    addEventListener("keydown", (event) => {
      if (event.key === "Meta") this.clear(); // macOS reports no release of other keys while it is held
      const key = nameOf(event);
      if (
        event.target?.closest?.(TYPING) ||
        !(key in KEYS || key === DEAD_MAN) ||
        event.ctrlKey ||
        event.metaKey ||
        event.altKey
      )
        return;
      if (key in KEYS && this.deadMan) event.preventDefault();
      if (!this.pressed.has(key)) this.pressed.set(key, event.timeStamp);
    });
    addEventListener("keyup", (event) => this.pressed.delete(nameOf(event)));
    addEventListener("blur", () => this.clear());
  }

  clear() {
    this.pressed.clear();
    this.axes.fill(0);
  }

  get deadMan() {
    return this.pressed.has(DEAD_MAN);
  }
  get moving() {
    return [...this.pressed.keys()].some((key) => key in KEYS);
  }

  // Whether a press of the dead-man button may count: no key steers, or each went down with or after the
  // dead-man key. Its axis then starts from zero (restart).
  get centred() {
    const since = this.pressed.get(DEAD_MAN);
    if (since === undefined) return !this.moving && this.axes.every((value) => value === 0);
    return [...this.pressed.values()].every((at) => at >= since - TOGETHER);
  }

  restart() {
    this.axes.fill(0);
  }

  // dt: s since the last call.
  step(dt) {
    const wanted = [0, 0, 0, 0];
    for (const key of this.pressed.keys())
      if (key in KEYS) wanted[AXES.indexOf(KEYS[key][0])] += KEYS[key][1];
    this.axes = this.axes.map((value, i) => {
      const to = wanted[i],
        grows = to !== 0 && Math.sign(to) === (Math.sign(value) || Math.sign(to));
      const most = dt / (grows ? RISE : FALL);
      return value + Math.max(-most, Math.min(most, to - value));
    });
    return this.axes;
  }
}
