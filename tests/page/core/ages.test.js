import assert from "node:assert/strict";
import { test } from "node:test";

import "../browser.js";

const { Ages } = await import("../../../web/static/core/ages.js");

class Place {
  constructor(topic, title) {
    const classes = new Set();
    this.dataset = { topic };
    this.title = title;
    this.classList = {
      contains: (name) => classes.has(name),
      toggle: (name, on) => (on ? classes.add(name) : classes.delete(name)),
    };
  }

  get isStale() { return this.classList.contains("stale"); }
}

test("what is past its deadline is marked with its age, and has its own title again when it comes", (context) => {
  context.mock.method(globalThis, "setInterval", () => 0);
  const heard = { battery: 0.5 }, age = (topic) => heard[topic] ?? Infinity;
  const ages = new Ages({ age }, { age: () => Infinity }, { battery: 3 });
  const known = new Place("battery", "volts"), unknown = new Place("tracker", "");
  const look = () => { ages.mark(known); ages.mark(unknown); return [known.isStale, known.title, unknown.isStale, unknown.title]; };
  assert.deepEqual(look(), [false, "volts", true, "never received"]);
  heard.battery = 3;
  assert.deepEqual(look(), [true, "last received 3.0 s ago", true, "never received"]);
  heard.battery = 0;
  heard.tracker = 0.2;
  assert.deepEqual(look(), [false, "volts", false, ""]);
});

test("of two ways the newer message counts, and a topic without a deadline has 1 s", (context) => {
  context.mock.method(globalThis, "setInterval", () => 0);
  const ages = new Ages({ age: () => 5 }, { age: () => 0.9 }, {});
  assert.deepEqual([ages.age("state"), ages.isOld("state")], [0.9, false]);
  ages.telemetry.age = () => 1;
  assert.equal(ages.isOld("state"), true);
});
