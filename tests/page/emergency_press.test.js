import assert from "node:assert/strict";
import { test } from "node:test";

import { until } from "./browser.js";

const { EmergencyPress } = await import("../../web/static/emergency/press.js");

test("an answer to an older press does not hide the newer one", async (context) => {
  const asked = []; // the questions to the page's server, in their order
  context.mock.method(globalThis, "fetch", (path) => new Promise((done) => {
    asked.push({ path, answer: (body) => done(new Response(JSON.stringify(body), { status: 200 })) });
  }));
  const nth = (kind, n) => until(() => asked.filter(({ path }) => path.includes(kind))[n]);
  const told = (id, action, phase) => ({ emergency: { id, action, phase, by: "", age: 0.5, after: 0.4, reason: "", try: 1, tries: 3 } });
  const events = { connected: false, summary: {}, age: () => 0, on() {} }; // they do not come: it asks
  const press = new EmergencyPress(events, "");
  press.press("land");
  (await nth("emergency", 0)).answer({ id: "older" });
  const late = await nth("summary", 0), before = asked.length;
  const pressed = press.press("cut");
  await until(() => asked.length > before);
  asked.at(-1).answer({ id: "newer" });
  await pressed;
  (await nth("summary", 1)).answer(told("newer", "cut", "acknowledged"));
  await until(() => press.state.said.startsWith("motors cut"));
  late.answer(told("older", "land", "sent"));
  for (let turn = 0; turn < 20; turn++) await new Promise((done) => { setTimeout(done); });
  assert.equal(press.state.said, "motors cut, acknowledged after 0.40 s");
});

test("a press that nobody answers says after a second what else lands, a refused one does not", async (context) => {
  let now = 5000, age = 0;
  context.mock.method(performance, "now", () => now);
  context.mock.method(globalThis, "fetch", () => new Promise(() => {}));
  const told = new Map();
  const summary = { status: { armed: true } };
  const press = new EmergencyPress({ connected: true, summary, age: () => age, on: (kind, take) => told.set(kind, take) }, "anna");
  press.press("land");
  assert.equal(press.state.said, "Emergency land: not acknowledged");
  now += 1100;
  assert.equal(press.state.said, "Emergency land: not acknowledged; Ctrl-C in quadlab's terminal lands, too");
  const failed = { id: press.last.id, action: "land", by: "anna", phase: "failed", age: 1.1, after: 1.1, reason: "the motors are off", try: 3, tries: 3 };
  told.get("emergency")({ press: failed });
  assert.equal(press.state.said, "Emergency land failed: the motors are off. Press again.");
  age = 3;
  assert.match(press.state.said, /Press again; Ctrl-C in quadlab's terminal lands, too\.$/);
  age = 0;
  summary.status.armed = false;
  assert.equal(press.state.said, "Emergency land failed: the motors are off.", "there is nothing to press for");
  now += 10_000;
  assert.equal(press.state.tone, "idle");
});
