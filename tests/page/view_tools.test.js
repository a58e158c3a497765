import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import "./browser.js";

const { colorOf, RAMP, RANGES } = await import("../../web/static/view/path_color.js");

test("a path's colours and their ends are the same in the live view", () => {
  const python = readFileSync(new URL("../../web/view/options.py", import.meta.url), "utf8");
  for (const [signal, [low, high, unit]] of Object.entries(RANGES)) assert.match(python, new RegExp(`"${signal}": \\(${low.toFixed(1)}, ${high.toFixed(1)}, "${unit}"\\)`));
  assert.ok(python.includes(`RAMP = (${RAMP.map((rgb) => `(${rgb.join(", ")})`).join(", ")})`));
  assert.deepEqual([colorOf("speed", -1), colorOf("speed", 9)], [`rgb(${RAMP[0].join(" ")})`, `rgb(${RAMP[3].join(" ")})`]);
});

test("a view that stays slow is drawn with less, step by step, and says so; one slow sample changes nothing", async () => {
  const { LEVELS, nextLevel, words } = await import("../../web/static/view/quality.js");
  assert.equal(nextLevel(0, [9]), 0);
  assert.equal(nextLevel(0, [9, 30]), 0);
  assert.equal(nextLevel(0, [30, 9, 14]), 1);
  assert.equal(nextLevel(LEVELS.length - 1, [9, 9]), LEVELS.length - 1);
  assert.deepEqual([words(0, false, NaN), words(0, false, 60), words(1, true, 22.4), words(2, false, NaN)], ["", "", "no graphics card: reduced quality, 22 Hz", "reduced quality"]);
});

test("a window's frames are drawn apart, all that wait for the same one together, and a cancelled one never", async () => {
  const { paced } = await import("../../web/static/view/quality.js");
  const asked = new Map(), drawn = [];
  let count = 0;
  const view = { requestAnimationFrame: (draw) => { asked.set(++count, draw); return count; }, cancelAnimationFrame: (id) => asked.delete(id) };
  const show = (time) => { const now = [...asked.values()]; asked.clear(); now.forEach((draw) => draw(time)); };
  const pace = paced(view), ask = (name) => view.requestAnimationFrame((time) => drawn.push(`${name} ${time}`));
  pace.period = 42;
  ask("a");
  ask("b");
  show(100);
  assert.deepEqual(drawn.splice(0), ["a 100", "b 100"]);
  const c = ask("c");
  ask("d");
  [117, 134].forEach(show);
  assert.deepEqual(drawn, []);
  view.cancelAnimationFrame(c);
  show(150);
  assert.deepEqual(drawn.splice(0), ["d 150"]);
  pace.period = 0;
  ask("e");
  show(151);
  assert.deepEqual(drawn, ["e 151"]);
});
