// Which gamepad is read, and when it last sent something. A gamepad is one connection at one index:
// a twin that takes its place is another one. The one used is kept until it is unplugged, or until a
// button of another one is pressed while nobody flies with the first.

import { isPressed } from "./mapping.js";

export const SILENT = 500; // ms without a change

const presses = (pad) => pad.buttons.some((_, i) => isPressed(pad, i));

// What changes whenever a gamepad sends something new. Browsers set `timestamp` at each input or at
// each poll, and some never do: then its values alone show it.
const signOf = (pad) =>
  `${pad.timestamp};${pad.axes};${pad.buttons.map(({ pressed, value }) => `${pressed}${value}`)}`;

export class Pads {
  constructor() {
    /** @type {any} */
    this.pad = null; // a Gamepad; a new object each time in some browsers
    this.unplugged = new Set(); // indices, since the last look
    this.pressing = new Set(); // indices
    this.sign = "";
    this.changed = -Infinity;
    addEventListener("gamepaddisconnected", (/** @type {any} */ { gamepad }) =>
      this.unplugged.add(gamepad?.index),
    );
  }

  // Read them; returns whether `pad` is another one than before. `keeps`: nobody else's button counts
  // while the one in use sends.
  look(now, keeps) {
    const pads = [...(navigator.getGamepads?.() ?? [])].flatMap((pad) => (pad?.connected ? [pad] : [])),
      before = this.pad;
    const same =
      before && !this.unplugged.has(before.index)
        ? pads.find(({ index, id }) => index === before.index && id === before.id)
        : null;
    const claims = pads.find((one) => one !== same && presses(one) && !this.pressing.has(one.index));
    const isKept = same && !(claims && (!keeps || this.silence(now) > SILENT));
    this.pad = isKept ? same : (claims ?? pads[0] ?? null);
    this.unplugged.clear();
    this.pressing = new Set(pads.filter(presses).map(({ index }) => index));
    const sign = this.pad ? signOf(this.pad) : "";
    if (!isKept || sign !== this.sign) this.changed = now;
    this.sign = sign;
    return !isKept && (before !== null || this.pad !== null);
  }

  // ms without a sign of life of the one in use.
  silence(now) {
    return now - this.changed;
  }
}
