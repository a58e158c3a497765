// Numbers, times and sizes as people read them; "–" for what is not known.

import { partsOf, zoneMark } from "./time_zone.js";

export const NONE = "–";
/** @type {(value: number | null | undefined) => value is number} */
const known = (value) => value !== null && value !== undefined && Number.isFinite(value);

/** @param {number} n */
const two = (n) => String(n).padStart(2, "0");

/** @param {number | null | undefined} value @param {number} digits */
export function fixed(value, digits) {
  if (!known(value)) return NONE;
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** @param {number | null | undefined} value */
export function seconds(value) {
  if (!known(value)) return NONE;
  if (value < 0.9995) return `${Math.round(value * 1e3)} ms`;
  return value < 100 ? `${value.toFixed(1)} s` : duration(value);
}

/** @param {number | null | undefined} value */
export function duration(value) {
  if (!known(value)) return NONE;
  const whole = Math.floor(value),
    hours = Math.floor(whole / 3600);
  const text = [Math.floor(whole / 60) % 60, whole % 60].map(two).join(":");
  return hours ? `${hours}:${text}` : text;
}

// The time of a Date, or of s since 1970, in the chosen zone: "09:31:23" or "08:31:23Z", with its day before,
// or with its day unless that is today.
/** @type {(at: Date | number) => Date} */
const dateOf = (at) => (at instanceof Date ? at : new Date(at * 1e3));
/** @type {(at: Date | number) => string} */
export const day = (at) => {
  const [year, month, date] = partsOf(dateOf(at));
  return [year, month + 1, date].map(two).join("-");
};
/** @type {(at: Date | number, digits?: number) => string} */
export function clock(at, digits = 0) {
  const date = dateOf(at),
    share = digits
      ? `.${String(Math.floor(date.getMilliseconds() / 10 ** (3 - digits))).padStart(digits, "0")}`
      : "";
  return `${partsOf(date).slice(3).map(two).join(":")}${share}${zoneMark()}`;
}
/** @type {(at: Date | number) => string} */
export const moment = (at) => `${day(at)} ${clock(at)}`;
// To the minute.
/** @type {(at: Date | number) => string} */
export const minute = (at) => `${day(at)} ${partsOf(dateOf(at)).slice(3, 5).map(two).join(":")}${zoneMark()}`;
/** @type {(at: Date | number) => string} */
export const timeOf = (at) => (day(at) === day(new Date()) ? clock(at) : moment(at));

// How long ago a time was, in s since 1970.
/** @param {number | null | undefined} stamp */
export function ago(stamp) {
  if (!stamp) return "never";
  const age = Math.max(0, Date.now() / 1e3 - stamp);
  if (age < 5) return "now";
  if (age < 120) return `${Math.round(age)} s ago`;
  if (age < 7200) return `${Math.round(age / 60)} min ago`;
  return age < 48 * 3600 ? `${Math.round(age / 3600)} h ago` : day(stamp);
}

/** @param {number | null | undefined} value */
export function bytes(value) {
  if (!known(value)) return NONE;
  if (value < 1e6) return `${(value / 1e3).toFixed(value < 1e4 ? 1 : 0)} kB`;
  return value < 1e9 ? `${(value / 1e6).toFixed(value < 1e7 ? 1 : 0)} MB` : `${(value / 1e9).toFixed(2)} GB`;
}

// A number as people type it, also with a decimal comma; NaN for anything else.
/** @param {string} text */
export const parseNumber = (text) =>
  text.trim() === "" ? NaN : Number(text.trim().replace(",", ".").replace("−", "-"));

// As many digits as a step of this size needs.
/** @param {number} step */
export const digitsOf = (step) => Math.min(7, Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)));

/** @param {unknown} value */
export function exact(value) {
  if (typeof value !== "number") return String(value);
  return String(Number(value.toPrecision(7)));
}

// "kp_xy" of "control.position.kp_xy".
/** @param {string} name */
export const shortName = (name) => name.slice(name.lastIndexOf(".") + 1);

/** @param {string | null | undefined} name */
export const words = (name) =>
  name
    ? String(name)
        .toLowerCase()
        .replace("near_hovering", "near-hovering")
        .replace(/^excite$/, "step test")
        .replace("figure_eight", "figure 8")
        .replaceAll("_", " ")
    : NONE;

// A refusal without the name of what was refused, where that stands beside it.
/** @param {string} text */
export const reasonOf = (text) => text.replace(/^[a-z_]+ refused: /, "");
