import assert from "node:assert/strict";
import { test } from "node:test";

import { extent, spread, stylesOf, trace } from "../../../web/static/charts/lines.js";

globalThis.Path2D = class {
  moves = [];

  moveTo(x, y) { this.moves.push(["m", x, y]); }

  lineTo(x, y) { this.moves.push(["l", x, y]); }
};

test("a line is broken where a value is missing, and a sample alone is a dot", () => {
  const times = [0, 0.1, 0.2, 0.3, 0.9, 1.0], values = [1, 2, NaN, 4, NaN, 6];
  const { path, end } = trace(times, values, 0, 6, (time) => 100 * time, (value) => value);
  assert.deepEqual(path.moves, [["m", 0, 1], ["l", 10, 2], ["m", 30, 4], ["l", 31, 4], ["m", 100, 6], ["l", 101, 6]]);
  assert.deepEqual(end, [100, 6]);
});

test("many samples of a pixel keep their extremes", () => {
  const count = 3000, times = [], values = [];
  for (let i = 0; i < count; i++) { times.push(i * 1e-3); values.push(i === 1234 ? 50 : i % 2); }
  const ys = trace(times, values, 0, count, (time) => 10 * time, (value) => value).path.moves.map(([, , y]) => y);
  assert.equal(Math.max(...ys), 50);
  assert.equal(Math.min(...ys), 0);
  assert.ok(ys.length <= 4 * 31);
});

test("extremes are of what is finite, and widen those given", () => {
  assert.deepEqual(extent([NaN, 3, -2, Infinity, 9], 0, 4), [-2, 3]);
  assert.deepEqual(extent([NaN], 0, 1), [null, null]);
  assert.deepEqual(extent([1], 0, 1, 0, 5), [0, 5]);
});

test("an axis shows noise as noise, and leaves air about what is larger", () => {
  const [low, high] = spread(1, 1.0001, "m");
  assert.ok(high - low >= 0.02 - 1e-12);
  assert.deepEqual(spread(null, null, "m"), [-1, 1]);
  const [least, most] = spread(0, 100, "m");
  assert.ok(least < 0 && most > 100);
});

test("no two lines of a chart look the same", () => {
  const names = ["state.position.x", "reference.position.x", "truth.position.x", "state.velocity.x", "thrust", "mass", "nis"];
  const looks = stylesOf(names).map((style) => JSON.stringify(style));
  assert.equal(new Set(looks).size, names.length);
});
