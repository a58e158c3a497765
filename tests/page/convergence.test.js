import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

const { convergenceOf } = await import("../../web/static/beacons/convergence.js");

const READY = { shadow_lack: 4, shadow_share: 1, shadow_ready: 4.2, shadow_deviation: 0.0123, shadow_distance: 0.031 };

test("deviation, distance and what is lacking are told, and nothing without an estimator in parallel", () => {
  assert.equal(convergenceOf(undefined), null);
  assert.equal(convergenceOf({ shadow_lack: 0 }), null);
  const ready = convergenceOf(READY);
  assert.equal(ready.lack, "");
  assert.match(ready.text, /^σ 12 mm · 31 mm apart · ready for 4 s$/);
  assert.equal(convergenceOf({ ...READY, shadow_lack: 3 }).lack, "too far away");
});

test("an estimator that states no deviation has none, and one without measurements no figures", () => {
  assert.equal(convergenceOf({ ...READY, shadow_deviation: null }).text, "31 mm apart · ready for 4 s");
  assert.equal(convergenceOf({ ...READY, shadow_lack: 1, shadow_share: 0 }).text, "no measurement in time");
});
