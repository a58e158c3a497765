import assert from "node:assert/strict";
import { test } from "node:test";

import { query, spanOf, state } from "../../web/static/runs/labels.js";
import { chooseZone } from "../../web/static/core/time_zone.js";

test("a date is from its first moment to the one after its last, by this browser's clock", () => {
  const at = (...parts) => new Date(...parts).getTime();
  assert.deepEqual(spanOf("2026-01-31"), [at(2026, 0, 31), at(2026, 1, 1)]);
  assert.deepEqual(spanOf("2026-02"), [at(2026, 1, 1), at(2026, 2, 1)]);
  assert.deepEqual(spanOf("2026"), [at(2026, 0, 1), at(2027, 0, 1)]);
  assert.deepEqual(spanOf("2026-01..2026-03-05"), [at(2026, 0, 1), at(2026, 2, 6)]);
});

test("what is no date is a word", () => {
  for (const word of ["gust", "2026-13", "1999", "2026..", "2026-02..2026-01", "2026..2027..2028"]) assert.equal(spanOf(word), null);
  const found = query("  gusty 2026 anna ", "wind", "quad2");
  assert.deepEqual([found.get("words"), found.get("tag"), found.get("vehicle")], ["gusty anna", "wind", "quad2"]);
  assert.equal(found.get("since_ns"), `${new Date(2026, 0, 1).getTime()}000000`);
});

test("the state of a run has a word and never only a colour", () => {
  const runs = [{ recording: true }, { problem: "torn" }, { completeness: { state: "missing", missing: 2 } },
    { completeness: { state: "filled", filled: 0.01 } }, { recovered: true }, { complete: true }, {}];
  const words = runs.map((run) => state(run)[0]);
  assert.deepEqual(words, ["● recording", "problem", "2.0 s missing", "complete (< 0.1 s restored)", "recovered", "closed", "not closed"]);
});

test("a day lasts as long as it does in the chosen zone: 23 hours, 25, or 24 in UTC", () => {
  const before = process.env.TZ, hours = (/** @type {string} */ word) => { const [from, to] = spanOf(word) ?? []; return (to - from) / 36e5; };
  process.env.TZ = "Europe/Rome";
  try {
    assert.deepEqual(["2026-03-29", "2026-10-25", "2026-06-01"].map(hours), [23, 25, 24]);
    chooseZone("utc");
    assert.deepEqual(spanOf("2026-03-29"), [Date.UTC(2026, 2, 29), Date.UTC(2026, 2, 30)]);
  } finally {
    chooseZone("");
    if (before === undefined) delete process.env.TZ;
    else process.env.TZ = before;
  }
});
