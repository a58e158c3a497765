import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

const { consistencyOf } = await import("../../web/static/console/consistency.js");

const GOOD = { consistency: 1.02, refused_share: 0, accelerometer_noise_scale: 3, gyroscope_noise_scale: 1, measurement_noise_scale: 1 };

test("one word tells whether estimate and measurements agree, the tip has the numbers", () => {
  const { word, tip } = consistencyOf([], GOOD);
  assert.equal(word, "consistent");
  assert.match(tip, /1\.0 times.* 0 % refused.*accelerometer × 3\.0/);
  assert.equal(consistencyOf([], { ...GOOD, consistency: 3.5 }).word, "inconsistent");
  assert.equal(consistencyOf([], { ...GOOD, refused_share: 0.6 }).word, "inconsistent");
  assert.equal(consistencyOf(["estimate_drifted"], GOOD).word, "drifted");
  assert.equal(consistencyOf(["rescued"], GOOD).word, "on the shadow");
});

test("an estimator without a covariance is judged by its flags alone", () => {
  assert.equal(consistencyOf([], { ...GOOD, consistency: null, refused_share: null }).word, "consistent");
  assert.equal(consistencyOf(["estimate_drifted"], null).word, "drifted");
});
