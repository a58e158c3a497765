import assert from "node:assert/strict";
import { test } from "node:test";

import "../browser.js";
import { LiveSpectrogram, Spectrogram, colorOf, pixelsOf } from "../../../web/static/charts/spectrogram.js";
import { FrequencyAxis, Spectra } from "../../../web/static/charts/spectrum.js";

const FOUND = { frequency: [0, 1, 2, 3, 4], density: [0, 2, 8, 4, 1] };

function spectra() {
  const made = new Spectra({ span: [0, 10] });
  made.lines(["imu.x"], [{ stroke: "#fff", dash: [] }]);
  made.found = new Map([["imu.x", FOUND]]);
  made.rotors = [2.5, 9, 3, 3];
  return made;
}

test("the axis zooms within its frequencies, and back", () => {
  const axis = new FrequencyAxis();
  axis.setMost(250);
  assert.deepEqual(axis.span, [0, 250]);
  axis.show(60, 80);
  assert.deepEqual(axis.span, [60, 80]);
  axis.pan(-100);
  assert.deepEqual(axis.span, [0, 20]);
  axis.scale(1e-3, 10);
  assert.equal(axis.span[1] - axis.span[0], 1);
  axis.reset();
  assert.deepEqual(axis.span, [0, 250]);
  assert.equal(axis.label(76.4), "76.4 Hz");
});

test("a rotor is a line over the height of the spectrum, where it is in sight", () => {
  const made = spectra();
  assert.deepEqual(made.samples({ name: "imu.x" }, 0, 4),
    { times: FOUND.frequency, values: FOUND.density, from: 0, to: 5 });
  assert.deepEqual(made.samples({ name: "imu.x", rotor: 0 }, 0, 4),
    { times: [2.5, 2.5], values: [1, 8], from: 0, to: 2 });
  assert.equal(made.samples({ name: "imu.x", rotor: 1 }, 0, 4), undefined);
  assert.equal(made.samples({ name: "other" }, 0, 4), undefined);
});

test("it asks once for what is shown, and shows the answer or why there is none", async () => {
  const made = spectra(), asked = [], problems = [];
  made.addEventListener("problem", ({ detail }) => problems.push(detail));
  made.runs = [{ shift: 1, signals: new Map([["imu.x", { unit: "m/s²" }]]),
    spectrum: async (...question) => { asked.push(question); return { spectra: [{ signal: "imu.x", ...FOUND }], rotors: [1, 2, 3, 4] }; } }];
  assert.equal(made.signals.get("imu.x").unit, "m/s²/√Hz");
  await Promise.all([made.fetch(), made.fetch()]);
  await made.fetch();
  assert.deepEqual(asked, [[["imu.x"], 1, 11]]);
  assert.deepEqual([made.settled, made.axis.span, made.rotors], [true, [0, 4], [1, 2, 3, 4]]);
  made.range.span = [0, 0.01];
  assert.equal(made.settled, false);
  made.runs[0].spectrum = async () => { throw new Error("too few"); };
  await made.fetch();
  assert.deepEqual([problems, made.found.size, made.settled], [["", "too few"], 0, true]);
});

test("a spectrogram asks for the first signal and tells where it is strongest at the cursor", async () => {
  const made = new Spectrogram({ span: [0, 10], cursor: 1.1 }), asked = [], output = { textContent: "" };
  const [, rotor] = made.lines(["imu.x", "imu.y"]);
  made.runs = [{ shift: 1, signals: new Map([["imu.x", { unit: "m/s²" }]]), spectrogram: async (...question) => {
    asked.push(question);
    return { times: [1.5, 2, 2.5], frequency: [0, 20, 40, 60], rotors: [[20, 21, 22]],
      density: [[9, 1, 2, 3], [9, 1, 5, 3], [9, 8, 2, 3]] };
  } }];
  await made.fetch();
  assert.deepEqual(asked, [["imu.x", 1, 11]]);
  assert.deepEqual([made.unit, made.most, made.greatest], ["m/s²/√Hz", 60, 9]);
  assert.deepEqual(made.samples(rotor), { times: [0.5, 1, 1.5], values: [20, 21, 22], from: 0, to: 3 });
  made.read(output, { name: "imu.x" });
  assert.equal(output.textContent, "40 Hz");
  made.range.cursor = null;
  made.read(output, { name: "imu.x" });
  assert.equal(output.textContent, "");
});

test("a live spectrogram grows by what is new, takes corrections, and leaves a gap empty", () => {
  const made = new LiveSpectrogram(new Map(), { span: [990, 1001.5], cursor: null });
  const answer = (from, count, value) => ({ times: Array.from({ length: count }, (_, k) => from + 0.5 * k), frequency: [0, 20],
    density: Array.from({ length: count }, () => [1, value]), rotors: [Array.from({ length: count }, () => value)] });
  const shown = () => [made.found.times, made.found.density.map(([, value]) => value), made.found.rotors[0]];
  made.lines(["imu.x"]);
  made.take(answer(1000.5, 2, 3));
  assert.deepEqual(shown(), [[1000.5, 1001], [3, 3], [3, 3]]);
  made.take(answer(1001, 2, 4));
  assert.deepEqual(shown(), [[1000.5, 1001, 1001.5], [3, 4, 4], [3, 4, 4]]);
  made.take(answer(1003, 2, 5));
  assert.deepEqual(shown(), [[1000.5, 1001, 1001.5, 1002, 1002.5, 1003, 1003.5], ...Array(2).fill([3, 4, 4, NaN, NaN, 5, 5])]);
  assert.equal(made.greatest, 5);
});

test("a gap of a spectrogram is transparent and has no strongest frequency", () => {
  const pixels = pixelsOf([[1, 1], [NaN, NaN]], 1), output = { textContent: "" };
  assert.deepEqual([...pixels], [253, 231, 76, 255, 0, 0, 0, 0, 253, 231, 76, 255, 0, 0, 0, 0]);
  const made = new Spectrogram({ span: [0, 1], cursor: 0.5 }), [line] = made.lines(["imu.x"]);
  made.take({ times: [0, 0.5], frequency: [0, 20], density: [[1, 1], [NaN, NaN]], rotors: [] }, 0);
  made.read(output, line);
  assert.equal(output.textContent, "");
  made.range.cursor = 0;
  made.read(output, line);
  assert.equal(output.textContent, "20 Hz");
});

test("colours go by the logarithm, from the ground to yellow", () => {
  assert.deepEqual([0, 1e-3, 1].map((value) => colorOf(value, 1)), [[18, 23, 28], [18, 23, 28], [253, 231, 76]]);
  const [low, high] = [colorOf(0.01, 1), colorOf(0.1, 1)];
  assert.ok(high[1] > low[1]);
});
