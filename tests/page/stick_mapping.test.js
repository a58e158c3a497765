import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import "./browser.js";
import { forget, isPressed, mappingOf, preset, presetOf, PRESETS, readPad, remember, shape } from "../../web/static/sticks/mapping.js";

const released = () => Array.from({ length: 17 }, () => ({ pressed: false, value: 0 }));
const pad = (axes = [0, 0, 0, 0], buttons = released()) => ({ id: "pad", mapping: "standard", axes, buttons });

beforeEach(() => localStorage.clear());

test("a standard pad is Mode 2 until it is set up; another one must be set up", () => {
  assert.equal(presetOf(mappingOf(pad())), "Mode 2");
  assert.equal(mappingOf({ ...pad(), mapping: "" }), null);
});

test("what is remembered is used for this kind of pad, and forgotten again", () => {
  remember(pad(), { ...preset("Mode 1"), expo: 0.7 });
  assert.equal(mappingOf(pad()).expo, 0.7);
  assert.equal(mappingOf({ ...pad(), id: "another" }).expo, 0.3);
  forget(pad());
  assert.equal(mappingOf(pad()).expo, 0.3);
});

test("what storage holds is not trusted", () => {
  const good = preset("Mode 1");
  const bad = ["{", "null", "[]", { ...good, expo: 2 }, { ...good, deadZone: -0.1 }, { ...good, buttons: {} },
    { ...good, axes: { ...good.axes, yaw: { index: 1.5, inverted: true } } }];
  for (const kept of bad) {
    localStorage.setItem("quadlab.sticks.pad", typeof kept === "string" ? kept : JSON.stringify(kept));
    assert.equal(presetOf(mappingOf(pad())), "Mode 2");
  }
});

test("inside the dead zone is zero, full stick is one, and between it only grows", () => {
  for (const mapping of [{ deadZone: 0, expo: 0 }, { deadZone: 0.08, expo: 0.3 }, { deadZone: 0.3, expo: 1 }]) {
    assert.equal(Math.abs(shape(mapping.deadZone, mapping)), 0);
    assert.ok(Math.abs(shape(1, mapping) - 1) < 1e-12);
    let before = -1;
    for (let value = -1; value <= 1.0001; value += 0.05) {
      const now = shape(Math.min(1, value), mapping);
      assert.ok(now >= before - 1e-12);
      assert.ok(Math.abs(now + shape(-Math.min(1, value), mapping)) < 1e-12);
      before = now;
    }
  }
});

test("sticks are read in our directions, and a missing axis is centred", () => {
  for (const name of PRESETS) {
    const mapping = { ...preset(name), deadZone: 0, expo: 0 }, axes = [0, 0, 0, 0];
    axes[mapping.axes.forward.index] = -1; // pushed away from the hand
    axes[mapping.axes.yaw.index] = 0.5; // to the right
    assert.deepEqual(readPad(pad(axes), mapping).raw.map((value) => value + 0), [1, 0, 0, -0.5]);
    assert.deepEqual(readPad(pad([]), mapping).axes.map((value) => value + 0), [0, 0, 0, 0]);
  }
});

test("a button counts as pressed by its state or half its way", () => {
  const buttons = released();
  buttons[5].value = 0.6;
  const read = readPad(pad(undefined, buttons), preset("Mode 2"));
  assert.deepEqual([read.deadMan, read.land, read.cut], [true, false, false]);
  assert.equal(isPressed(pad(), 99), false);
});
