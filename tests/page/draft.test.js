import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

const { noteOf, stepOf, titleOf } = await import("../../web/static/view/draft_words.js");
const HOVERS = { airborne: true, behavior: "HOVER" };
const target = { kind: "target", points: [[1.2, 0.4, 1]], by: "operator 1", arguments: {}, away: 1, checked: true, refusal: "", duration: 3, speed: 0.8 };

test("a target says where it is and is flown to by fly_to, once it was found to be possible", () => {
  assert.equal(titleOf(target, ""), "Target 1.20, 0.40, 1.00 m");
  assert.equal(noteOf(target), "00:03, up to 0.80 m/s");
  assert.deepEqual(stepOf(target, HOVERS), { label: "Fly there", why: "", behavior: "fly_to", values: { x: 1.2, y: 0.4, z: 1 } });
  for (const [change, status, why] of [[{}, null, "no data from the vehicle"], [{}, { airborne: false }, "take off first"], [{ checked: false }, HOVERS, "being checked"], [{ refusal: "follow_trajectory refused: the path's x = 4.00 m is outside" }, HOVERS, "the vehicle cannot fly it"]]) {
    assert.equal(stepOf({ ...target, ...change }, status).why, why);
  }
  assert.equal(noteOf({ ...target, refusal: "follow_trajectory refused: x = 4 m is outside; allowed -3 to 3 m (behavior.volume_x_min, behavior.volume_x_max); make it smaller" }), "x = 4 m is outside; allowed -3 to 3 m; make it smaller");
});

test("way-points are flown in the order in which they were set, from hover", () => {
  const draft = { ...target, kind: "waypoints", points: [[1, 0, 1], [1, 1.005, 1.2]] };
  const { behavior, values, why } = stepOf(draft, HOVERS);
  assert.deepEqual([behavior, values, why], ["follow_trajectory", { trajectory: "waypoints", waypoints: "1 0 1; 1 1.005 1.2" }, ""]);
  assert.equal(stepOf(draft, { airborne: true, behavior: "FLY_TO" }).why, "wait until it hovers");
  assert.equal(titleOf(draft, ""), "2 way-points, the last at 1.00, 1.00, 1.20 m");
});

test("a trajectory elsewhere is flown to its start first", () => {
  const draft = { ...target, kind: "trajectory", arguments: { trajectory: "circle", laps: 2 } };
  assert.equal(stepOf(draft, HOVERS).label, "Fly to its start");
  const there = stepOf({ ...draft, away: 0.01 }, HOVERS);
  assert.deepEqual([there.label, there.behavior, there.values], ["Fly it", "follow_trajectory", draft.arguments]);
});

test("a volume sets its six walls at once, on the ground too", () => {
  const set = { "behavior.volume_x_min": -1 }, { behavior, values, why } = stepOf({ ...target, kind: "volume", points: [[-1, -2, 0.2], [1, 2, 2.5]], values: set }, { airborne: false });
  assert.deepEqual([behavior, why, values], [undefined, "", set]);
});

test("a keep-out box says where it is, and is not set where the vehicle would refuse it", () => {
  const box = { ...target, kind: "keep_out", points: [[-1, -2, 0], [1, 2, 2.5]], arguments: { box: "pillar" }, values: { "behavior.keep_out": "pillar" } };
  assert.equal(titleOf(box, ""), "pillar x −1.00 to 1.00, y −2.00 to 2.00, z 0.00 to 2.50 m");
  assert.deepEqual(stepOf(box, HOVERS), { label: "Set box", why: "", values: box.values });
  const around = { ...box, refusal: "behavior.keep_out refused: the vehicle is inside; move" };
  assert.deepEqual([stepOf(around, HOVERS).why, noteOf(around)], ["the vehicle would refuse it", "the vehicle is inside; move"]);
});
