import assert from "node:assert/strict";
import { test } from "node:test";

import "../browser.js";

const { Events, Telemetry } = await import("../../../web/static/core/sockets.js");

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

test("who comes after the hello of a connection gets it too, and that of no earlier one", async (context) => {
  withClock(context);
  const events = new Events(), socket = FakeSocket.made.at(-1), heard = [];
  socket.open();
  socket.bring('{"type": "hello", "vehicle": "quad1"}');
  events.on("hello", ({ vehicle }) => heard.push(vehicle));
  assert.deepEqual(heard, []); // not before who listens has been made
  await Promise.resolve();
  assert.deepEqual(heard, ["quad1"]);
  socket.close();
  events.on("hello", ({ vehicle }) => heard.push(vehicle));
  await Promise.resolve();
  assert.deepEqual(heard, ["quad1"]);
});

test("a websocket comes back by itself, later and later, until it is closed for good", (context) => {
  const clock = withClock(context), events = new Events();
  const retried = (ms) => {
    FakeSocket.made.at(-1).open();
    clock.ms += ms;
    FakeSocket.made.at(-1).close();
    const { act, pause } = clock.later.pop();
    act();
    return pause;
  };
  for (const pause of [250, 500, 1000, 2000, 2000]) {
    FakeSocket.made.at(-1).close();
    const { act, pause: found } = clock.later.pop();
    assert.equal(found, pause);
    act();
  }
  assert.equal(retried(2000), 0); // it was there in between: the server is as likely to be there still
  FakeSocket.made.at(-1).close();
  assert.equal(clock.later.pop().pause, 250);
  assert.deepEqual([retried(1), retried(1)], [500, 1000]); // accepted and closed at once is no success
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

// Of newest values, and of one series with its place, times, columns and holes.
function frame(id, time, ages, values, { place = 0, times = [], columns = [], holes = [] } = {}) {
  const padded = (bytes) => 8 * Math.ceil(bytes / 8), count = times.length;
  const size = 24 + padded(2 * ages.length) + padded(4 * values.length) + (count ? 16 + 8 * count + padded(4 * count * columns.length) + 16 * holes.length : 0);
  const view = new DataView(new ArrayBuffer(size));
  [id, count ? 1 : 0, values.length, 1].forEach((one, i) => view.setUint16(2 * i, one, true));
  [1e9, time].forEach((one, i) => view.setFloat64(8 + 8 * i, one, true));
  ages.forEach((age, i) => view.setUint16(24 + 2 * i, age, true));
  let at = 24 + padded(2 * ages.length);
  values.forEach((value, i) => view.setFloat32(at + 4 * i, value, true));
  at += padded(4 * values.length);
  if (!count) return view.buffer;
  [place, count, holes.length, 1].forEach((one, i) => view.setUint32(at + 4 * i, one, true));
  times.forEach((one, i) => view.setFloat64(at + 16 + 8 * i, one, true));
  columns.flat().forEach((one, i) => view.setFloat32(at + 16 + 8 * count + 4 * i, one, true));
  at += 16 + 8 * count + padded(4 * count * columns.length);
  holes.flat().forEach((one, i) => view.setFloat64(at + 8 * i, one, true));
  return view.buffer;
}

function telemetryOf(context) {
  withClock(context);
  const signals = [{ name: "a", topic: "state" }, { name: "b", topic: "battery" }, { name: "c", topic: "state" }];
  const telemetry = new Telemetry({ topics: ["battery", "state"], signals }), frames = [];
  telemetry.addEventListener("frame", ({ detail }) => frames.push(detail));
  return { telemetry, socket: FakeSocket.made.at(-1), frames };
}

test("frames are of the signals asked for last, in the order of the topics", (context) => {
  const { telemetry, socket, frames } = telemetryOf(context);
  telemetry.want("bar", ["a", "b"]);
  telemetry.want("table", ["b", "c"]);
  socket.open();
  const { id, signals: asked } = JSON.parse(socket.sent.at(-1));
  assert.deepEqual(asked, ["a", "b", "c"]);
  socket.bring(frame(id - 1, 4, [0], [9]));
  socket.bring(frame(id, 5, [65535, 40], [1, 2, 3]));
  assert.deepEqual(frames, [{ time: 5, slowness: 1, age: { battery: Infinity, state: 0.04 }, value: { a: 1, b: 2, c: 3 } }]);
  assert.deepEqual([telemetry.age("state"), telemetry.age("reference")], [0.04, Infinity]);
});

test("a series gets its new samples, and after a lost connection those since the last", (context) => {
  const { telemetry, socket } = telemetryOf(context), news = [], anew = [];
  const series = { names: ["a", "c"], last: undefined, add(times, columns, holes) { news.push([[...times], columns.map((one) => [...one]), holes]); this.last = times.at(-1); } };
  telemetry.addEventListener("origin", () => anew.push(telemetry.origin));
  telemetry.want("table", ["b"]);
  telemetry.chart([{ names: ["b"] }, series]);
  socket.open();
  const { id, series: asked } = JSON.parse(socket.sent.at(-1));
  assert.deepEqual(asked, [{ signals: ["b"] }, { signals: ["a", "c"] }]);
  const times = [1, 1.5, 2], columns = [[5, NaN, 6], [7, NaN, 8]];
  socket.bring(frame(id, 2, [0, 0], [9], { place: 1, times, columns, holes: [[1.5, 15]] }));
  assert.deepEqual(news, [[times, columns, [{ t: 1.5, count: 15 }]]]);
  assert.deepEqual(anew, [1e9]);
  socket.open();
  assert.deepEqual([JSON.parse(socket.sent.at(-1)).origin, JSON.parse(socket.sent.at(-1)).series[1].after], [1e9, 2]);
});
