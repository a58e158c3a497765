import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

const { TouchSticks, deflection } = await import("../../web/static/sticks/touch.js");
const [LEFT, RIGHT] = [0, 1];

test("a finger's first place is the centre, and a stick is full at its reach and no further", () => {
  assert.deepEqual(deflection([100, 100], [100, 100]), [0, 0]);
  assert.deepEqual(deflection([100, 100], [44, 500]), [1, -1]);
});

test("the left pad climbs and turns, the right one moves; up and left are positive", () => {
  const touch = new TouchSticks();
  touch.press(LEFT, 1, [50, 200]);
  touch.press(RIGHT, 2, [300, 200]);
  assert.ok(touch.deadMan);
  assert.deepEqual(touch.axes, [0, 0, 0, 0], "centred at the touch");
  touch.move(LEFT, 1, [50 - 56, 200 - 56]);
  touch.move(RIGHT, 2, [300 + 56, 200 - 56]);
  assert.deepEqual(touch.axes, [1, -1, 1, 1]);
});

test("a lifted finger centres its pad, and the last one lets go of the button", () => {
  const touch = new TouchSticks();
  touch.press(LEFT, 1, [0, 0]);
  touch.press(RIGHT, 2, [0, 0]);
  touch.move(RIGHT, 2, [0, -56]);
  touch.lift(RIGHT, 1); // another finger's
  assert.equal(touch.axes[0], 1);
  touch.lift(RIGHT, 2);
  assert.deepEqual([touch.deadMan, touch.axes], [true, [0, 0, 0, 0]]);
  touch.lift(LEFT, 1);
  assert.ok(!touch.deadMan);
});

test("after a drop a finger that stayed down moves nothing until it was lifted and put down again", () => {
  const touch = new TouchSticks();
  touch.press(RIGHT, 2, [0, 0]);
  touch.clear();
  touch.move(RIGHT, 2, [0, -56]);
  assert.deepEqual([touch.deadMan, touch.axes], [false, [0, 0, 0, 0]]);
  touch.press(RIGHT, 2, [0, 0]);
  assert.ok(touch.deadMan);
});
