import assert from "node:assert/strict";
import { test } from "node:test";

import "../../../../tests/page/browser.js";

const { PlayHead, SPEEDS, stamp } = await import("../../page/replay/play_head.js");
const { Range } = await import("../../page/replay/range.js");

let drawn = () => {};
globalThis.requestAnimationFrame = (act) => { drawn = act; };

function made() {
  const clock = new PlayHead();
  clock.setRange(0, 100);
  return clock;
}

test("the play-head stays in the run and moves at its speed, forwards and backwards", (context) => {
  let now = 1000;
  context.mock.method(performance, "now", () => now);
  const clock = made();
  clock.seek(50);
  clock.setSpeed(2);
  clock.play(1);
  drawn(now += 100);
  assert.ok(Math.abs(clock.t - 50.2) < 1e-9);
  clock.play(-1);
  drawn(now += 100);
  assert.ok(Math.abs(clock.t - 50) < 1e-9);
  clock.seek(1e6);
  assert.equal(clock.t, 100);
});

test("a tab that was hidden goes on where it was, and the end stops it", (context) => {
  let now = 0;
  context.mock.method(performance, "now", () => now);
  const clock = made();
  clock.seek(10);
  clock.play(1);
  drawn(now += 60_000);
  assert.ok(clock.t <= 10.25 + 1e-9);
  clock.seek(99.9);
  drawn(now += 250);
  assert.deepEqual([clock.t, clock.playing], [100, false]);
  clock.play(1); // from the end it begins again
  assert.equal(clock.t, 0);
});

test("speeds go through the list and no further", () => {
  const clock = made();
  clock.faster(-99);
  assert.equal(clock.speed, SPEEDS[0]);
  clock.faster(99);
  assert.equal(clock.speed, SPEEDS.at(-1));
});

test("a stamp carries over and has no negative zero", () => {
  assert.deepEqual([0, 59.9996, 61.5, 3661.25, -1.5, -0.0001].map((t) => stamp(t)), ["0:00.000", "1:00.000", "1:01.500", "1:01:01.250", "−0:01.500", "0:00.000"]);
  assert.equal(stamp(59.6, 0), "1:00");
});

test("charts show all, or seconds about the play-head, or turn a drawn piece's page", () => {
  const clock = made(), range = new Range(clock), shown = () => [range.start, range.end];
  clock.setRange(0, 60);
  assert.deepEqual(shown(), [0, 60]);
  range.setWidth(10);
  clock.seek(30);
  assert.deepEqual(shown(), [25, 35]);
  range.show(29, 31);
  clock.seek(30.5);
  assert.deepEqual(shown(), [29, 31]);
  clock.seek(40);
  assert.ok(range.start <= 40 && range.end >= 40 && Math.abs(range.end - range.start - 2) < 1e-9);
  range.show(-500, 500); // as much as there is: all of it
  assert.deepEqual([...shown(), range.isZoomed], [0, 60, false]);
});
