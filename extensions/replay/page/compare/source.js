// The signals of several runs as a chart's source: a colour, a dash and a letter a run, or each run's difference
// to the first one.

import { figuresOf } from "/static/charts/figures.js";
import { indexAt } from "/static/charts/history.js";
import { setText } from "/static/core/dom.js";
import { RecordedSignals } from "../replay/recorded_signals.js";

const COLORS = ["accent", "flown", "teal", "violet", "rose", "y", "gold", "z"].map(
  (name) => `var(--${name})`,
);
const DASHES = [[], [8, 3], [2, 3], [8, 3, 2, 3]];
const LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ";

// How the k-th run looks everywhere on the page.
export const look = (k) => ({
  letter: LETTERS[k],
  stroke: COLORS[k % COLORS.length],
  dash: DASHES[Math.floor(k / 2) % DASHES.length],
});

export class ComparedSignals extends RecordedSignals {
  // all: the runs, with `number`; shown: those whose lines these are; isDifference: to the first of all
  constructor(clock, range, points, all, shown, isDifference = false) {
    super(clock, range, points, !isDifference);
    this.known = new Map(all.flatMap((run) => [...run.signals]));
    this.runs = all;
    this.shown = shown;
    this.isDifference = isDifference;
    this.differences = new Map(); // run → what was computed of which windows
  }

  get signals() {
    return this.known;
  }

  lines(names) {
    this.names = names;
    this.clear();
    return this.linesOf(names);
  }

  linesOf(names) {
    return this.shown.flatMap((run) =>
      run.known(names).map((name) => {
        const { letter, stroke, dash } = look(run.number);
        return {
          name,
          run,
          stroke,
          dash,
          label: this.isDifference ? `${letter} − ${look(this.runs[0].number).letter}` : letter,
        };
      }),
    );
  }

  samples(line, min, max) {
    const piece = super.samples(line, min, max);
    if (!this.isDifference || !piece) return piece;
    const first = super.samples({ ...line, run: this.runs[0] }, min, max);
    if (!first) return undefined;
    const known = this.differences.get(line.run);
    if (known?.values !== piece.values || known.of !== first.values || known.shift !== piece.shift) {
      this.differences.set(line.run, {
        values: piece.values,
        of: first.values,
        shift: piece.shift,
        found: difference(piece, first),
      });
    }
    return { ...piece, values: this.differences.get(line.run).found };
  }

  // Of a difference, of what is drawn.
  async figures(line, from, to) {
    const piece = this.isDifference ? this.samples(line, from, to) : null;
    return piece ? figuresOf(piece.values, piece.from, piece.to) : super.figures(line, from, to);
  }

  async table(names, from, to) {
    if (!this.isDifference) return super.table(names, from, to);
    return this.linesOf(names).flatMap(({ name, run, label }) => {
      const piece = this.samples({ name, run }, from, to);
      const part = (list) => Array.from(list.slice(piece?.from, piece?.to));
      return piece
        ? [
            {
              names: [`${name}, ${label}`],
              times: part(piece.times).map((time) => time - piece.shift),
              columns: [part(piece.values)],
            },
          ]
        : [];
    });
  }

  // The value at the cursor, of what is drawn.
  read(output, line, figure) {
    const {
      cursor,
      span: [from, to],
    } = this.range;
    setText(output, cursor === null ? "" : figure(valueAt(this.samples(line, from, to), cursor)));
  }
}

function valueAt(piece, time) {
  if (!piece) return NaN;
  const { times, values, shift } = piece,
    next = indexAt(times, time + shift, 0, times.length);
  if (next === 0 || next === times.length) return NaN;
  const share = (time + shift - times[next - 1]) / (times[next] - times[next - 1]);
  return values[next - 1] + (share > 0 ? share * (values[next] - values[next - 1]) : 0);
}

// The values less those of another piece at the same times of the page; NaN where that has none.
export function difference({ times, values, shift }, first) {
  return Float32Array.from(values, (value, k) => value - valueAt(first, times[k] - shift));
}
