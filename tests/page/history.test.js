import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";
import { History, indexAt } from "../../web/static/charts/history.js";

class Feed extends EventTarget {
  wanted = {};

  want(who, names) { this.wanted[who] = names; }

  frame(time, value) { this.dispatchEvent(new CustomEvent("frame", { detail: { time, value } })); }
}

function made(capacity = 100) {
  const feed = new Feed(), history = new History(feed, capacity);
  return { feed, history, of: (name) => [...history.column(name).slice(history.start, history.end)] };
}

test("the history holds the newest, in one piece", () => {
  const { feed, history } = made();
  history.want("me", ["a"]);
  for (let i = 0; i < 1050; i++) {
    feed.frame(i / 25, { a: i });
    const { start, end, times } = history, column = history.column("a");
    assert.equal(end - start, Math.min(i + 1, 100));
    assert.deepEqual([times[end - 1], column[end - 1], column[start]], [i / 25, i, Math.max(0, i - 99)]);
  }
});

test("what came of a signal stays when no chart shows it", () => {
  const { feed, history, of } = made();
  const come = (from, to, names) => {
    for (let i = from; i < to; i++) feed.frame(i, Object.fromEntries(names.map((name) => [name, i])));
  };
  history.want("me", ["a"]);
  come(0, 10, ["a", "tabled"]);
  history.want("me", ["tabled"]); // another layout
  come(10, 20, ["tabled"]);
  history.want("me", ["a", "tabled"]);
  come(20, 30, ["a", "tabled"]);
  const numbers = (from, to) => Array.from({ length: to - from }, (_, i) => from + i);
  assert.deepEqual(of("tabled"), numbers(0, 30)); // it came for the table before a chart showed it
  assert.deepEqual(of("a").filter((value) => !Number.isNaN(value)), [...numbers(0, 10), ...numbers(20, 30)]);
  for (let n = 0; n < 300; n++) come(30 + n, 31 + n, ["a", "tabled", `other ${n}`]);
  assert.ok(history.columns.size < 100);
  assert.notEqual(history.column("a"), undefined);
});

test("what did not come is no number, and no frame is older than the one before", () => {
  const { feed, history, of } = made();
  history.want("me", ["a"]);
  feed.frame(1, { a: 5 });
  feed.dispatchEvent(new Event("close"));
  feed.frame(2, { a: NaN });
  history.want("you", ["b"]);
  feed.frame(3, { a: 7, b: 8 });
  feed.frame(2.9, { a: 9, b: 9 });
  assert.deepEqual(of("a"), [5, NaN, NaN, 7]);
  assert.deepEqual(of("b"), [NaN, NaN, NaN, 8]);
  assert.equal(history.last, 3);
});

test("a clock that was set back starts afresh", () => {
  const { feed, history, of } = made();
  for (const time of [100, 101, 50, 51]) feed.frame(time, { a: time });
  assert.deepEqual(of("a"), [50, 51]);
  assert.equal(history.last, 51);
});

test("a frozen copy stays as it is", () => {
  const { feed, history } = made(4);
  for (let i = 0; i < 6; i++) feed.frame(i, { a: i });
  const frozen = history.freeze();
  for (let i = 6; i < 20; i++) feed.frame(i, { a: i });
  assert.deepEqual([...frozen.times], [2, 3, 4, 5]);
  assert.deepEqual([...frozen.column("a")], [2, 3, 4, 5]);
});

test("the wishes of all are asked for once, and taken back", () => {
  const { feed, history } = made();
  history.want("me", ["a", "b"]);
  history.want("you", ["b", "c"]);
  assert.deepEqual(feed.wanted.charts, ["a", "b", "c"]);
  history.want("me", []);
  assert.deepEqual(feed.wanted.charts, ["b", "c"]);
});

test("an index is found for each time", () => {
  const times = [0, 1, 1, 4];
  for (const time of [-1, 0, 0.5, 1, 2, 4, 5]) {
    const found = times.findIndex((one) => one >= time);
    assert.equal(indexAt(times, time, 0, 4), found < 0 ? 4 : found);
  }
});
