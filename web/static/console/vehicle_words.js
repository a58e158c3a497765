// What the vehicle is doing and how it is, in the words of the first screen: the pill, the line below the
// bar, and the button of the moment. Without a document, so that node can test it.

import { isAlone, landing } from "../core/control_authority.js";
import { duration, exact, fixed, shortName, words } from "../core/format.js";

/**
 * A trajectory that is flown; times in s.
 * @typedef {{ elapsed: number, duration: number | null, laps: number | null, name?: string }} Flown
 */

/**
 * What a word about the vehicle rests on.
 * @typedef {object} Seen
 * @property {any} status the newest of the vehicle, or null
 * @property {boolean} hasContact whether that status is of now
 * @property {any} [preflight] the newest check list, while the station publishes it
 * @property {number | null} [airborne] s in the air, as far as this page knows
 * @property {string} [source] estimation.source
 * @property {number} [height] m
 * @property {number} [error] m, from estimate to reference
 * @property {string[]} [problems] what is not well beside the vehicle's flags
 * @property {Flown | null} [trajectory] under way
 * @property {{ name: string, old: any, now: any }[]} [changed] by the last act in this flight that can be restored
 */

/** @type {Record<string, string>} */
const SOURCES = { poses: "on the tracker", bearings: "on bearings", both: "on poses and bearings" };
/** @type {Record<string, string>} */
const DOING = {
  take_off: "Taking off",
  land: "Landing",
  hover: "Hovering",
  brake: "Braking",
  fly_to: "Flying to a point",
  follow_trajectory: "Flying a trajectory",
  velocity: "Flown by sticks",
  external: "Flown by external references",
  near_hovering: "Near-hovering",
  emergency_landing: "Coming down level",
  excite: "Flying a step test",
};
/** @type {Record<string, string>} */
const TRAJECTORIES = {
  figure_eight: "Figure 8",
  circle: "Circle",
  waypoints: "Way-points",
  file: "Trajectory of a file",
};
const CALM = new Set(["on_bearings", "not_real_time", "oscillating"]); // flags that are told elsewhere
const AXES = ["x", "y", "z", "roll", "pitch", "yaw"]; // of status.oscillation_axis

/** @param {any} status */
const modeOf = (status) => status?.mode?.toLowerCase() ?? "";
/** @param {any} status */
const behaviorOf = (status) => status?.behavior?.toLowerCase() ?? "";
/** @param {any} preflight @returns {any[]} */
const failing = (preflight) =>
  (preflight?.checks ?? []).filter((/** @type {any} */ { state }) => state === "fail");

/** @param {any} status @returns {boolean} */
export const oscillates = (status) => Boolean(status?.airborne && status.flags?.includes("oscillating"));

// With its axis and frequency, and what was changed last.
/** @param {Seen} seen */
function oscillation({ status, changed = [] }) {
  if (!oscillates(status)) return [];
  const after =
    changed.length === 1
      ? ` after ${shortName(changed[0].name)} ${exact(changed[0].old)} → ${exact(changed[0].now)}`
      : changed.length
        ? ` after ${changed.length} changes`
        : "";
  return [
    `oscillating in ${AXES[status.oscillation_axis] ?? "?"} at ${fixed(status.oscillation_frequency, 1)} Hz${after}`,
  ];
}

// What a press takes back: "Restore kp_xy = 4".
/** @param {{ name: string, old: any }[]} changed */
export const restoreLabel = (changed) =>
  changed.length === 1
    ? `Restore ${shortName(changed[0].name)} = ${exact(changed[0].old)}`
    : `Restore ${changed.length} values`;

// What is flown on; "" where a place is not held.
/** @param {Seen} seen */
export function flownOn({ status, source = "" }) {
  if (!status || status.control_mode?.toLowerCase() !== "direct") return "";
  return SOURCES[status.flags?.includes("on_bearings") ? "bearings" : source] ?? "";
}

