import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";
import { History, Series, indexAt } from "../../web/static/charts/history.js";

class Feed extends EventTarget {
  origin = 1e9; charted = []; topicOf = new Map(["a", "b", "c"].map((name) => [name, name === "c" ? "battery" : "state"]));

  chart(series) { this.charted.push(series.map(({ names, last }) => [names, last])); }
}

const add = (series, times, ...columns) => series.add(Float64Array.from(times), columns.map((one) => Float32Array.from(one)));
const of = (history, name) => { const one = history.of(name); return [...one.columns.get(name).slice(one.start, one.end)]; };

test("a series holds ten minutes in one piece, in memory that stays", () => {
  const series = new Series(["a"]);
  for (let i = 0; i < 60 * 60 * 16; i += 20) {
    const steps = Array.from({ length: 20 }, (_, k) => i + k);
    add(series, steps.map((k) => k / 16), steps);
    const { start, end, times } = series, column = series.columns.get("a");
    assert.equal(end - start, Math.min(i + 20, 600 * 16 + 1));
    assert.deepEqual([times[end - 1], column[end - 1], column[start]], [(i + 19) / 16, i + 19, i + 19 - (end - start) + 1]);
  }
  assert.ok(series.times.length < 5 * 600 * 16);
});

test("signals are asked for together with others of their topic, and go on from where they are", () => {
  const feed = new Feed(), history = new History(feed);
  history.want("me", ["a", "c"]);
  assert.deepEqual(feed.charted.at(-1), [[["a"], undefined], [["c"], undefined]]);
  add(history.of("a"), [1, 2], [5, 6]);
  history.want("you", ["a", "b"]);
  assert.deepEqual(feed.charted.at(-1), [[["a"], 2], [["c"], undefined], [["b"], undefined]]);
  assert.deepEqual(of(history, "a"), [5, 6]);
  const asked = feed.charted.length;
  history.want("third", ["a", "b"]); // nothing new
  assert.equal(feed.charted.length, asked);
  history.want("me", []);
  assert.deepEqual(feed.charted.at(-1), [[["a"], 2], [["b"], undefined]]);
});

test("holes are kept as long as the samples around them", () => {
  const series = new Series(["a"]);
  series.add(Float64Array.of(1, 1.5, 2), [Float32Array.of(1, NaN, 2)], [{ t: 1.5, count: 15 }]);
  assert.deepEqual(series.holes, [{ t: 1.5, count: 15 }]);
  add(series, [700], [1]);
  assert.deepEqual(series.holes, []);
});

test("a vehicle's clock that begins anew begins everything anew", () => {
  const feed = new Feed(), history = new History(feed);
  history.want("me", ["a"]);
  add(history.of("a"), [1, 2], [5, 6]);
  const asked = feed.charted.length;
  feed.dispatchEvent(new Event("origin"));
  assert.deepEqual([of(history, "a"), feed.charted.length], [[], asked]); // the server knows
  add(history.of("a"), [0.5], [7]);
  assert.deepEqual(of(history, "a"), [7]);
});

test("a frozen copy stays as it is", () => {
  const history = new History(new Feed());
  history.want("me", ["a"]);
  add(history.of("a"), [2, 3], [2, 3]);
  const frozen = history.freeze();
  add(history.of("a"), [4, 5], [4, 5]);
  assert.deepEqual([...frozen.of("a").times], [2, 3]);
  assert.deepEqual([of(frozen, "a"), of(history, "a")], [[2, 3], [2, 3, 4, 5]]);
  assert.deepEqual([frozen.first, frozen.origin], [2, 1e9]);
});

test("an index is found for each time", () => {
  const times = [0, 1, 1, 4];
  for (const time of [-1, 0, 0.5, 1, 2, 4, 5]) {
    const found = times.findIndex((one) => one >= time);
    assert.equal(indexAt(times, time, 0, 4), found < 0 ? 4 : found);
  }
});
