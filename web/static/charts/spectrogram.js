// The spectrogram of a chart's first signal, live or of a replay: its density over time and frequency as a heat
// map, with the rotors' frequencies as lines.

import { Chart } from "./chart.js";
import { Asked, densityOf, query, rotorsOf } from "./spectrum.js";
import { get } from "../core/api.js";
import { element, setText } from "../core/dom.js";

const COLORS = [
  [18, 23, 28],
  [38, 56, 112],
  [31, 130, 139],
  [120, 190, 90],
  [253, 231, 76],
]; // from low to high
const DEPTH = 1e-3; // of the greatest density, which is the darkest
const COLUMNS = 1500; // of a live one, 10 min and more
const MOTION = 10; // Hz, up to which the vehicle's own motion is the strongest

export class Spectrogram extends Asked {
  found = /** @type {any} */ (null);
  greatest = 0;
  unit = "";

  unitOf() {
    return "Hz";
  }
  get most() {
    return this.found?.frequency.at(-1) ?? 1;
  }

  lines(names) {
    this.names = names.slice(0, 1);
    return this.names.length
      ? [
          { name: names[0], stroke: "transparent", dash: [] },
          ...rotorsOf(names[0]).map((line) => ({ ...line, stroke: "var(--on-red)" })),
        ]
      : [];
  }

  samples({ rotor }) {
    const values = this.found?.rotors[rotor];
    return values && { times: this.found.times, values, from: 0, to: values.length };
  }

  // Where it is strongest at the cursor, above the vehicle's own motion.
  read(output, { rotor }) {
    const {
      found,
      range: { cursor },
    } = this;
    let text = "";
    if (rotor === undefined && found && cursor !== null) {
      const k = Math.round((cursor - found.times[0]) / this.step),
        column = found.density[k];
      const from = found.frequency.findIndex((frequency) => frequency > MOTION);
      if (column && from >= 0 && column[from] >= 0)
        text = `${Math.round(found.frequency[column.indexOf(Math.max(...column.slice(from)), from)])} Hz`;
    }
    setText(output, text);
  }

  get step() {
    const { times = [] } = this.found ?? {};
    return times.length > 1 ? times[1] - times[0] : 0.5;
  } // s a column

  ask(run, start, end) {
    this.unit = densityOf(run.signals.get(this.names[0])?.unit);
    return run.spectrogram(this.names[0], start, end);
  }

  take(found, shift) {
    this.found = { ...found, times: found.times.map((t) => t - shift) };
    this.greatest = greatestOf(found.density);
  }

  forget() {
    this.found = null;
  }
}

// Grows by the columns of the last seconds with each `renew`. Args: `axis` of the time.
export class LiveSpectrogram extends Spectrogram {
  name = "";

  constructor(signals, axis) {
    super(axis);
    this.runs = [{ signals, shift: 0, spectrogram: (name) => get(`/api/spectrogram?${query([name])}`) }];
  }

  renew() {
    return this.fetch();
  }

  forget() {}

  take(found) {
    const [name] = this.names,
      last = this.name === name ? this.found : null;
    this.name = name;
    const stamps = found.times,
      first = stamps[0],
      step = stamps.length > 1 ? stamps[1] - first : 0.5;
    const isSame = last?.frequency.length === found.frequency.length;
    const until = isSame ? last.times.findLastIndex((stamp) => stamp < first - 0.5 * step) + 1 : 0;
    const from = Math.max(0, until - COLUMNS),
      newest = until ? last.times[until - 1] : first;
    // Columns are equally far apart: a gap has empty ones.
    const gap = Array.from(
      { length: Math.min(COLUMNS, Math.max(0, Math.round((first - newest) / step) - 1)) },
      (_, k) => k + 1,
    );
    const joined = (before, empty, after) => [
      ...(before ?? []).slice(from, until),
      ...gap.map(empty),
      ...after,
    ];
    this.found = {
      frequency: found.frequency,
      times: joined(last?.times, (k) => newest + k * step, stamps),
      density: joined(last?.density, () => found.frequency.map(() => NaN), found.density),
      rotors: found.rotors.map((turns, rotor) => joined(last?.rotors[rotor], () => NaN, turns)),
    };
    this.greatest = greatestOf(this.found.density);
  }
}

export class SpectrogramChart extends Chart {
  bar = element("span", { className: "heat", title: "from dark to bright" });

  select(names) {
    super.select(names);
    this.plot.ariaLabel = this.plot.ariaLabel?.replace("over time", "over time and frequency") ?? null;
    if (names.length) this.plot.append(this.bar);
  }

  options() {
    const options = super.options();
    return { ...options, hooks: { ...options.hooks, drawClear: [(u) => this.drawHeat(u)] } };
  }

  range(unit) {
    return this.scales[unit] ?? [0, this.source.most];
  }
  drawEnds() {}

  drawHeat(u) {
    const { source: { found, step, most, greatest, unit } = {}, bar } = this;
    if (bar)
      setText(bar, found ? `${(DEPTH * greatest).toPrecision(2)} … ${greatest.toPrecision(2)} ${unit}` : "");
    if (!found) return;
    found.image ??= pictureOf(found.density, greatest);
    const {
        ctx,
        bbox: { left, top, width, height },
      } = u,
      half = 0.5 * found.frequency[1];
    const [x, right] = [found.times[0] - step / 2, found.times.at(-1) + step / 2].map((t) =>
      u.valToPos(t, "x", true),
    );
    const [y, bottom] = [most + half, -half].map((frequency) => u.valToPos(frequency, "y0", true));
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    ctx.imageSmoothingEnabled = false;
    ctx.drawImage(found.image, x, y, right - x, bottom - y);
    ctx.restore();
  }
}

const greatestOf = (density) =>
  density.reduce((most, column) => Math.max(most, ...column.filter((value) => value > 0)), 0);

function pictureOf(columns, greatest) {
  const picture = new ImageData(pixelsOf(columns, greatest), columns.length),
    { width, height } = picture,
    canvas = element("canvas", { width, height });
  /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d")).putImageData(picture, 0, 0);
  return canvas;
}

// Red, green, blue and opacity of a pixel a value, times to the right and frequencies up; transparent where
// there is no value.
export function pixelsOf(columns, greatest) {
  const rows = columns[0].map((_, y) => columns.map((column) => column.at(-1 - y)));
  return new Uint8ClampedArray(
    rows.flat().flatMap((value) => (value >= 0 ? [...colorOf(value, greatest), 255] : [0, 0, 0, 0])),
  );
}

// By the logarithm.
export function colorOf(value, greatest) {
  const share =
    greatest > 0
      ? Math.min(1, Math.max(0, 1 - Math.log(Math.max(value, 1e-300) / greatest) / Math.log(DEPTH)))
      : 0;
  const at = share * (COLORS.length - 1),
    k = Math.min(COLORS.length - 2, Math.floor(at));
  return COLORS[k].map((low, i) => Math.round(low + (at - k) * (COLORS[k + 1][i] - low)));
}
