import assert from "node:assert/strict";
import { test } from "node:test";

import "../browser.js";
import { LONGEST, SHORTEST, TimeAxis } from "../../../web/static/charts/time_axis.js";

function made(context) {
  const clock = { ms: 0 };
  context.mock.method(performance, "now", () => clock.ms);
  const telemetry = new EventTarget(), frozen = { first: 900, origin: 1e9 };
  const axis = new TimeAxis({ telemetry, freeze: () => frozen }, 30);
  telemetry.dispatchEvent(new CustomEvent("frame", { detail: { time: 1000 } }));
  return { axis, clock };
}

test("it runs on while nothing comes, and stands while paused", (context) => {
  const { axis, clock } = made(context);
  clock.ms = 100;
  assert.deepEqual(axis.span, [970, 1000]); // three frames are nothing
  clock.ms = 2000;
  assert.deepEqual(axis.span, [972, 1002]);
  axis.pause();
  clock.ms = 5000;
  assert.deepEqual([axis.span, axis.pausedFor], [[972, 1002], 3]);
  axis.resume();
  assert.deepEqual(axis.span, [975, 1005]);
});

test("a window has a least and a greatest length", (context) => {
  const { axis } = made(context);
  axis.setWindow(0);
  assert.equal(axis.window, SHORTEST);
  axis.setWindow(1e9);
  assert.equal(axis.window, LONGEST);
  axis.reset();
  assert.equal(axis.window, 30);
});

test("what runs is scaled about now, what is paused about the pointer", (context) => {
  const { axis } = made(context);
  axis.scale(0.5, 990);
  assert.deepEqual([axis.window, axis.zoom], [15, null]);
  axis.pause();
  axis.scale(0.5, 995);
  const [from, to] = axis.span;
  assert.ok(Math.abs(to - from - 7.5) < 1e-9);
  assert.ok(Math.abs((995 - from) / (to - from) - (995 - 985) / 15) < 1e-9); // it stays where it is
});

test("panning pauses, and does not leave what there is", (context) => {
  const { axis } = made(context);
  axis.pan(-5);
  assert.ok(axis.paused);
  assert.deepEqual(axis.span, [965, 995]);
  axis.pan(1e6);
  assert.ok(axis.span[0] < 1000);
  axis.pan(-1e6);
  assert.ok(axis.span[1] > 900);
});
