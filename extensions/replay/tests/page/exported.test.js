// What an exported page answers by itself: statistics, and the derived signals that it was given.

import assert from "node:assert/strict";
import { test } from "node:test";

import "../../../../tests/page/browser.js";

const { pack } = await import("../../page/replay/packed.js");
const speed = "speed = abs(state.velocity.x)", times = Float64Array.of(0, 1, 2, 3);
const group = { signals: ["state.velocity.x", speed], times, columns: [Float32Array.of(-1, 1, NaN, 3), Float32Array.of(1, 1, NaN, 3)] };
const signals = group.signals.map((name) => ({ name, topic: "state", label: name, unit: "m/s", group: "state" }));
const description = { signals, topics: { state: { count: 4 } } };
Object.assign(globalThis, { quadlabRun: { description, track: "", windows: [Buffer.from(pack([group])).toString("base64")] } });
const { get } = await import("../../page/replay/exported.js");

const statistics = (name, start, end) => get(`/api/replay/a/statistics?start=${start}&end=${end}&signal=${encodeURIComponent(name)}`);

test("statistics are those of the samples between two instants", async () => {
  const { [speed]: found } = await statistics(speed, -1, 3);
  assert.deepEqual(found, { count: 3, mean: 5 / 3, rms: Math.sqrt(11 / 3), min: 1, max: 3 });
  assert.deepEqual((await statistics("state.velocity.x", 1.5, 2.5))["state.velocity.x"], { count: 0, mean: null, rms: null, min: null, max: null });
});

test("of a topic that is not whole no mean is told", async () => {
  description.topics.state.count = 20_001;
  const { [speed]: found } = await statistics(speed, -1, 3);
  description.topics.state.count = 4;
  assert.deepEqual(found, { count: 3, mean: null, rms: null, min: 1, max: 3 });
});

test("a derived signal that was exported is known, another one is refused with what helps", async () => {
  const [known, other] = await get(`/api/replay/a/expressions?text=${encodeURIComponent(speed)}&text=a%20%3D%202`);
  assert.equal(known.topic, "state");
  assert.match(other.problem, /export it again with --derive/);
});
