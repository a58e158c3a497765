// The zone in which all pages write times: this computer's, or UTC. Kept by the browser.

const KEPT = "quadlab.times";
let chosen = kept();

// "change" when times are written in another zone.
export const timeZone = new EventTarget();

function kept() {
  try {
    return localStorage.getItem(KEPT) ?? "";
  } catch {
    return "";
  }
}

export const zone = () => chosen;

/** @param {string} choice */
export function chooseZone(choice) {
  chosen = choice;
  try {
    localStorage.setItem(KEPT, choice);
  } catch {
    /* a private window forgets */
  }
  timeZone.dispatchEvent(new Event("change"));
}
globalThis.addEventListener?.("storage", ({ key }) => {
  if (key === KEPT) chooseZone(kept());
}); // in another window

const isUtc = () => chosen === "utc";

// Year, month (from 0), day, hour, minute and second of a time in the chosen zone.
/** @param {Date} date */
export function partsOf(date) {
  return isUtc()
    ? [
        date.getUTCFullYear(),
        date.getUTCMonth(),
        date.getUTCDate(),
        date.getUTCHours(),
        date.getUTCMinutes(),
        date.getUTCSeconds(),
      ]
    : [
        date.getFullYear(),
        date.getMonth(),
        date.getDate(),
        date.getHours(),
        date.getMinutes(),
        date.getSeconds(),
      ];
}

// ms of a date in the chosen zone at its beginning: a day may have 23 or 25 hours.
/** @param {number} year @param {number} month @param {number} day */
export const startOfDay = (year, month, day) =>
  isUtc() ? Date.UTC(year, month, day) : new Date(year, month, day).getTime();

// What a time of this zone ends with.
export const zoneMark = () => (isUtc() ? "Z" : "");
