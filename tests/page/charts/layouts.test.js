import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import "../browser.js";

const { BUILT_IN, checked, Layouts } = await import("../../../web/static/charts/layouts.js");

const SIGNALS = new Map([["a", { unit: "m" }], ["b", { unit: "V" }]]);
const layout = (...charts) => ({ window: 30, charts: charts.map((signals) => ({ signals, scales: {} })) });

beforeEach(() => localStorage.clear());

test("a layout from outside is checked before it is used", () => {
  assert.deepEqual(checked(layout(["a", "a"], ["b"]), SIGNALS).charts.map(({ signals }) => signals), [["a"], ["b"]]);
  const bad = [null, {}, layout(), layout([], [], [], [], []), { ...layout(["a"]), window: 1 }, layout(["unknown"]), { window: 30, charts: [{}] }];
  for (const given of bad) assert.throws(() => checked(given, SIGNALS));
});

test("view, limits, statistics and event lines of a chart are kept, and nothing else", () => {
  const [chart] = checked({ window: 30, charts: [{ signals: ["a"], scales: {}, view: "xy", limits: { m: 1.5, V: 2, N: "x" }, hasFigures: true, hasEvents: 1, more: 3 }] }, SIGNALS).charts;
  assert.deepEqual(chart, { signals: ["a"], scales: {}, view: "xy", limits: { m: 1.5 }, hasFigures: true });
  assert.deepEqual(checked({ window: 30, charts: [{ signals: ["a"], view: "pie" }] }, SIGNALS).charts, [{ signals: ["a"], scales: {} }]);
});

test("a layout with a derived signal that was forgotten is kept without it", () => {
  assert.deepEqual(checked(layout(["a", "= gone"]), SIGNALS).charts[0].signals, ["a"]);
});

test("the derived signals of a file that are not known yet can be made first", () => {
  const layouts = new Layouts(new Map([...SIGNALS, ["= a", { unit: "m" }]]));
  layouts.save("mine", layout(["= a", "b"]));
  assert.deepEqual(new Layouts(SIGNALS).derivedOf(layouts.file), ["= a"]);
  assert.deepEqual(layouts.derivedOf(layouts.file), []);
});

test("layouts are kept by name in this browser, never over a built-in one", () => {
  const layouts = new Layouts(SIGNALS);
  layouts.save("mine", layout(["a"]));
  assert.deepEqual(new Layouts(SIGNALS).names, ["mine"]);
  for (const name of [Object.keys(BUILT_IN)[0], "", "__proto__", "x".repeat(41)]) assert.throws(() => layouts.save(name, layout(["a"])));
  layouts.remove("mine");
  assert.deepEqual(new Layouts(SIGNALS).names, []);
});

test("a file brings all of its layouts or none", () => {
  const layouts = new Layouts(SIGNALS);
  layouts.save("mine", layout(["a"]));
  const { file } = layouts, other = new Layouts(SIGNALS);
  other.remove("mine");
  assert.deepEqual(other.take(file), ["mine"]);
  assert.throws(() => other.take("{"));
  assert.throws(() => other.take('{"format": "another"}'));
  assert.throws(() => other.take(file.replace('"a"', '"unknown"')), /mine/);
  assert.deepEqual(other.of("mine").charts[0].signals, ["a"]);
});

test("what another version left in storage is no error", () => {
  localStorage.setItem("charts.layouts", "{");
  localStorage.setItem("charts.now", '{"name": "x", "layout": {}}');
  const layouts = new Layouts(SIGNALS);
  assert.deepEqual([layouts.names, layouts.last.name], [[], "Tracking"]);
});
