// Frames to /ws/stick and the answers to them: who has the sticks, why not, and how long the way
// to the station and back takes. See web/commands/sticks.py for the protocol.

import { Socket } from "../core/sockets.js";

export const CAUSES = [
  "released",
  "blur",
  "hidden",
  "unplugged",
  "stalled",
  "late",
  "left",
  "editing",
  "silent",
]; // by number
const KEPT = 100; // round trips: 2 s

export class StickLink extends EventTarget {
  // more(): further axes of a frame, after those of every vehicle.
  /** @param {() => number[]} more */
  constructor(path = "/ws/stick", more = () => []) {
    super();
    this.more = more;
    this.number = 0;
    this.waiting = new Map(); // number → when it was sent
    this.trips = []; // ms
    this.socket = new Socket(path);
    this.socket.addEventListener("message", ({ data }) => this.receive(JSON.parse(data)));
    this.socket.addEventListener("close", () => {
      this.waiting.clear();
      this.trips.length = 0;
      this.dispatchEvent(new Event("lost"));
    });
  }

  get connected() {
    return this.socket.connected;
  }

  // Returns the frame's number.
  send(axes, held, cause = "released") {
    const more = held ? this.more() : this.more().fill(0),
      frame = new DataView(new ArrayBuffer(28 + 4 * more.length));
    axes.forEach((value, i) => frame.setFloat32(4 * i, value, true));
    frame.setFloat32(16, held ? 1 : 0, true);
    frame.setUint32(20, ++this.number, true);
    frame.setUint32(24, CAUSES.indexOf(cause), true);
    more.forEach((value, i) => frame.setFloat32(28 + 4 * i, value, true));
    if (held) this.waiting.set(this.number, performance.now());
    this.socket.send(frame.buffer);
    return this.number;
  }

  // {n, by, on, why}
  receive(answer) {
    const sent = this.waiting.get(answer.n);
    if (sent !== undefined && answer.by === "station") {
      this.trips.push(performance.now() - sent);
      if (this.trips.length > KEPT) this.trips.shift();
    }
    for (const number of this.waiting.keys()) {
      // in order: an older one unanswered got lost
      if (number > answer.n) break;
      this.waiting.delete(number);
    }
    this.dispatchEvent(new CustomEvent("answer", { detail: answer }));
  }

  forget() {
    this.waiting.clear();
    this.trips.length = 0;
  }

  // ms the oldest frame has been waiting for its answer.
  get overdue() {
    const [first] = this.waiting.values();
    return first === undefined ? 0 : performance.now() - first;
  }

  // {median, most} ms of the newest round trips to the station; null without any.
  get trip() {
    if (!this.trips.length) return null;
    const sorted = [...this.trips].sort((a, b) => a - b);
    return {
      median: sorted[Math.floor(sorted.length / 2)],
      most: sorted[Math.min(sorted.length - 1, Math.floor(0.95 * sorted.length))],
    };
  }
}
