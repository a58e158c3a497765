import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";
import { Channels } from "../../web/static/link/channels.js";

// Channels with these ages (s) of their topics.
function heard(ages, link = "good") {
  const events = Object.assign(new EventTarget(), { summary: { status: {}, link: { state: link } } }), telemetry = new EventTarget();
  const usual = { state: 0.01, status: 0.1, link_status: 0.1, station_status: 0.1 };
  const channels = new Channels({ events, telemetry, ages: { age: (topic) => ages[topic] ?? usual[topic] }, gains: { value: () => undefined } });
  return { channels, events, telemetry };
}

const LATE = { state: 3, status: 3 };
const CASES = [
  ["all is heard", {}, "good", "", true, []],
  ["charts run without status", { status: 9.7 }, "good", "", false, ["status 9.7 s old"]],
  ["status comes without ticks", { state: 2 }, "good", "", true, ["telemetry 2.0 s old"]],
  ["ticks never came", { state: Infinity }, "good", "", true, ["telemetry missing"]],
  ["the station is silent, ticks run", { link_status: 2, station_status: 2 }, "good", "", true, ["station 2.0 s old"]],
  ["the link is lost", LATE, "lost", "link", false, null],
  ["the flight process stopped", LATE, "good", "flight", false, null],
  ["the station is gone", { ...LATE, link_status: 3, station_status: 3 }, "good", "station", false, null],
  ["nobody knows yet", { state: 1.1, status: 1.1, link_status: 1, station_status: 1 }, "good", "silent", false, null],
];

for (const [name, ages, link, cause, hasStatus, late] of CASES) {
  test(`contact when ${name}`, () => {
    const { channels } = heard(ages, link);
    assert.equal(channels.cause, cause);
    assert.equal(channels.hasContact, cause === "");
    assert.equal(channels.hasStatus, hasStatus);
    if (late) assert.deepEqual(channels.late, late);
  });
}

test("a page that has lost its server says so after 0.4 s, and nothing of the vehicle", () => {
  const { channels, events } = heard({});
  events.dispatchEvent(new Event("close"));
  assert.equal(channels.cause, "");
  channels.closed -= 500;
  assert.equal(channels.cause, "page");
  assert.equal(channels.hasContact, false);
  events.dispatchEvent(new Event("open"));
  assert.equal(channels.cause, "");
});

test("a page that was held up shows contact again with the first frame it reads", () => {
  const ages = { state: 6.5, status: 6.5, link_status: 6.5, station_status: 6.5 };
  const { channels, telemetry } = heard(ages), told = [];
  channels.addEventListener("change", () => told.push(channels.cause));
  assert.equal(channels.cause, "station"); // as it is drawn with the first summary
  Object.assign(ages, { state: 0.01, status: 0.1, link_status: 0.1, station_status: 0.1 });
  for (let k = 0; k < 3; k++) telemetry.dispatchEvent(Object.assign(new Event("frame"), { detail: { age: { state: 0.01 } } }));
  assert.deepEqual(told, [""]);
});

test("ticks that cease are told with the frame that says so", () => {
  const { channels, telemetry } = heard({}), told = [];
  channels.addEventListener("change", () => told.push(channels.isSilent));
  for (const state of [0.01, 0.19, 0.21, 0.3, undefined, 0.02]) telemetry.dispatchEvent(Object.assign(new Event("frame"), { detail: { age: { state } } }));
  assert.deepEqual(told, [true, false]);
});

test("a page that was held up does not judge before it has read what arrived", () => {
  const { channels } = heard({ state: 2, status: 2, link_status: 2, station_status: 2 });
  const beatAfter = (ms) => {
    channels.timely -= ms;
    channels.beaten -= ms;
    const before = channels.cause;
    channels.beat();
    return [before, channels.cause];
  };
  channels.beat();
  assert.deepEqual(beatAfter(1000), ["", ""]); // nothing of this page has run since
  assert.deepEqual(beatAfter(100), ["", "station"]); // it has, and there is nothing
  channels.known = "";
  assert.deepEqual(beatAfter(2000), ["", ""]);
  assert.deepEqual(beatAfter(2000), ["station", "station"]); // always slow, it judges nevertheless
});
