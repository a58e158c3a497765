import assert from "node:assert/strict";
import { test } from "node:test";

import { until } from "./browser.js";
import { GainSender } from "../../web/static/gains/sender.js";

// A vehicle that answers when told to; `clock` stands still unless a test moves it.
function made() {
  const requests = [], states = [];
  const send = (value, walks) => new Promise((accept, refuse) => { requests.push({ value, walks, accept, refuse }); });
  const path = new GainSender(send, () => { if (states.at(-1) !== path.state) states.push(path.state); });
  return { requests, states, path, nth: (n) => until(() => requests[n]), rest: () => until(() => !path.busy) };
}

test("one request is under way, and the last value is always sent", async () => {
  const { requests, states, path, nth, rest } = made();
  for (const value of [1, 2, 3]) path.set(value);
  (await nth(0)).accept();
  assert.equal(requests.length, 1);
  const second = await nth(1);
  path.set(4);
  path.set(5, true);
  assert.equal(requests.length, 2);
  second.accept();
  (await nth(2)).accept();
  await rest();
  assert.deepEqual(requests.map(({ value, walks }) => [value, walks]), [[1, false], [3, false], [5, true]]);
  assert.deepEqual(states, ["waiting", "idle"]);
});

test("requests are at least 50 ms apart", async (context) => {
  const { path, nth, rest } = made(), pauses = [];
  context.mock.method(performance, "now", () => 1000); // it stands still: the whole pause is waited for
  const later = globalThis.setTimeout;
  context.mock.method(globalThis, "setTimeout", (act, pause = 0) => { if (pause) pauses.push(pause); return later(act); });
  path.set(1);
  (await nth(0)).accept();
  await rest();
  path.set(2);
  (await nth(1)).accept();
  await rest();
  assert.ok(pauses.includes(50));
});

test("a refusal stays until something is accepted", async () => {
  const { path, nth, rest } = made();
  path.set(9);
  (await nth(0)).refuse(new Error("allowed 0 to 5"));
  await rest();
  assert.deepEqual([path.state, path.reason, path.refused], ["refused", "allowed 0 to 5", 9]);
  path.set(4);
  assert.equal(path.reason, "allowed 0 to 5");
  (await nth(1)).accept();
  await rest();
  assert.deepEqual([path.state, path.reason], ["idle", ""]);
});

test("it is late without an answer, and no more once it comes", async () => {
  const { states, path, nth, rest } = made();
  path.set(1);
  const first = await nth(0);
  await until(() => path.state === "late", 1e6);
  first.accept();
  await rest();
  assert.deepEqual(states, ["waiting", "late", "idle"]);
});
