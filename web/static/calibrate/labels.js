// Calibrations in words, and their figures as people read them.

import { day as dayOf, fixed, minute, NONE, words } from "../core/format.js";

// What each is for and what it needs, beside what the station says of it.
export const CALIBRATIONS = {
  gyroscope: {
    label: "Gyroscope",
    gives: "its bias at rest; also measured at each start of the vehicle",
    needs: "on the ground and still, motors off",
  },
  accelerometer: {
    label: "Accelerometer",
    gives: "its scale, axes and bias",
    needs: "the vehicle in your hands, motors off; with the tracker any poses, without it its six faces",
  },
  motor_bench: {
    label: "Motor bench",
    gives: "the law of motor and propeller, torque ratio, time constant",
    needs: "the vehicle fixed on a force/torque sensor; one motor turns, up to full speed",
  },
  mass: { label: "Mass", gives: "the mass, from a flight", needs: "free room to fly, as for hover" },
  inertia: {
    label: "Inertia",
    gives: "the inertia about three axes, from a flight",
    needs: "free room to fly; it shakes about each axis",
  },
  inertia_optimal: {
    label: "Quick inertia",
    gives: "the inertia about three axes, from the movements that show most within the vehicle's limits",
    needs: "free room to fly; it moves further than for Inertia",
  },
  drag: {
    label: "Drag",
    gives: "the drag of the whole vehicle and the height at which it acts, from a flight",
    needs: "free room to fly circles, in still air",
  },
  drag_optimal: {
    label: "Quick drag",
    gives: "drag and height, from the quickest circles within the vehicle's limits",
    needs: "free room to fly fast circles",
  },
  vibration: {
    label: "Vibration",
    gives: "the noise of accelerometer and gyroscope, at rest and in hover, for the error-state filter",
    needs: "at rest on the ground, then with free room to hover",
  },
  tracker_delay: {
    label: "Tracker's delay",
    gives: "delay of the tracker's time stamps, measured against the gyroscope",
    needs: "the vehicle in your hands, motors off, in the tracker's view; or free room to fly",
  },
  tracker_body: {
    label: "Tracked body",
    gives: "place and axes of the tracked body on the vehicle, against the IMU",
    needs: "the accelerometer calibrated; the vehicle in your hands, motors off, in the tracker's view",
  },
};
const EXPERIMENT_OF = { motor: "motor_bench" };

export const isCalibration = (name) => Object.hasOwn(CALIBRATIONS, name);
export const labelOf = (name) => CALIBRATIONS[EXPERIMENT_OF[name] ?? name]?.label ?? capital(words(name));
export const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

export const RUNNING = ["flying", "finishing", "evaluating"];
export const GOOD = ["✓", "within limit"];
export const BEYOND = ["!", "beyond limit"];

// Four digits that count: 1.308, 0.01540, 12.30, 48231.
export function figure(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return NONE;
  if (Number.isInteger(value)) return fixed(value, 0);
  const size = Math.abs(value);
  if (size < 1e-12) return "0";
  const text =
    size >= 1e4 ? String(Math.round(value)) : size < 1e-4 ? value.toExponential(2) : value.toPrecision(4);
  return text.replaceAll("-", "−");
}

// [before, after, change] of a value: with as many decimals as the difference needs to be seen; the
// change in % of what it was, or as it is where that says little. most: decimals, at most.
export function compared(before, after, most = 7) {
  if (typeof before !== "number" || typeof after !== "number")
    return [
      shown(before),
      shown(after),
      before === undefined || before === null ? NONE : before === after ? "none" : "changed",
    ];
  const difference = after - before,
    size = Math.max(Math.abs(before), Math.abs(after)),
    isSame = Math.abs(difference) <= 1e-9 * size;
  const places = (value) => Math.ceil(-Math.log10(Math.abs(value)) - 1e-9);
  const digits = Math.min(
    most,
    Math.max(0, size ? places(size) + 2 : 0, isSame ? 0 : places(difference) + 1),
  );
  const sign = difference > 0 ? "+" : "−",
    share = Math.abs(difference / before);
  const change =
    share < 0.3 ? `${(100 * share).toFixed(share < 0.1 ? 2 : 1)} %` : fixed(Math.abs(difference), digits);
  return [fixed(before, digits), fixed(after, digits), isSame ? "none" : `${sign}${change}`];
}

const shown = (value) =>
  typeof value === "number" ? figure(value) : value === undefined || value === null ? NONE : String(value);

// "2026-11-21 12:03", by "anna"; the vehicle itself at power-up.
export const when = ({ stamp_ns: stamp }) => (stamp ? minute(stamp / 1e9) : NONE);

// "today 12:03", or "2026-11-20".
export function day(record) {
  const [date, time] = when(record).split(" ");
  return date === dayOf(new Date()) ? `today ${time}` : date;
}

export const who = ({ requester }) => (requester === "start" ? "at power-up" : requester || NONE);

// "pose 3, m/s²" → ["pose 3", "m/s²"]
export function labelAndUnit(name) {
  const at = name.lastIndexOf(",");
  return at < 0 ? [name, ""] : [name.slice(0, at), name.slice(at + 1).trim()];
}
