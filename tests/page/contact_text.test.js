import assert from "node:assert/strict";
import { test } from "node:test";

import { byItself, lastState } from "../../web/static/link/contact_text.js";

const SAFETY = { link_timeout: 0.4, link_reaction: "brake", link_land_after: 2, link_land_reaction: "land", command_timeout: 0.25 };
const STATUS = { mode: "ARMED", behavior: "hover", armed: true, airborne: true };

const CASES = [
  ["link", 0.3, {}, /brakes and hovers 0\.1 s from now, and lands 2\.0 s later/],
  ["station", 1.0, {}, /braking.* lands in 1\.4 s/],
  ["link", 5.0, {}, /landing now, for 2\.6 s/],
  ["flight", 5.0, {}, /microcontroller lands it alone after 0\.25 s/],
  ["page", 5.0, {}, /does not depend on this page/],
  ["link", 5.0, { mode: "emergency_land" }, /continues its landing/],
  ["link", 5.0, { airborne: false }, /motors keep turning/],
  ["link", 5.0, { airborne: false, armed: false }, /does nothing/],
];

for (const [cause, silent, is, expected] of CASES) {
  test(`what the vehicle does by itself follows its safety parameters: ${cause}, ${silent} s, ${JSON.stringify(is)}`, () => {
    assert.match(byItself(cause, { ...STATUS, ...is }, silent, (name) => SAFETY[name]), expected);
  });
}

test("what is not known is not guessed", () => {
  assert.equal(byItself("link", null, 1, () => undefined), "");
  assert.match(byItself("link", STATUS, 1, () => undefined), /not known here/);
});

test("the last state says where it was, how high and on which voltage", () => {
  assert.equal(lastState(null), "never seen");
  assert.equal(lastState(STATUS, 1.26, { voltage: 15.55 }), "flying, hover, at 1.3 m, 15.6 V");
  assert.equal(lastState({ ...STATUS, airborne: false }, NaN, null), "on the ground, motors on");
});
