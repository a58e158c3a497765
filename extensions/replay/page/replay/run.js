// One run as the server gives it: its description, its track for the 3D view, windows of signals.

import { binary, get } from "/static/core/api.js";
import { unpack } from "./packed.js";

const POLL = 250; // ms between two questions while the server reads the log
const WIDTH_OF = { position: 3, rotation: 4 };
const THRUST = 4; // column of the actuators, N
const GRAVITY = 9.81; // m/s²
const EPOCH = 1e9; // s; a clock before 2001 is a simulation's
const SEEN = 0.3; // s, for which bearings to other vehicles are shown

export class Run {
  place;
  track;

  constructor(id, description) {
    this.id = id;
    this.base = `/api/replay/${encodeURIComponent(id)}`;
    this.description = description;
    this.shift = 0; // its time = the page's + shift
    this.signals = new Map(description.signals.map((signal) => [signal.name, signal]));
  }

  // When it began, in s since 1970; null where its clock was a simulation's.
  get begun() {
    const begun = this.description.start_ns / 1e9;
    return begun > EPOCH ? begun : null;
  }

  get duration() {
    return this.description.duration;
  }

  // What happened, for charts: log lines, marks and parameter changes.
  get events() {
    const { events, marks, changes } = this.description,
      line = (t, text, kind = "") => ({ t, text, kind });
    return [
      ...events.map(({ t, text, warn }) => line(t, text, warn ? "warn" : "")),
      ...marks.map(({ t, text }) => line(t, text || "mark", "warn")),
      ...changes.map(({ t, name, new: value }) => line(t, `${name} = ${value}`)),
    ].sort((a, b) => a.t - b.t);
  }

  // progress(0 … 1) is called while the log is read.
  static async open(id, progress, { newer = false, hasTrack = true } = {}) {
    const path = `/api/replay/${encodeURIComponent(id)}`;
    for (let wanted = newer; ; wanted = false) {
      const answer = await get(`${path}${wanted ? "?newer=true" : ""}`);
      if (answer.state === "ready") {
        const run = new Run(id, answer);
        if (hasTrack) await run.loadTrack();
        return run;
      }
      progress(answer.progress);
      await new Promise((resolve) => setTimeout(resolve, POLL));
    }
  }

  async loadTrack() {
    const { rate, width, parts } = this.description.track;
    const rows = new Float32Array(await binary(`${this.base}/track`));
    let first = 0;
    this.place = {};
    for (const [part, columns] of Object.entries(parts)) {
      this.place[part] = first;
      first += columns;
    }
    this.track = { rate, width, rows, count: rows.length / width };
  }

  // Position (3) and quaternion (w, x, y, z) of state, truth or reference at t; null where unknown.
  pose(part, t) {
    const { rate, width, rows, count } = this.track,
      place = this.place[part];
    const at = t * rate,
      k = Math.floor(at + 1e-6);
    if (k < 0 || k >= count || at > count) return null;
    const i = k * width + place,
      next = k + 1 < count ? i + width : i;
    if (Number.isNaN(rows[i])) return null;
    const share = Number.isNaN(rows[next]) ? 0 : Math.min(1, Math.max(0, at - k));
    const position = [0, 1, 2].map((c) => rows[i + c] + share * (rows[next + c] - rows[i + c]));
    if (part === "reference") return { position };
    const a = i + WIDTH_OF.position,
      b = next + WIDTH_OF.position;
    const sign = dot4(rows, a, b) < 0 ? -1 : 1;
    const q = [0, 1, 2, 3].map((c) => rows[a + c] + share * (sign * rows[b + c] - rows[a + c]));
    const length = Math.hypot(...q) || 1;
    return { position, rotation: q.map((x) => x / length) };
  }

  motors(t) {
    const { rate, width, rows, count } = this.track,
      k = Math.floor(t * rate);
    if (k < 0 || k >= count) return null;
    const i = k * width + this.place.actuators;
    return Number.isNaN(rows[i]) ? null : Array.from(rows.subarray(i, i + 4));
  }

