// The spectra of what a chart shows, live or of a replay: an axis of frequencies, a source that asks the
// server for them, and a chart that draws them by the logarithm, with the rotors' frequencies as lines.

import { Chart } from "./chart.js";
import { Axis, ticksOf } from "./time_axis.js";
import { get } from "../core/api.js";
import { setText } from "../core/dom.js";

const ROTOR = "var(--gold)",
  MOTORS = ["front", "left", "rear", "right"];
export const rotorsOf = (name) =>
  MOTORS.map((motor, rotor) => ({ name, motor, rotor, second: true, stroke: ROTOR, dash: [3, 3], width: 1 }));
export const query = (names) => names.map((name) => `signal=${encodeURIComponent(name)}`).join("&");
export const densityOf = (unit) => `${unit || "1"}/√Hz`;
const LEAST = 1; // Hz, of a zoom
const RETRY = 1000; // ms

export class FrequencyAxis extends Axis {
  isKnown = true;
  paused = true;
  hasRoom = false;
  most = 1;
  zoom = /** @type {[number, number] | null} */ (null);

  get span() {
    return this.zoom ?? [0, this.most];
  }
  ticks = ticksOf;
  label(frequency) {
    return `${Number(frequency.toPrecision(4))} Hz`;
  }

  setMost(most) {
    this.most = most;
    this.version += 1;
  }

  show(from, to) {
    const length = Math.min(this.most, Math.max(LEAST, to - from));
    const start = Math.min(Math.max(0, (from + to - length) / 2), this.most - length);
    this.zoom = length < this.most ? [start, start + length] : null;
    this.version += 1;
    this.dispatchEvent(new Event("range"));
  }

  scale(factor, at) {
    const [from, to] = this.span;
    this.show(at + (from - at) * factor, at + (to - at) * factor);
  }
  pan(by) {
    const [from, to] = this.span;
    this.show(from + by, to + by);
  }
  reset() {
    this.show(0, this.most);
  }
}

// What the server finds in the samples shown: `ask` asks, `take` keeps the answer, `forget` what it was,
// `unitOf` a signal is what a chart shows. Events: `window` when another answer is here, `problem` with its text.
export class Asked extends EventTarget {
  runs = [];
  names = [];
  rotors = [];
  shown = "";
  isFetching = false;

  constructor(range) {
    super();
    this.range = range;
  }

  get signals() {
    return new Map(
      [...(this.runs[0]?.signals ?? [])].map(([name, signal]) => [
        name,
        { ...signal, unit: /** @type {any} */ (this).unitOf(signal) },
      ]),
    );
  }

  get settled() {
    return !this.names.length || this.shown === this.key;
  }
  get key() {
    return JSON.stringify([this.names, this.range.span, this.runs[0]?.shift]);
  }

  // One question at a time; when its answer comes, what is wanted then is asked for.
  async fetch() {
    if (this.isFetching || this.settled) return;
    this.isFetching = true;
    const kind = /** @type {any} */ (this),
      {
        key,
        runs: [run],
        range: {
          span: [start, end],
        },
      } = this;
    try {
      kind.take(await kind.ask(run, start + run.shift, end + run.shift), run.shift);
      this.shown = key;
      this.dispatchEvent(new CustomEvent("problem", { detail: "" }));
    } catch (error) {
      kind.forget();
      this.shown = key; // it would be refused again
      this.dispatchEvent(new CustomEvent("problem", { detail: error.message }));
      await new Promise((resolve) => {
        setTimeout(resolve, RETRY);
      });
    }
    this.isFetching = false;
    this.dispatchEvent(new Event("window"));
  }
}

export class Spectra extends Asked {
  found = new Map();
  axis = new FrequencyAxis();

  unitOf({ unit }) {
    return densityOf(unit);
  }

  lines(names, styles) {
    this.names = names;
    return names.length ? [...names.map((name, i) => ({ name, ...styles[i] })), ...rotorsOf(names[0])] : [];
  }

  samples({ name, rotor }, min, max) {
    const one = this.found.get(name);
    if (!one) return undefined;
    if (rotor === undefined)
      return { times: one.frequency, values: one.density, from: 0, to: one.frequency.length };
    const at = this.rotors[rotor],
      inside = one.density.filter((value) => value > 0);
    if (!(at >= min && at <= max) || !inside.length) return undefined;
    return { times: [at, at], values: [Math.min(...inside), Math.max(...inside)], from: 0, to: 2 };
  }

  // The value under the cursor.
  read(output, { name, rotor }, figure) {
    const one = this.found.get(name),
      { cursor } = this.axis;
    const value = one && cursor !== null && one.density[Math.round(cursor / one.frequency[1])];
    setText(output, rotor === undefined && value ? figure(value) : "");
  }

  ask(run, start, end) {
    return run.spectrum(this.names, start, end);
  }

  take({ spectra, rotors }) {
    this.found = new Map(spectra.map((one) => [one.signal, one]));
    this.rotors = rotors;
    this.axis.setMost(Math.max(1, ...spectra.map(({ frequency }) => frequency.at(-1))));
  }

  forget() {
    this.found = new Map();
  }
}

// Of the last seconds, asked for again with each `renew`.
export class LiveSpectra extends Spectra {
  constructor(signals) {
    super({ span: [0, 0] });
    this.runs = [{ signals, shift: 0, spectrum: (names) => get(`/api/spectrum?${query(names)}`) }];
  }

  renew() {
    const next = this.range.span[1] + 1;
    this.range.span = [next, next];
    return this.fetch();
  }
}

export class SpectrumChart extends Chart {
  select(names) {
    super.select(names);
    this.plot.ariaLabel = this.plot.ariaLabel?.replace("over time", "over frequency") ?? null;
  }

  scale(unit) {
    return { distr: 3, range: () => this.rangeOf(unit) };
  }
  range(unit, low, high) {
    return this.scales[unit] ?? [Math.max(low || 1e-6, 1e-5 * (high || 1)), 1.3 * (high || 1)];
  }
  figure(value) {
    return value.toPrecision(3);
  }
  get xName() {
    return "frequency_hz";
  }
  drawEnds() {} // the legend has room for the names
}
