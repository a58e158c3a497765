// Runs in words, and a search in the words of the API.

import { duration, fixed, moment, words } from "../core/format.js";
import { startOfDay } from "../core/time_zone.js";

const DATE = /^(\d{4})(?:-(\d{2})(?:-(\d{2}))?)?$/;

export const startOf = (run) => moment(run.start_ns / 1e9);

const inSeconds = (value) =>
  value < 0.05 ? "< 0.1 s" : value < 100 ? `${value.toFixed(1)} s` : duration(value);

// [text, class, reason]: complete, partly restored, missing, recovered, what is wrong; never by colour alone.
export function state(run) {
  if (run.recording) return ["● recording", "going", "being recorded now"];
  if (run.problem) return ["problem", "warn", run.problem];
  const { state: ticks, missing, filled, line } = run.completeness ?? {};
  if (ticks === "missing") return [`${inSeconds(missing)} missing`, "warn", line];
  if (ticks === "filled") return [`complete (${inSeconds(filled)} restored)`, "", line];
  if (run.recovered) return ["recovered", "", "its end was lost; what was recorded until then is here"];
  if (run.complete)
    return ticks === "complete"
      ? ["complete", "", line]
      : ["closed", "", line ?? "closed with its index; not compared with the vehicle's own log"];
  return ["not closed", "warn", "the recording was cut off; it is repaired when the station starts"];
}

export const lasted = (run) => (run.complete || run.duration ? duration(run.duration) : "–");
export const experiment = (run) =>
  run.report ? `${words(run.experiment)}: ${run.verdict ? words(run.verdict) : "?"}` : "";
export const verdict = (run) => (run.report ? (run.verdict ? words(run.verdict) : "?") : "");

// The rms position error that its experiment was judged by, in mm.
export const rms = (run) =>
  Number.isFinite(run.rms ?? NaN) ? `${fixed(1e3 * run.rms, run.rms < 0.1 ? 1 : 0)} mm` : "";

// Query of /api/runs/search: dates (2026, 2026-01, 2026-01-31, first..last) are of the chosen zone.
export function query(text, tag, vehicle = "") {
  const given = new URLSearchParams(),
    rest = [];
  for (const word of text.trim().split(/\s+/).filter(Boolean)) {
    const span = spanOf(word);
    if (!span) {
      rest.push(word);
      continue;
    }
    given.set("since_ns", `${span[0]}000000`);
    given.set("until_ns", `${span[1]}000000`);
  }
  if (rest.length) given.set("words", rest.join(" ").slice(0, 300));
  if (tag) given.set("tag", tag);
  if (vehicle) given.set("vehicle", vehicle);
  return given;
}

// [first ms, ms after the last] of a date or of two, or null.
export function spanOf(word) {
  const [first, last = first, more] = word.split("..");
  const from = bounds(first),
    to = bounds(last);
  return more === undefined && from && to && from[0] < to[1] ? [from[0], to[1]] : null;
}

function bounds(word) {
  const [, year, month, date] = DATE.exec(word) ?? [];
  if (!year || Number(year) < 2000 || Number(year) > 2200 || Number(month) > 12 || Number(date) > 31)
    return null;
  const y = Number(year),
    m = month ? Number(month) - 1 : 0,
    d = date ? Number(date) : 1;
  return [
    startOfDay(y, m, d),
    date ? startOfDay(y, m, d + 1) : month ? startOfDay(y, m + 1, 1) : startOfDay(y + 1, 0, 1),
  ];
}
