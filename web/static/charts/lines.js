// How lines look, and their way through samples: gaps stay gaps, many samples a pixel become one stroke.

/** @type {Record<string, string>} */
const AXIS = {
  x: "var(--x)",
  y: "var(--y)",
  z: "var(--z)",
  roll: "var(--x)",
  pitch: "var(--y)",
  yaw: "var(--z)",
};
const OTHERS = ["teal", "violet", "gold", "rose", "accent", "amber", "y", "text"].map(
  (name) => `var(--${name})`,
);
const DASHES = [[], [9, 3], [2, 3], [9, 3, 2, 3]];
const REFERENCE = [5, 4],
  TRUTH = [1.5, 3];

/** @param {string} name */
export const isReference = (name) => name.startsWith("reference.");

// [{ stroke, dash }] of the signals of one chart. x, y, z have the page's colours; a second such
// vector is dashed, and so are other lines, each in its own way: colour is not the only sign.
/** @param {string[]} names */
export function stylesOf(names) {
  /** @type {string[]} */
  const vectors = [];
  let others = 0;
  return names.map((name) => {
    const parts = name.split("."),
      axis = parts.pop() ?? "",
      of = parts.join(".");
    if (!(axis in AXIS)) {
      const i = others++;
      return { stroke: OTHERS[i % OTHERS.length], dash: DASHES[i % DASHES.length] };
    }
    const stroke = AXIS[axis];
    if (isReference(name)) return { stroke, dash: REFERENCE };
    if (name.startsWith("truth.position.")) return { stroke, dash: TRUTH };
    if (!vectors.includes(of)) vectors.push(of);
    return { stroke, dash: DASHES[vectors.indexOf(of) % DASHES.length] };
  });
}

// Least and largest of what is finite; [null, null] of nothing.
/**
 * @param {ArrayLike<number>} values
 * @param {number} from
 * @param {number} to
 * @param {number | null} low
 * @param {number | null} high
 * @returns {[number | null, number | null]}
 */
export function extent(values, from, to, low = null, high = null) {
  for (let i = from; i < to; i++) {
    const value = values[i];
    if (!(Math.abs(value) < Infinity)) continue;
    if (low === null || value < low) low = value;
    if (high === null || value > high) high = value;
  }
  return [low, high];
}

// Path2D of samples [from, to), and where its last point is. xOf(time) and yOf(value): canvas pixels.
/**
 * @param {ArrayLike<number>} times
 * @param {ArrayLike<number>} values
 * @param {number} from
 * @param {number} to
 * @param {(time: number) => number} xOf
 * @param {(value: number) => number} yOf
 */
export function trace(times, values, from, to, xOf, yOf) {
  const path = new Path2D();
  let pen = false,
    column = NaN,
    first = 0,
    low = 0,
    high = 0,
    last = 0,
    count = 0,
    end = null,
    start = 0;
  const flush = () => {
    // one stroke for all samples of a pixel
    if (!count) return;
    if (pen) path.lineTo(column, first);
    else {
      path.moveTo(column, first);
      start = 0;
    }
    if (count > 2) {
      path.lineTo(column, low);
      path.lineTo(column, high);
    }
    if (count > 1) path.lineTo(column, last);
    start += count;
    pen = true;
    count = 0;
  };
  const lift = () => {
    flush();
    if (pen && start === 1) path.lineTo(column + 1, last); // a sample alone is a dot
    pen = false;
  };
  for (let i = from; i < to; i++) {
    const value = values[i];
    if (!(Math.abs(value) < Infinity)) {
      lift();
      continue;
    }
    const x = Math.round(xOf(times[i])),
      y = yOf(value);
    if (x !== column) {
      flush();
      column = x;
    }
    if (!count) first = low = high = y;
    else if (y < low) low = y;
    else if (y > high) high = y;
    last = y;
    count += 1;
    end = [x, y];
  }
  lift();
  return { path, end };
}

// A little air, and a least height for each unit: noise should look like noise.
/** @type {Record<string, number>} */
const LEAST = {
  m: 0.02,
  "m/s": 0.05,
  "m/s²": 0.2,
  "°": 1,
  "°/s": 2,
  N: 0.5,
  "N m": 0.02,
  kg: 0.01,
  V: 0.2,
  mm: 2,
  ms: 5,
  µs: 50,
  count: 2,
  "%": 1,
  Hz: 2,
};

/** @param {number | null} low @param {number | null} high @param {string} unit @returns {[number, number]} */
export function spread(low, high, unit) {
  if (low === null || high === null) return [-1, 1];
  const height = high - low,
    scale = Math.max(Math.abs(low), Math.abs(high));
  const least = LEAST[unit] ?? (scale > 0 ? Math.min(0.01, 0.1 * scale) : 1);
  const room = Math.max(0.08 * height, 0.5 * (least - height), 1e-9 * scale);
  return [low - room, high + room];
}
