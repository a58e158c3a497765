// Gamepad or keyboard → /ws/stick at 50 Hz while the dead-man button is held.
// The button must be released and pressed again after any interruption: blur, hidden page,
// unplugged pad, lost connection. The server and the station have watchdogs of their own.

import { element } from "./format.js";
import { Socket } from "./sockets.js";

const KEYS = { w: [0, 1], s: [0, -1], a: [1, 1], d: [1, -1], arrowup: [2, 1], arrowdown: [2, -1], arrowleft: [3, 1], arrowright: [3, -1] };
const DEAD_MAN_KEY = "shift", DEAD_MAN_BUTTONS = [4, 5]; // shoulder buttons
const DEAD_ZONE = 0.08;
const HINT = "Hold Shift: W A S D, arrows. Pad: hold a shoulder button.";

export class Sticks {
  constructor(place, events, isOperator) {
    this.place = place;
    this.events = events;
    this.pressed = new Set();
    this.latched = true; // until the button was seen released
    this.dots = [element("i"), element("i")];
    this.note = element("span", {}, isOperator ? HINT : "Viewers have no sticks.");
    place.append(element("span", { className: "pads" }, ...this.dots.map((dot) => element("span", { className: "pad" }, dot))), this.note);
    if (!isOperator) return;
    this.listen();
    this.clock = new Worker("/static/stick_clock.js");
    this.clock.onmessage = () => this.tick();
  }

  listen() {
    const isTyping = (event) => /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName ?? "");
    addEventListener("keydown", (event) => {
      const key = event.key.toLowerCase();
      if (isTyping(event) || !(key in KEYS || key === DEAD_MAN_KEY) || event.ctrlKey || event.metaKey) return;
      if (key in KEYS && this.pressed.has(DEAD_MAN_KEY)) event.preventDefault();
      this.pressed.add(key);
    });
    addEventListener("keyup", (event) => this.pressed.delete(event.key.toLowerCase()));
    for (const type of ["blur", "pagehide", "gamepaddisconnected"]) addEventListener(type, () => this.drop());
    document.addEventListener("visibilitychange", () => document.hidden && this.drop());
  }

  drop() {
    this.pressed.clear();
    this.latched = true;
    this.tick();
  }

  // axes: forward, left, up, yaw
  read() {
    const axes = [0, 0, 0, 0];
    let held = this.pressed.has(DEAD_MAN_KEY);
    for (const key of this.pressed) if (key in KEYS) axes[KEYS[key][0]] += KEYS[key][1];
    const pad = [...(navigator.getGamepads?.() ?? [])].find((one) => one?.connected);
    if (pad) {
      held ||= DEAD_MAN_BUTTONS.some((button) => pad.buttons[button]?.pressed);
      const zone = (value) => (Math.abs(value ?? 0) < DEAD_ZONE ? 0 : -value);
      [3, 2, 1, 0].forEach((source, i) => { axes[i] += zone(pad.axes[source]); });
    }
    return { axes: axes.map((value) => Math.max(-1, Math.min(1, value))), held };
  }

  tick() {
    const { axes, held } = this.read();
    if (!held) this.latched = false;
    const enabled = held && !this.latched && !document.hidden && document.hasFocus();
    if (enabled) this.connect();
    if (this.socket?.connected && (enabled || this.sent)) {
      // The server wants to see a release after each silence. We saw one (or would be latched);
      // a page that stood still with the button held did not, and so stays without sticks.
      if (!this.sent) this.socket.send(new Float32Array(5));
      this.socket.send(new Float32Array([...(enabled ? axes : [0, 0, 0, 0]), enabled ? 1 : 0]));
      this.sent = enabled;
    }
    this.draw(enabled ? axes : [0, 0, 0, 0], enabled);
  }

  connect() {
    if (this.socket) return;
    this.socket = new Socket("/ws/stick");
    this.socket.addEventListener("message", ({ data }) => { this.answer = JSON.parse(data); });
    this.socket.addEventListener("close", () => { this.latched = true; this.sent = false; this.answer = undefined; });
  }

  draw(axes, enabled) {
    const mine = enabled && this.answer?.enabled;
    this.place.classList.toggle("on", Boolean(mine));
    this.place.firstElementChild.classList.toggle("on", Boolean(mine));
    const at = (dot, x, y) => { dot.style.transform = `translate(${10 * x}px, ${10 * y}px)`; };
    at(this.dots[0], -axes[3], -axes[2]);
    at(this.dots[1], -axes[1], -axes[0]);
    const text = enabled && this.answer && !this.answer.mine ? "Someone else has the sticks." : mine && this.events.summary.status?.behavior?.toLowerCase() !== "velocity" ? "Sticks on; start Velocity to use them." : HINT;
    if (this.note.textContent !== text) this.note.textContent = text;
  }
}
