import assert from "node:assert/strict";
import test from "node:test";

import "./browser.js";
import { Parameters } from "../../web/static/gains/parameters.js";

const NAME = "behavior.volume_x_min";

// Parameters that were read once with the value -3, revision 5 of generation 1; `fetch` gives what `answers` has.
async function read(context) {
  const answers = [{ generation: 1, parameters: [{ name: NAME, value: -3, revision: 5, default: -2 }] }];
  context.mock.method(globalThis, "fetch", async () => ({ ok: true, json: async () => answers.at(-1) }));
  const events = new EventTarget(), parameters = new Parameters({ on: (type, act) => events.addEventListener(type, ({ detail }) => act(detail)) }, true);
  await parameters.load();
  const hear = (value, revision, generation = 1) => {
    events.dispatchEvent(new CustomEvent("parameter", { detail: { name: NAME, value, generation, revision } }));
    return parameters.value(NAME);
  };
  return { answers, parameters, hear };
}

test("an answer that comes after newer news does not undo it", async (context) => {
  const { parameters, hear } = await read(context);
  assert.equal(parameters.value(NAME), -3);
  assert.deepEqual([hear(-2, 7), hear(-1, 6), hear(-4, 8), hear(-5, 5, 2), hear(-6, 14)], [-2, -2, -4, -5, -5]);
});

test("what was received while all were read is kept, and each newer value is told with the one before", async (context) => {
  const { answers, parameters, hear } = await read(context), told = [];
  parameters.addEventListener("confirmed", ({ detail }) => told.push([detail.name, detail.before, parameters.value(NAME)]));
  hear(-2, 7);
  hear(-1, 6);
  await parameters.load(); // the same answer: older than what is known
  assert.equal(parameters.value(NAME), -2);
  assert.deepEqual(told, [[NAME, -3, -2]]);
  answers.push({ applied: { [NAME]: -2.5 }, revisions: { [NAME]: 9 }, generation: 1 });
  assert.deepEqual(await parameters.set({ [NAME]: -2.5 }), { [NAME]: -2.5 });
  assert.deepEqual(told.at(-1), [NAME, -2, -2.5]);
});

test("what is read again replaces a value of the same revision, as the change in between may have been lost", async (context) => {
  const { answers, parameters, hear } = await read(context);
  hear(-2, 5);
  answers.push({ generation: 1, parameters: [{ name: NAME, value: -2.5, revision: 5, default: -2 }] });
  await parameters.load();
  assert.equal(parameters.value(NAME), -2.5);
});
