import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";
import { flownOn, lineOf, maySwitchOff, nextStep, pillOf, restoreLabel } from "../../web/static/console/vehicle_words.js";

const GROUND = { mode: "ready", behavior: "ground", control_mode: "direct", armed: false, airborne: false, flags: [] };
const ARMED = { ...GROUND, mode: "armed", armed: true };
const FLYING = { ...ARMED, behavior: "hover", airborne: true };
const SWINGING = { ...FLYING, flags: ["oscillating"], oscillation_axis: 1, oscillation_frequency: 0.71 };
const ALONE = { ...FLYING, mode: "emergency_land", control_mode: "emergency", behavior: "emergency_landing" };
const READY = { ready: true, checks: [{ name: "link", state: "ok", found: "good" }] };
const UNREADY = { ready: false, checks: [...READY.checks, { name: "battery", state: "fail", found: "13.2 V" }, { name: "pose", state: "fail", found: "none" }] };

const PILLS = [
  [{ status: null, hasContact: false }, "NO DATA YET", "off"],
  [{ status: FLYING, hasContact: false }, "NO CONTACT", "warn"],
  [{ status: GROUND, preflight: READY }, "READY", "ready"],
  [{ status: GROUND, preflight: UNREADY }, "NOT READY", "warn"],
  [{ status: GROUND }, "MOTORS OFF", "idle"],
  [{ status: { ...GROUND, mode: "starting" } }, "STARTING", "idle"],
  [{ status: ARMED, preflight: UNREADY }, "ARMED", "armed"],
  [{ status: FLYING, airborne: 155.4 }, "FLYING 02:35", "flying"],
  [{ status: FLYING }, "FLYING", "flying"],
  [{ status: { ...FLYING, behavior: "land" }, airborne: 3 }, "LANDING", "flying"],
  [{ status: { ...ARMED, behavior: "land" } }, "ARMED", "armed"],
  [{ status: { ...FLYING, mode: "EMERGENCY_LAND", behavior: "land" } }, "EMERGENCY LANDING", "warn"],
  [{ status: ALONE }, "LANDING ALONE", "alarm"],
  [{ status: { ...FLYING, flags: ["oscillating"] }, airborne: 8 }, "OSCILLATING", "caution"],
  [{ status: { ...FLYING, flags: ["off_reference"] } }, "OFF REFERENCE", "caution"],
  [{ status: { ...ALONE, flags: ["oscillating"] } }, "LANDING ALONE", "alarm"],
  [{ status: { ...GROUND, mode: "CUT" }, preflight: READY }, "MOTORS CUT", "warn"],
  [{ status: { ...ARMED, mode: "bench" } }, "BENCH", "armed"],
];

for (const [seen, word, tone] of PILLS) {
  test(`the pill says ${word}: ${JSON.stringify(seen).slice(0, 90)}`, () => {
    assert.deepEqual(pillOf({ hasContact: true, ...seen }), { word, tone });
  });
}

test("red is only a microcontroller that lands alone", () => {
  assert.ok(PILLS.filter(([, , tone]) => tone === "alarm").every(([, word]) => word === "LANDING ALONE"));
});

const LINES = [
  [{ status: FLYING, source: "bearings", height: 1.004, error: 0.0141 }, "Hovering at 1.00 m on bearings, 14 mm error, no warnings"],
  [{ status: { ...FLYING, flags: ["on_bearings", "not_real_time"] }, source: "poses", height: 1, error: 0 }, "Hovering at 1.00 m on bearings, 0 mm error, no warnings"],
  [{ status: { ...FLYING, behavior: "FOLLOW_TRAJECTORY", flags: ["battery_low"] }, source: "poses", height: 1.5, error: 0.02, problems: ["link degraded"] },
    "Flying a trajectory at 1.50 m on the tracker, 20 mm error, battery low, 1 more warning"],
  [{ status: { ...FLYING, behavior: "FOLLOW_TRAJECTORY" }, source: "poses", height: 1.5, error: 0.02, trajectory: { elapsed: 9.4, duration: 27, laps: 3, name: "figure_eight" } },
    "Figure 8, lap 2 of 3 at 1.50 m on the tracker, 00:09 of 00:27, 20 mm error, no warnings"],
  [{ status: { ...FLYING, behavior: "FOLLOW_TRAJECTORY" }, source: "poses", height: 1.5, trajectory: { elapsed: 9.4, duration: null, laps: 3, name: "circle" } },
    "Circle at 1.50 m on the tracker, no warnings"],
  [{ status: { ...FLYING, behavior: "near_hovering", control_mode: "near_hovering" }, source: "poses", height: 1, error: 0.5 }, "Near-hovering at 1.00 m, no warnings"],
  [{ status: { ...FLYING, behavior: "my_own" } }, "My own, no warnings"],
  [{ status: SWINGING, source: "poses", height: 1.01, error: 0.292, changed: [{ name: "control.position.kp_xy", old: 4, now: 13.6 }] },
    "Hovering at 1.01 m on the tracker, 292 mm error, oscillating in y at 0.7 Hz after kp_xy 4 → 13.6"],
  [{ status: SWINGING }, "Hovering, oscillating in y at 0.7 Hz"],
  [{ status: GROUND, preflight: READY }, "On the ground, ready to arm, no warnings"],
  [{ status: GROUND, preflight: UNREADY }, "On the ground, not ready to arm: battery 13.2 V, 1 more warning"],
  [{ status: ARMED, preflight: UNREADY }, "On the ground, motors on, no warnings"],
  [{ status: ALONE }, "Emergency landing: the microcontroller lands alone; only Cut is obeyed"],
  [{ status: { ...GROUND, mode: "cut" } }, "Motors cut. Hold Disarm to acknowledge it"],
  [{ status: FLYING, hasContact: false }, ""],
];

for (const [seen, line] of LINES) {
  test(`the line says ${line || "nothing"}`, () => { assert.equal(lineOf({ hasContact: true, ...seen }), line); });
}

const STEPS = [
  [null, "arm", false], [GROUND, "arm", false], [{ ...GROUND, mode: "cut", armed: true }, "arm", false], [{ ...ARMED, mode: "bench" }, "arm", false],
  [ARMED, "take-off", true], [{ ...ARMED, behavior: "take_off" }, "land", false], [FLYING, "land", false], [ALONE, "land", false],
];

for (const [status, step, stops] of STEPS) {
  test(`the large button is ${step} when the vehicle is ${status ? `${status.mode}, ${status.behavior}` : "not known"}`, () => {
    assert.equal(nextStep(status), step);
    assert.equal(maySwitchOff(status), stops);
  });
}

test("what is flown on is said only where a place is held", () => {
  assert.equal(flownOn({ status: FLYING, hasContact: true, source: "both" }), "on poses and bearings");
  assert.equal(flownOn({ status: ALONE, hasContact: true, source: "poses" }), "");
  assert.equal(flownOn({ status: null, hasContact: false }), "");
});

test("what a press restores is named with its value", () => {
  assert.equal(restoreLabel([{ name: "control.position.kp_xy", old: 4 }]), "Restore kp_xy = 4");
  assert.equal(restoreLabel([{ name: "a.b", old: 4 }, { name: "a.c", old: 1 }]), "Restore 2 values");
});
