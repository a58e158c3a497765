import assert from "node:assert/strict";
import test from "node:test";

import { calm, entriesOf, entryOf, movable, withEntry, withoutEntry } from "../../web/static/faults/entries.js";

const WORDS = [{ name: "rate", default: 5 }, { name: "axis", default: "x" }], SCHEDULE = [{ name: "from", default: 0 }, { name: "to", default: 86400 }];

test("an entry has all words of the fault, and those of the schedule that differ from their defaults", () => {
  assert.equal(entryOf("a.b", WORDS, SCHEDULE, { rate: 15, axis: "x", from: 2, to: "" }), "a.b rate=15 axis=x from=2");
  assert.equal(entryOf("a.b", WORDS, SCHEDULE, { rate: "" }), "a.b");
  assert.equal(entryOf("a.b", WORDS, SCHEDULE, { rate: 5, axis: "y", from: 0, to: 0 }), "a.b rate=5 axis=y to=0");
});

test("entries come and go, and the others stay as they are", () => {
  const text = withEntry(withEntry("", "a.b x=1"), "c.d");
  assert.equal(text, "a.b x=1; c.d");
  assert.deepEqual(entriesOf(" a.b   x=1 ;; c.d "), ["a.b x=1", "c.d"]);
  assert.equal(withoutEntry(text, 0), "c.d");
  assert.equal(withoutEntry("a; a; b", 1), "a; b");
  assert.equal(withoutEntry("a", 0), "");
});

test("a schedule can move what can change in flight and is no free text", () => {
  const of = (name, type = "float", more = {}) => ({ name, type, value: 1, default: 0, choices: [], read_only: false, description: "", ...more });
  const found = movable([
    of("simulator.payload"), of("simulator.served.stopped", "bool"), of("simulator.imu_rate", "int", { read_only: true }), of("simulator.faults", "str"),
    of("station.tracker.delay"), of("station.tracker.seed", "int"), of("station.bearings.distribution", "str", { choices: ["a", "b"] }), of("station.bearings.layout", "str"),
    of("station.recorder.pictures"), of("control.position.kp_xy"), of("tracker.delay"),
  ]);
  assert.deepEqual(found.map(({ name, home }) => [name, home]), [
    ["simulator.payload", "simulator.faults"], ["simulator.served.stopped", "simulator.faults"],
    ["tracker.delay", "tracker.faults"], ["bearings.distribution", "bearings.faults"],
  ]);
  assert.equal(entryOf(found[0].name, found[0].words, SCHEDULE, { value: 0.3, from: 2, to: "" }), "simulator.payload value=0.3 from=2");
});

test("removing all takes disturbances and errors away, and nothing else", () => {
  const changed = (name, value, initial) => ({ name, value, default: initial });
  assert.deepEqual(calm([
    changed("simulator.wind_x", 3, 0), changed("simulator.gust", 0, 0), changed("simulator.gust_time", 2, 1), changed("simulator.payload", 0.3, 0),
    changed("simulator.faults", "imu.stuck", ""), changed("station.tracker.faults", "tracker.freeze", ""), changed("station.bearings.bias_z", 2, 0),
    changed("simulator.motor_gain_left", 0.9, 1), changed("simulator.served.stopped", true, false), changed("simulator.mass", 2, 1.308),
    changed("control.position.kp_xy", 9, 4), changed("station.tracker.rate", 50, 100),
  ]), {
    "simulator.wind_x": 0, "simulator.payload": 0, "simulator.faults": "", "station.tracker.faults": "", "station.bearings.bias_z": 0,
    "simulator.motor_gain_left": 1, "simulator.served.stopped": false,
  });
});
