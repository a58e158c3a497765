import assert from "node:assert/strict";
import { test } from "node:test";

import { pack, unpack } from "../../web/static/replay/packed.js";

const times = Float64Array.from({ length: 1000 }, (_, k) => k / 100);
const height = Float32Array.from(times, (t) => Math.sin(t));
height[437] = 5; // one sample
height[800] = NaN; // parts a gap
const text = (buffer) => Buffer.from(buffer).toString("base64");
const signals = [{ name: "state.z", topic: "state" }, { name: "state.still", topic: "state", constant: 7 }];
globalThis.quadlabRun = {
  description: { id: "a", state: "ready", vehicle: "quad1", signals },
  track: text(Float32Array.of(1, 2, 3).buffer),
  windows: [text(pack([{ signals: ["state.z"], times, columns: [height] }]))],
};
const { binary, command, get } = await import("../../web/static/replay/exported.js");

const asked = async (names, start, end, points, more = "") =>
  unpack(await binary(`/api/replay/a/window?start=${start}&end=${end}&points=${points}${more}${names.map((name) => `&signal=${name}`).join("")}`));

test("what is packed is what is unpacked", () => {
  const [one, two] = unpack(pack([{ signals: ["a", "b"], times: Float64Array.of(1, 2, 3), columns: [Float32Array.of(4, 5, 6), Float32Array.of(7, NaN, 9)] },
    { signals: ["cö"], times: Float64Array.of(), columns: [Float32Array.of()] }]));
  assert.deepEqual([...one.times, ...one.columns[0], ...one.columns[1]], [1, 2, 3, 4, 5, 6, 7, NaN, 9]);
  assert.deepEqual([two.signals, two.times.length], [["cö"], 0]);
});

test("a window that is narrow has every sample, with one more on either side, and constants", async () => {
  const [group] = await asked(["state.z", "state.still"], 1, 2, 500);
  assert.deepEqual([...group.times], [...times.slice(100, 202)]);
  assert.deepEqual([...group.columns[0]], [...height.slice(100, 202)]);
  assert.ok(group.columns[1].every((value) => value === 7));
});

test("a window that is wide keeps the greatest sample and the gap", async () => {
  const [{ times: kept, columns: [values] }] = await asked(["state.z"], 0, 10, 50);
  assert.equal(kept.length, 100);
  assert.ok(values.includes(5));
  assert.ok(kept[values.findIndex(Number.isNaN)] <= 8.2 && values.some(Number.isNaN));
});

test("without extremes every n-th sample is kept, of all signals at the same times", async () => {
  const [{ times: kept, columns: [values] }] = await asked(["state.z"], 0, 10, 50, "&extremes=false");
  assert.ok(kept.length <= 50 && kept.length > 25);
  kept.forEach((time, i) => assert.ok(Object.is(values[i], height[times.indexOf(time)])));
});

test("a value is the newest one with its age, none before the first", async () => {
  const { "state.z": [value, age], "state.still": still } = await get("/api/replay/a/at?t=4.375&signal=state.z&signal=state.still");
  assert.equal(value, 5);
  assert.ok(Math.abs(age - 0.005) < 1e-9);
  assert.equal(still[0], 7);
  assert.deepEqual(await get("/api/replay/a/at?t=-1&signal=state.z"), { "state.z": [null, null] });
});

test("the track comes as it was, and what needs a server says so", async () => {
  assert.deepEqual([...new Float32Array(await binary("/api/replay/a/track"))], [1, 2, 3]);
  await assert.rejects(get("/api/replay/a/spectrum?start=0&end=1&signal=state.z"), /open the run in quadlab/);
  await assert.rejects(command("arm"), /no server/);
});
