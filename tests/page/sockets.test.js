import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

const { Events, Telemetry } = await import("../../web/static/core/sockets.js");

class FakeSocket {
  static OPEN = 1;
  static made = [];

  constructor(url) {
    this.url = url;
    this.readyState = 0;
    this.sent = [];
    FakeSocket.made.push(this);
  }

  open() { this.readyState = 1; this.onopen(); }

  send(data) { this.sent.push(data); }

  close() { this.readyState = 3; this.onclose(); }

  bring(data) { this.onmessage({ data }); }
}
globalThis.WebSocket = FakeSocket;

function withClock(context) {
  const clock = { ms: 1000, later: [] };
  context.mock.method(performance, "now", () => clock.ms);
  context.mock.method(globalThis, "setInterval", () => 0);
  context.mock.method(globalThis, "setTimeout", (act, pause) => { clock.later.push({ act, pause }); return 0; });
  return clock;
}

test("a websocket comes back by itself, later and later, until it is closed for good", (context) => {
  const clock = withClock(context), events = new Events();
  for (const pause of [250, 500, 1000, 2000, 2000]) {
    FakeSocket.made.at(-1).close();
    const { act, pause: found } = clock.later.pop();
    assert.equal(found, pause);
    act();
  }
  FakeSocket.made.at(-1).open();
  FakeSocket.made.at(-1).close();
  assert.equal(clock.later.pop().pause, 250); // it was there in between
  events.close();
  assert.equal(clock.later.length, 0);
});

test("a summary is merged, and ages run on while nothing arrives", (context) => {
  const clock = withClock(context), events = new Events(), socket = FakeSocket.made.at(-1), heard = [];
  events.on("tuning", (message) => heard.push(message.text));
  assert.equal(events.age("state"), Infinity);
  socket.bring('{"type": "summary", "age": {"state": 0.5, "truth": null}, "control": 1}');
  socket.bring('{"type": "summary", "age": {"state": 0.1}}');
  socket.bring('{"type": "tuning", "text": "done"}');
  clock.ms += 2000;
  assert.ok(Math.abs(events.age("state") - 2.1) < 1e-9);
  assert.deepEqual([events.age("truth"), events.summary.control, heard], [Infinity, 1, ["done"]]);
});

function frame(id, time, ages, values) {
  const view = new DataView(new ArrayBuffer(12 + 2 * ages.length + 4 * values.length));
  view.setUint16(0, id, true);
  view.setUint16(2, values.length, true);
  view.setFloat64(4, time, true);
  ages.forEach((age, i) => view.setUint16(12 + 2 * i, age, true));
  values.forEach((value, i) => view.setFloat32(12 + 2 * ages.length + 4 * i, value, true));
  return view.buffer;
}

test("frames are of the signals asked for last, in the order of the topics", (context) => {
  withClock(context);
  const signals = [{ name: "a", topic: "state" }, { name: "b", topic: "battery" }, { name: "c", topic: "state" }];
  const telemetry = new Telemetry({ topics: ["battery", "state"], signals }), socket = FakeSocket.made.at(-1), frames = [];
  telemetry.addEventListener("frame", ({ detail }) => frames.push(detail));
  telemetry.want("chart", ["a", "b"]);
  telemetry.want("table", ["b", "c"]);
  socket.open();
  const { id, signals: asked } = JSON.parse(socket.sent.at(-1));
  assert.deepEqual(asked, ["a", "b", "c"]);
  socket.bring(frame(id - 1, 4, [0], [9]));
  socket.bring(frame(id, 5, [65535, 40], [1, 2, 3]));
  assert.deepEqual(frames, [{ time: 5, age: { battery: Infinity, state: 0.04 }, value: { a: 1, b: 2, c: 3 } }]);
  assert.deepEqual([telemetry.age("state"), telemetry.age("reference")], [0.04, Infinity]);
});
