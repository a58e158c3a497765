// What an exported page has in place of core/api.js: the answers about one run, from run.js beside it.
// `quadlab log export RUN --format page` puts it there (extensions/replay/exported_page.py).

import { figuresOf } from "/static/charts/figures.js"; // paths that also hold where core/api.js is
import { pack, unpack } from "/static/extensions/replay/replay/packed.js";

/** @type {{description: any, track: string, windows: string[]}} */
const recorded = /** @type {any} */ (globalThis).quadlabRun;
const GONE = "an exported page has no server: open the run in quadlab for this";
const UNKNOWN = "an exported page computes no new signals: export it again with --derive";
const MOST = 20_000; // samples of a topic that are all here; of more, the least and greatest of stretches
const bytes = (text) => Uint8Array.from(atob(text), (one) => one.charCodeAt(0)).buffer;

const columns = new Map(),
  times = new Map(); // by signal; by topic
const topics = new Map(recorded.description.signals.map(({ name, topic }) => [name, topic]));
const constants = new Map(
  recorded.description.signals
    .filter((one) => "constant" in one)
    .map(({ name, constant }) => [name, constant ?? NaN]),
);
for (const text of recorded.windows) {
  for (const group of unpack(bytes(text))) {
    group.signals.forEach((name, k) => {
      columns.set(name, group.columns[k]);
      times.set(topics.get(name), group.times);
    });
  }
}

// How many times are at or before t.
function before(list, t) {
  let low = 0,
    high = list.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (list[middle] <= t) low = middle + 1;
    else high = middle;
  }
  return low;
}

const timesOf = (name) => times.get(topics.get(name)) ?? new Float64Array();
const valueAt = (name, k) => columns.get(name)?.[k] ?? constants.get(name) ?? NaN;

// The least and the greatest of every few samples where there are more than `points` of them twice; a
// gap in them stays one. Without extremes: one of every few samples, all signals' at the same times.
function cut(names, start, end, points, extremes) {
  const list = timesOf(names[0]);
  const first = Math.max(0, before(list, start) - 1),
    last = Math.min(list.length, before(list, end) + 1),
    count = Math.max(0, last - first);
  if (!extremes) {
    const step = Math.max(1, Math.ceil(count / points)),
      picked = Array.from({ length: Math.ceil(count / step) }, (_, i) => first + i * step);
    return {
      signals: names,
      times: Float64Array.from(picked, (k) => list[k]),
      columns: names.map((name) => Float32Array.from(picked, (k) => valueAt(name, k))),
    };
  }
  const size = count <= 2 * points ? 1 : Math.ceil(count / points);
  const kept = size === 1 ? list.slice(first, last) : new Float64Array(2 * Math.ceil(count / size));
  const found = names.map(() => new Float32Array(kept.length));
  for (let bin = 0, k = first; k < last; bin++, k += size) {
    const stop = Math.min(last, k + size);
    if (size > 1) {
      kept[2 * bin] = list[k];
      kept[2 * bin + 1] = list[stop - 1];
    }
    names.forEach((name, c) => {
      if (size === 1) {
        found[c][bin] = valueAt(name, k);
        return;
      }
      let low = Infinity,
        high = -Infinity,
        whole = true;
      for (let i = k; i < stop; i++) {
        const value = valueAt(name, i);
        if (Number.isNaN(value)) whole = false;
        else {
          low = Math.min(low, value);
          high = Math.max(high, value);
        }
      }
      found[c][2 * bin] = low <= high ? low : NaN;
      found[c][2 * bin + 1] = whole ? high : NaN;
    });
  }
  return { signals: names, times: kept, columns: found };
}

function newest(name, t) {
  const list = timesOf(name);
  let k = before(list, t) - 1;
  if (k > 0 && Number.isNaN(valueAt(name, k))) k -= 1; // what parts a gap
  if (k < 0) return [null, null];
  const value = valueAt(name, k);
  return [Number.isFinite(value) ? value : null, t - list[k]];
}

// Of a topic that is not here with every sample, no mean is known.
function statistics(name, start, end) {
  const list = timesOf(name),
    found = figuresOf(columns.get(name) ?? [], before(list, start), before(list, end));
  return recorded.description.topics[topics.get(name)]?.count > MOST
    ? { ...found, mean: null, rms: null }
    : found;
}

/** @param {string} path @returns {Promise<any>} */
export async function get(path) {
  const { pathname, searchParams } = new URL(path, "http://run/"),
    names = searchParams.getAll("signal");
  if (pathname === "/api/session")
    return {
      vehicle: recorded.description.vehicle,
      vehicles: [],
      role: "viewer",
      label: "recorded flight",
      pages: [],
    };
  if (pathname === "/api/runs" || pathname === "/api/replay") return [];
  if (/^\/api\/replay\/[^/]+$/.test(pathname)) return recorded.description;
  if (pathname.endsWith("/at"))
    return Object.fromEntries(names.map((name) => [name, newest(name, Number(searchParams.get("t")))]));
  if (pathname.endsWith("/statistics"))
    return Object.fromEntries(
      names.map((name) => [
        name,
        statistics(name, Number(searchParams.get("start")), Number(searchParams.get("end"))),
      ]),
    );
  if (pathname.endsWith("/expressions"))
    return searchParams
      .getAll("text")
      .map(
        (text) =>
          recorded.description.signals.find(({ name }) => name === text) ?? { name: text, problem: UNKNOWN },
      );
  throw new Error(GONE);
}

/** @param {string} path @returns {Promise<ArrayBuffer>} */
export async function binary(path) {
  const { pathname, searchParams } = new URL(path, "http://run/");
  if (pathname.endsWith("/track")) return bytes(recorded.track);
  if (!pathname.endsWith("/window")) throw new Error(GONE);
  const number = (name) => Number(searchParams.get(name)),
    byTopic = new Map();
  for (const name of searchParams.getAll("signal"))
    byTopic.set(topics.get(name), [...(byTopic.get(topics.get(name)) ?? []), name]);
  return pack(
    [...byTopic.values()].map((names) =>
      cut(names, number("start"), number("end"), number("points"), searchParams.get("extremes") !== "false"),
    ),
  );
}

/** @param {string} _method @param {string} _path @returns {Promise<any>} */
export async function request(_method, _path) {
  throw new Error(GONE);
}
/** @param {string} _name @returns {Promise<any>} */
// No command is ever sent.
export const commands = new EventTarget();

export async function command(_name) {
  throw new Error(GONE);
}
