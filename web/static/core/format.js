// Numbers, times and sizes as people read them; "–" for what is not known.

export const NONE = "–";
/** @type {(value: number | null | undefined) => value is number} */
const known = (value) => value !== null && value !== undefined && Number.isFinite(value);

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
  const whole = Math.floor(value), hours = Math.floor(whole / 3600);
  const clock = [Math.floor(whole / 60) % 60, whole % 60].map((n) => String(n).padStart(2, "0")).join(":");
  return hours ? `${hours}:${clock}` : clock;
}

// The time of a Date, or of s since 1970, by this computer's clock: "09:31:23", with its day before, or
// with its day unless that is today.
/** @type {(at: Date | number) => Date} */
const dateOf = (at) => (at instanceof Date ? at : new Date(at * 1e3));
/** @type {(at: Date | number) => string} */
export const clock = (at) => dateOf(at).toTimeString().slice(0, 8);
/** @type {(at: Date | number) => string} */
export function moment(at) {
  const date = dateOf(at);
  return `${[date.getFullYear(), date.getMonth() + 1, date.getDate()].map((n) => String(n).padStart(2, "0")).join("-")} ${clock(date)}`;
}
/** @type {(at: Date | number) => string} */
export const timeOf = (at) => (dateOf(at).toDateString() === new Date().toDateString() ? clock(at) : moment(at));

// How long ago a time was, in s since 1970.
/** @param {number | null | undefined} stamp */
export function ago(stamp) {
  if (!stamp) return "never";
  const age = Math.max(0, Date.now() / 1e3 - stamp);
  if (age < 5) return "now";
  if (age < 120) return `${Math.round(age)} s ago`;
  if (age < 7200) return `${Math.round(age / 60)} min ago`;
  return age < 48 * 3600 ? `${Math.round(age / 3600)} h ago` : new Date(stamp * 1e3).toISOString().slice(0, 10);
}

/** @param {number | null | undefined} value */
export function bytes(value) {
  if (!known(value)) return NONE;
  if (value < 1e6) return `${(value / 1e3).toFixed(value < 1e4 ? 1 : 0)} kB`;
  return value < 1e9 ? `${(value / 1e6).toFixed(value < 1e7 ? 1 : 0)} MB` : `${(value / 1e9).toFixed(2)} GB`;
}

// A number as people type it, also with a decimal comma; NaN for anything else.
/** @param {string} text */
export const parseNumber = (text) => (text.trim() === "" ? NaN : Number(text.trim().replace(",", ".").replace("−", "-")));

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
export const words = (name) => (name ? String(name).toLowerCase().replace("near_hovering", "near-hovering").replaceAll("_", " ") : NONE);

// A refusal without the name of what was refused, where that stands beside it.
/** @param {string} text */
export const reasonOf = (text) => text.replace(/^[a-z_]+ refused: /, "");
