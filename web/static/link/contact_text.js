// A lost contact in words: what the vehicle was last seen doing, and what it does next by itself.

import { fixed, words } from "../core/format.js";

/** @type {Record<string, { does: string, doing: string }>} */
export const REACTIONS = {
  none: { does: "continues as before", doing: "continuing as before" },
  brake: { does: "brakes and hovers", doing: "braking, then hovering" },
  land: { does: "lands", doing: "landing" },
  descend: { does: "comes down level by its barometer", doing: "coming down level by its barometer" },
  emergency: {
    does: "leaves the landing to its microcontroller",
    doing: "landed by its microcontroller alone",
  },
  cut: { does: "stops its motors", doing: "falling, its motors stopped" },
};

/** @param {number} value */
const span = (value) => `${fixed(value, value < 10 ? 1 : 0)} s`;

/** @param {any} status @param {number} height @param {{ voltage: number } | null} battery */
export function lastState(status, height, battery) {
  if (!status) return "never seen";
  const flies = /emergency|cut/i.test(status.mode) ? words(status.mode) : `flying, ${words(status.behavior)}`;
  const where = status.airborne ? flies : `on the ground, motors ${status.armed ? "on" : "off"}`;
  const up = status.airborne && Number.isFinite(height) ? `, at ${fixed(height, 1)} m` : "";
  return `${where}${up}${battery ? `, ${fixed(battery.voltage, 1)} V` : ""}`;
}

/**
 * @param {string} cause page, station, link or flight
 * @param {any} status
 * @param {number} silent s
 * @param {(name: string) => any} safety a parameter of safety, as confirmed
 */
export function byItself(cause, status, silent, safety) {
  if (!status) return "";
  if (cause === "page")
    return status.airborne
      ? "The current command continues: it does not depend on this page. Sticks of this page were released."
      : "It does not depend on this page.";
  if (!status.armed) return "It does nothing until contact is back.";
  if (/emergency/i.test(status.mode)) return "It continues its landing on its own.";
  if (cause === "flight") {
    const timeout = safety("command_timeout");
    const after = timeout === undefined ? "" : ` after ${fixed(timeout, 2)} s without commands`;
    return status.airborne
      ? `Its microcontroller lands it alone${after}.`
      : `Its microcontroller stops the motors${after}.`;
  }
  if (!status.airborne) return "Its motors keep turning until contact is back: keep away from it.";
  const timeout = safety("link_timeout"),
    after = safety("link_land_after");
  const first = REACTIONS[safety("link_reaction")],
    then = REACTIONS[safety("link_land_reaction")];
  if (timeout === undefined || after === undefined || !first || !then)
    return "Its own reaction is not known here: its parameters have not been read.";
  const left = timeout + after - silent;
  if (silent < timeout)
    return `On its own it ${first.does} ${span(timeout - silent)} from now, and ${then.does} ${span(after)} later.`;
  if (left > 0) return `On its own it should be ${first.doing} now; it ${then.does} in ${span(left)}.`;
  return `On its own it should be ${then.doing} now, for ${span(-left)}.`;
}
