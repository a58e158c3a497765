import assert from "node:assert/strict";
import { test } from "node:test";

import "../../../../tests/page/browser.js";

const { difference } = await import("../../page/compare/source.js");
const { Camera } = await import("../../page/replay/camera.js");
const { Run } = await import("../../page/replay/run.js");

test("from above x points right and y up, from the side z up, and the first person looks ahead", () => {
  const camera = new Camera(), seen = (look, point) => { camera.choose(look); camera.target = [0, 0, 1]; camera.prepare(400, 400); return camera.project(point); };
  const [right, up] = [seen("top", [1, 0, 1]), seen("top", [0, 1, 1])];
  assert.ok(right[0] > 250 && Math.abs(right[1] - 200) < 1 && up[1] < 150 && Math.abs(up[0] - 200) < 1);
  assert.ok(seen("side", [0, 0, 2])[1] < 150);
  camera.sitOn({ position: [0, 0, 1] }, [0, -1, 0, 1, 0, 0, 0, 0, 1]); // its nose along y
  camera.prepare(400, 400);
  const [x, y] = camera.project([0, 3, 1]);
  assert.ok(Math.abs(x - 200) < 1e-6 && Math.abs(y - 200) < 1e-6);
  assert.equal(camera.project([0, -3, 1]), null);
});

test("error, speed and thrust of a recorded row; null where something is unknown", () => {
  const run = Object.assign(Object.create(Run.prototype), {
    description: { parameters: { "model.mass": 2 } }, place: { state: 0, reference: 3, actuators: 6 },
    track: { rate: 50, width: 11, rows: Float32Array.of(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.02, 0, 1, 0.05, 0.04, 1, 9, 9, 9, 9, 19.62) },
  });
  assert.ok(Math.abs(run.signal("error", 1) - 0.05) < 1e-6);
  assert.ok(Math.abs(run.signal("speed", 1) - 50 * Math.hypot(0.02, 1)) < 1e-3);
  assert.ok(Math.abs(run.signal("thrust", 1) - 1) < 1e-6);
  assert.equal(run.signal("speed", 0), null);
});

test("the difference of two runs is at the same time since the event, and none where one has no value", () => {
  const first = { times: [10, 11, 12], values: [0, 1, 2], shift: 10 }, second = { times: [3, 3.5, 4, 9], values: [5, 5, 5, 5], shift: 3 };
  assert.deepEqual([...difference(second, first)], [NaN, 4.5, 4, NaN]);
});

test("a run of simulated time has no date", () => {
  const begun = (seconds) => new Run("a", { start_ns: seconds * 1e9, signals: [] }).begun;
  assert.deepEqual([begun(0), begun(41.7), begun(1_795_874_707)], [null, null, 1_795_874_707]);
});