  // What colours the path at a row of the track; null where unknown.
  signal(name, k) {
    const { rate, width, rows } = this.track,
      row = k * width,
      read = (part, c) => rows[row + this.place[part] + c];
    const position = (part, at = 0) => [0, 1, 2].map((c) => rows[row + at * width + this.place[part] + c]);
    const apart = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));
    const { "model.mass": mass = 0 } = this.description.parameters;
    const value =
      name === "error"
        ? apart(position("state"), position("reference"))
        : name === "speed"
          ? k
            ? rate * apart(position("state"), position("state", -1))
            : NaN
          : read("actuators", THRUST) / (mass * GRAVITY);
    return Number.isFinite(value) ? value : null;
  }

  // What a changing text (`status/flags`) was at t.
  text(path, t) {
    let found = "";
    for (const [from, text] of this.description.texts[path] ?? []) {
      if (from > t) break;
      found = text;
    }
    return found;
  }

  span(kind, t) {
    return this.description.spans[kind].find((one) => one.from <= t && t < one.to)?.text ?? "";
  }

  beacons(t) {
    return this.description.beacons.filter((one) => one.t <= t).at(-1)?.beacons ?? [];
  }

  // The beacons in sight at t, their places, and the bearings' standard deviation in rad; null without.
  sight(t) {
    const found = this.description.sights.filter((one) => one.t <= t).at(-1);
    return found?.ids.length
      ? {
          sigma: found.sigma,
          places: this.beacons(t)
            .filter(([id]) => found.ids.includes(id))
            .map((one) => one.slice(1)),
        }
      : null;
  }

  // What it saw of other vehicles at t: {sigma, seen: [[number, x, y, z in body axes], …]}; null without.
  neighbours(t) {
    const found = this.description.neighbours.filter((one) => one.t <= t).at(-1);
    return found && t - found.t < SEEN ? found : null;
  }

  // Values and ages at t, by name.
  at(names, t) {
    return get(`${this.base}/at?t=${t.toFixed(6)}${query(this.known(names))}`);
  }

  // { spectra: [{ signal, frequency, density }], rotors } between two instants of its own time.
  spectrum(names, start, end) {
    return get(
      `${this.base}/spectrum?start=${start.toFixed(6)}&end=${end.toFixed(6)}${query(this.known(names))}`,
    );
  }

  // { times, frequency, density: [of each time], rotors: [of each motor] } of one signal.
  spectrogram(name, start, end) {
    return get(`${this.base}/spectrogram?start=${start.toFixed(6)}&end=${end.toFixed(6)}${query([name])}`);
  }

  // { count, mean, rms, min, max } of all samples between two instants of its own time, by name.
  statistics(names, start, end) {
    return get(
      `${this.base}/statistics?start=${start.toFixed(6)}&end=${end.toFixed(6)}${query(this.known(names))}`,
    );
  }

  // Derived signals, those that it can compute, among its signals.
  async learn(names) {
    for (const signal of await this.expressions(names))
      if (!signal.problem) this.signals.set(signal.name, signal);
  }

  // What the server says of the texts of derived signals.
  expressions(texts) {
    return get(
      `${this.base}/expressions?${texts.map((text) => `text=${encodeURIComponent(text)}`).join("&")}`,
    );
  }

  known(names) {
    return names.filter((name) => this.signals.has(name));
  }

  // [{signals, times, columns}] between two instants of its own time.
  async window(names, start, end, points, extremes = true) {
    const wanted = this.known(names);
    if (!wanted.length) return [];
    const span = `start=${start.toFixed(6)}&end=${end.toFixed(6)}&points=${points}`;
    const more = `${extremes ? "" : "&extremes=false"}${query(wanted)}`;
    return unpack(await binary(`${this.base}/window?${span}${more}`));
  }
}

const query = (names) => names.map((name) => `&signal=${encodeURIComponent(name)}`).join("");

function dot4(rows, a, b) {
  return (
    rows[a] * rows[b] + rows[a + 1] * rows[b + 1] + rows[a + 2] * rows[b + 2] + rows[a + 3] * rows[b + 3]
  );
}