// The pill: tone is off, idle, ready, armed, flying, caution, warn or alarm.
/** @param {Seen} seen */
export function pillOf({ status, hasContact, preflight, airborne = null }) {
  const mode = modeOf(status);
  if (!hasContact) return { word: status ? "NO CONTACT" : "NO DATA YET", tone: status ? "warn" : "off" };
  if (isAlone(status)) return { word: "LANDING ALONE", tone: "alarm" };
  if (mode === "cut") return { word: "MOTORS CUT", tone: "warn" };
  if (mode === "emergency_land") return { word: "EMERGENCY LANDING", tone: "warn" };
  if (oscillates(status)) return { word: "OSCILLATING", tone: "caution" };
  if (status.airborne && status.flags?.includes("off_reference"))
    return { word: "OFF REFERENCE", tone: "caution" };
  if (status.airborne && behaviorOf(status) === "land") return { word: "LANDING", tone: "flying" };
  if (status.airborne)
    return { word: airborne === null ? "FLYING" : `FLYING ${duration(airborne)}`, tone: "flying" };
  if (mode === "bench") return { word: "BENCH", tone: "armed" };
  if (status.armed) return { word: "ARMED", tone: "armed" };
  if (mode === "starting") return { word: "STARTING", tone: "idle" };
  if (!preflight) return { word: "MOTORS OFF", tone: "idle" };
  return preflight.ready ? { word: "READY", tone: "ready" } : { word: "NOT READY", tone: "warn" };
}

// The id of the large button: what comes next.
/** @param {any} status */
export function nextStep(status) {
  if (!status?.armed || ["cut", "bench"].includes(modeOf(status))) return "arm";
  return status.airborne || !["ground", "idle", ""].includes(behaviorOf(status)) ? "land" : "take-off";
}

// Whether motors that turn on the ground may be stopped.
/** @param {any} status */
export const maySwitchOff = (status) => Boolean(status?.armed) && nextStep(status) === "take-off";

/** @param {string[]} problems */
function health(problems) {
  if (!problems.length) return "no warnings";
  const more = problems.length - 1;
  return `${problems[0]}${more ? `, ${more} more warning${more > 1 ? "s" : ""}` : ""}`;
}

// "Figure 8, lap 2 of 3"; undefined of a trajectory that is not known.
/** @param {Seen["trajectory"]} [trajectory] */
export function lapOf(trajectory) {
  const { elapsed = 0, duration: lasts = null, laps = null, name = "" } = trajectory ?? {};
  const lap =
    laps && lasts ? `lap ${Math.min(laps, 1 + Math.floor((laps * elapsed) / lasts))} of ${laps}` : "";
  return [TRAJECTORIES[name], lap].filter(Boolean).join(", ") || undefined;
}

/** @param {Seen["trajectory"]} trajectory */
const clockOf = (trajectory) =>
  trajectory?.duration ? `${duration(trajectory.elapsed)} of ${duration(trajectory.duration)}` : "";

// The line in words; "" while nothing is known, which another notice tells.
/** @param {Seen} seen */
export function lineOf(seen) {
  const { status, hasContact, preflight, height = NaN, error = NaN, problems = [] } = seen;
  if (!hasContact) return "";
  const mode = modeOf(status),
    flags = status.flags ?? [];
  const found = [
    ...oscillation(seen),
    ...flags.filter((/** @type {string} */ flag) => !CALM.has(flag)).map(words),
    ...problems,
  ];
  if (mode === "cut") return "Motors cut. Hold Disarm to acknowledge it";
  if (landing(status)) return `Emergency landing: ${landing(status)}`;
  if (status.airborne) {
    const doing =
      lapOf(seen.trajectory) ??
      DOING[behaviorOf(status)] ??
      words(status.behavior).replace(/^./, (letter) => letter.toUpperCase());
    const place = [Number.isFinite(height) ? `at ${fixed(height, 2)} m` : "", flownOn(seen)]
      .filter(Boolean)
      .join(" ");
    const miss = Number.isFinite(error) && flownOn(seen) ? `${Math.round(1e3 * error)} mm error` : "";
    return [`${doing} ${place}`.trim(), clockOf(seen.trajectory), miss, health(found)]
      .filter(Boolean)
      .join(", ");
  }
  if (mode === "bench") return "A motor is turning on the bench";
  if (status.armed) return `On the ground, motors on, ${health(found)}`;
  if (mode === "starting") return "Starting: keep the vehicle still until gyroscope and pose are ready";
  const bad = failing(preflight).map(({ name, found: value }) => `${name} ${value}`);
  if (bad.length) return `On the ground, not ready to arm: ${health(bad)}`;
  return `On the ground, ${preflight ? "ready to arm" : "motors off"}, ${health(found)}`;
}
