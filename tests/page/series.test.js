import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

import { decisive, titleOf } from "../../web/static/experiments/figures.js";
import { planned, summary } from "../../web/static/experiments/series.js";

const PERIOD = { name: "period", type: "float", choices: [], minimum: 4, maximum: 20, unit: "s" };
const LAPS = { name: "laps", type: "str", choices: ["steady", "rest_to_rest"], unit: "" };
const rms = (value, limit = 0.025) => ({ name: "position_rms_m", value, limit });
const yaw = (value, limit = 2) => ({ name: "yaw_rms_deg", value, limit });

test("a series flies each value as often as wanted, with the other options as they are", () => {
  const flights = planned({ period: 8, laps: "steady" }, 2, PERIOD, "6; 8,5");
  assert.deepEqual(
    flights.map(({ value, options }) => [value, options.period, options.laps]),
    [6, 6, 8.5, 8.5].map((value) => [value, value, "steady"]),
  );
  assert.deepEqual(
    planned({}, 1, LAPS, "rest_to_rest steady").map(({ value }) => value),
    ["rest_to_rest", "steady"],
  );
  assert.deepEqual(
    planned({ a: 1 }, 3, undefined, "7"),
    Array(3).fill({ options: { a: 1 }, value: undefined }),
  );
});

test("what cannot be flown is told with what is allowed", () => {
  for (const [times, over, text, line] of [
    [1, PERIOD, "6 30", /^Error: period = 30; allowed 4 to 20 s$/],
    [1, PERIOD, "6 x", /^Error: period = x; allowed 4 to 20 s$/],
    [1, PERIOD, " ", /enter its values/],
    [1, LAPS, "steady fast", /^Error: laps = fast; allowed steady, rest_to_rest$/],
    [30, PERIOD, "6 8", /1 to 50 flights, here 60/],
    [NaN, undefined, "", /1 to 50 flights, here \?/],
    [1.5, undefined, "", /1 to 50 flights/],
  ])
    assert.throws(() => planned({}, times, over, text), line);
});

test("the deciding figure is the one above its limit, else the position error", () => {
  assert.equal(decisive([rms(0.02), yaw(1.9)]).name, "position_rms_m");
  assert.equal(decisive([rms(0.02), yaw(2.1)]).name, "yaw_rms_deg");
  assert.equal(decisive([rms(0.02), yaw(null)]).name, "yaw_rms_deg");
  assert.equal(decisive([{ name: "samples", value: 3, limit: null }]), null);
  assert.equal(decisive([rms(0.02, null), { name: "samples", value: 3, limit: null }]).value, 0.02);
});

test("a summary has mean and range of the deciding figure, where all flights have the same one", () => {
  assert.equal(summary([[rms(0.001)], [rms(0.003)], [rms(0.002)]]), "mean 2 mm, 1 to 3");
  assert.equal(summary([[rms(0.001)], [yaw(3)]]), "");
  assert.equal(summary([[rms(0.001)]]), "");
});

test("a metric is named in words with the unit in which it is stored", () => {
  const names = ["position_rms_m", "yaw_rms_deg", "impact_m_s", "saturated_share", "passed"];
  assert.deepEqual(names.map(titleOf), ["position rms [m]", "yaw rms [°]", "impact [m/s]", "saturated share", "passed"]);
});
