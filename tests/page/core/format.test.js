import assert from "node:assert/strict";
import { test } from "node:test";

import { bytes, clock, day, digitsOf, duration, exact, fixed, minute, moment, NONE, seconds, words } from "../../../web/static/core/format.js";
import { chooseZone } from "../../../web/static/core/time_zone.js";

test("what is not known is a dash", () => {
  for (const unknown of [null, undefined, NaN, Infinity]) {
    for (const show of [fixed, seconds, duration, bytes]) assert.equal(show(unknown, 2), NONE);
  }
  assert.equal(words(""), NONE);
});

test("a number has the minus sign of print, and zero has none", () => {
  assert.equal(fixed(-1.25, 1), "−1.3");
  assert.equal(fixed(-0.001, 2), "0.00");
  assert.equal(fixed(3, 0), "3");
});

test("times go from milliseconds over seconds to a clock", () => {
  assert.deepEqual([0.0123, 0.9994, 0.9995, 99.94, 100, 3661].map(seconds), ["12 ms", "999 ms", "1.0 s", "99.9 s", "01:40", "1:01:01"]);
});

test("sizes are in kB, MB and GB with two digits at least", () => {
  assert.deepEqual([500, 9_990, 12_345, 1.5e6, 2.5e7, 3.21e9].map(bytes), ["0.5 kB", "10.0 kB", "12 kB", "1.5 MB", "25 MB", "3.21 GB"]);
});

test("digits are as many as a step needs", () => {
  assert.deepEqual([1, 0.5, 0.1, 0.05, 0.001, 1e-9, 10].map(digitsOf), [0, 1, 1, 2, 3, 7, 0]);
});

test("exact values keep seven digits, other types their text", () => {
  assert.deepEqual([0.1 + 0.2, 4, true, "nominal"].map(exact), ["0.3", "4", "true", "nominal"]);
});

test("names are words", () => {
  assert.deepEqual(["NEAR_HOVERING", "take_off"].map(words), ["near-hovering", "take off"]);
});

test("a time is written in the chosen zone, and says so in UTC", () => {
  const at = Date.UTC(2026, 11, 31, 23, 59, 58, 120) / 1e3;
  chooseZone("utc");
  assert.deepEqual([clock(at), clock(at, 2), moment(at), minute(at), day(at)],
    ["23:59:58Z", "23:59:58.12Z", "2026-12-31 23:59:58Z", "2026-12-31 23:59Z", "2026-12-31"]);
  chooseZone("");
  const local = new Date(2026, 0, 2, 3, 4, 5);
  assert.deepEqual([clock(local), moment(local)], ["03:04:05", "2026-01-02 03:04:05"]);
});
