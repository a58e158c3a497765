import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import "../browser.js";

const { documentOf, recorded } = await import("../../../web/static/charts/svg.js");
const { csvOf } = await import("../../../web/static/charts/save.js");
const { derive, derivedSignals, forget, isDerived } = await import("../../../web/static/charts/derived.js");
const { figuresOf } = await import("../../../web/static/charts/figures.js");

beforeEach(() => localStorage.clear());

test("statistics are of the samples that have a value, and of nothing there are none", () => {
  assert.deepEqual(figuresOf([9, 1, NaN, -3, Infinity, 2, 9], 1, 6), { count: 3, mean: 0, rms: Math.sqrt(14 / 3), min: -3, max: 2 });
  assert.deepEqual(figuresOf([NaN], 0, 1), { count: 0, mean: null, rms: null, min: null, max: null });
});

test("a file of numbers has a row an instant, in order, and leaves out what has no value", () => {
  const text = csvOf("time_s", [
    { names: ["a", "= max(a, 1)"], times: [0, 0.5, 1], columns: [[1, NaN, 3], [1, 2, 3]] },
    { names: ["b"], times: [0.25, 0.5, 2], columns: [[7, 8, NaN]] },
  ]);
  assert.equal(text, 'time_s,a,"= max(a, 1)",b\n0,1,1,\n0.25,,,7\n0.5,,2,8\n1,3,3,\n');
});

const server = (known) => async (texts) => texts.map((name) => (known.includes(name) ? { name, label: name } : { name, problem: `no signal in ${name}` }));

test("a derived signal is kept, a wrong one says why and is not, and those a run lacks are left out", async () => {
  const ask = server(["= a", "= b"]);
  assert.equal((await derive("= a", ask)).name, "= a");
  await derive("= b", ask);
  await assert.rejects(derive("= c", ask), /no signal in = c/);
  assert.deepEqual((await derivedSignals(ask)).map(({ name }) => name), ["= a", "= b"]);
  assert.deepEqual((await derivedSignals(server(["= b", "= of a link"]), ["= of a link", "plain"])).map(({ name }) => name), ["= b", "= of a link"]);
  forget("= a");
  assert.deepEqual((await derivedSignals(ask)).map(({ name }) => name), ["= b"]);
  assert.deepEqual(await derivedSignals(async () => { throw new Error("no server"); }), []);
  assert.ok(isDerived("= a") && !isDerived("state.position.x"));
});

test("what another version kept is no derived signal", async () => {
  localStorage.setItem("charts.derived", '{"a": 1}');
  assert.deepEqual(await derivedSignals(server(["= a"])), []);
});

test("a drawing holds the strokes, the paths made meanwhile and the texts of the last drawing, and leaves the canvas as it was", async () => {
  globalThis.Path2D = class { moveTo() {} lineTo() {} rect() {} arc() {} closePath() {} };
  const Plain = globalThis.Path2D, calls = [];
  class Context { stroke() { calls.push("stroke"); } getTransform() { return { a: 1, b: 0, c: 0, d: 1, e: 0, f: 0 }; } getLineDash() { return this.dash; } }
  for (const name of ["clearRect", "save", "clip", "restore", "rect", "beginPath", "moveTo", "lineTo", "fillText", "fillRect"]) Context.prototype[name] = () => calls.push(name);
  const context = Object.assign(new Context(), { strokeStyle: "red", lineWidth: 2, dash: [4, 2], globalAlpha: 1, fillStyle: "black", font: "10px sans", textAlign: "center", textBaseline: "top" });
  const parts = await recorded(context, async () => {
    context.fillRect(0, 0, 9, 9);
    context.clearRect(0, 0, 9, 9);
    const path = new Path2D();
    path.moveTo(1, 2);
    path.lineTo(3.456, 4);
    context.save();
    context.beginPath();
    context.rect(0, 0, 8, 8);
    context.clip();
    context.stroke(path);
    context.restore();
    context.dash = [];
    context.beginPath();
    context.moveTo(0, 0);
    context.stroke();
    context.fillText("a < b", 5, 6);
  });
  assert.deepEqual(parts, [
    '<clipPath id="c0"><path d="M0 0h8v8h-8z"/></clipPath>', '<path d="M1 2L3.46 4" fill="none" stroke="red" stroke-width="2" stroke-dasharray="4 2" clip-path="url(#c0)"/>', '<path d="M0 0" fill="none" stroke="red" stroke-width="2"/>',
    '<text x="5" y="6" fill="black" style="font: 10px sans" text-anchor="middle" dominant-baseline="text-before-edge">a &#60; b</text>']);
  assert.equal(calls.length, 12, "all was drawn on the canvas too");
  assert.equal(globalThis.Path2D, Plain);
  assert.ok(!Object.hasOwn(context, "stroke"));
  assert.match(documentOf(parts, 20, 10, 2), /^<svg xmlns="http:\/\/www.w3.org\/2000\/svg" width="10" height="5" viewBox="0 0 20 10">/);
  assert.match(documentOf(parts, 20, 10, 2, 88), /^<svg xmlns="http:\/\/www.w3.org\/2000\/svg" width="88mm" height="44mm" viewBox="0 0 20 10">/);
});
