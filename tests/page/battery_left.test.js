import assert from "node:assert/strict";
import { test } from "node:test";

import { BatteryLeft } from "../../web/static/console/battery_left.js";

/** @param {BatteryLeft} left @param {number} from @param {number} to @param {number} start @param {number} slope */
function fly(left, from, to, start, slope) {
  for (let t = from; t <= to; t += 1) left.add(t, start + slope * (t - from) + (t % 2 ? 0.02 : -0.02), true);
}

test("minutes are those until the fitted voltage meets the limit", () => {
  const left = new BatteryLeft();
  fly(left, 0, 40, 15, -0.002);
  assert.equal(left.minutes(13.8), null, "too short a flight");
  fly(left, 41, 120, 15 - 0.002 * 41, -0.002);
  const minutes = left.minutes(13.8) ?? NaN;
  assert.ok(Math.abs(minutes - (15 - 0.24 - 13.8) / 0.002 / 60) < 0.3, String(minutes));
});

test("another battery, and a landing, begin anew", () => {
  const left = new BatteryLeft();
  fly(left, 0, 100, 15, -0.002);
  left.add(101, 16.5, true);
  assert.equal(left.minutes(13.8), null);
  fly(left, 102, 200, 16.5, -0.002);
  assert.notEqual(left.minutes(13.8), null);
  left.add(201, 16.2, false);
  assert.equal(left.minutes(13.8), null);
});

test("a voltage that does not fall, or falls for hours, says nothing; below the limit no time is left", () => {
  const rising = new BatteryLeft(), slow = new BatteryLeft(), spent = new BatteryLeft();
  fly(rising, 0, 100, 15, 0.001);
  fly(slow, 0, 100, 15, -0.0001);
  fly(spent, 0, 100, 13.7, -0.002);
  assert.deepEqual([rising, slow, spent].map((one) => one.minutes(13.8)), [null, null, 0]);
});
