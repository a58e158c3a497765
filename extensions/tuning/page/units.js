// Figures of step tests in the units people read: lengths in mm, angles in degrees.

import { fixed, NONE, words } from "/static/core/format.js";

export const DEGREES = 180 / Math.PI;
const TIME = { unit: "s", digits: 2 };

// What is shown of a test, in order: [name, label, hint].
export const FIGURES = [
  ["delay", "delay to 50 %", "from the edge to half of the step"],
  ["rise", "rise 10–90 %", "from 10 to 90 % of the step"],
  ["overshoot", "overshoot", "overshoot beyond the set-point, as a share of the step"],
  ["settling", "settling 5 %", "until it stays within 5 % of the step about the set-point"],
  ["steady_error", "steady error", "set-point minus actual, over the last fifth of each level"],
  ["rms_error", "rms error", "set-point minus actual, over the whole test"],
  ["cross_x", "moved x", "largest error on an axis that should not move"],
  ["cross_y", "cross-axis y", "largest error on an axis that should not move"],
  ["cross_z", "moved z", "largest error on an axis that should not move"],
  ["cross_yaw", "cross-axis yaw", "largest error on an axis that should not move"],
  ["peak_tilt", "peak tilt", "largest tilt of the body"],
  ["peak_motor", "peak motor", "largest motor reference, counts"],
  ["peak_yaw_torque", "peak yaw torque", "largest commanded torque about the body's z axis"],
  ["saturated", "saturated", "share of ticks in which the motors saturated"],
];

// { unit, digits, scale } of a figure of a test on this axis.
export function unitOf(name, axis) {
  if (["delay", "rise", "settling"].includes(name)) return { ...TIME, scale: 1 };
  if (["overshoot", "saturated"].includes(name)) return { unit: "%", digits: 1, scale: 1 };
  if (name === "peak_tilt") return { unit: "°", digits: 1, scale: 1 };
  if (name === "peak_motor") return { unit: "", digits: 0, scale: 1 };
  if (name === "peak_yaw_torque") return { unit: "N m", digits: 3, scale: 1 };
  const isAngle = name === "cross_yaw" || (!name.startsWith("cross_") && axis === "yaw");
  return isAngle ? { unit: "°", digits: 1, scale: DEGREES } : { unit: "mm", digits: 0, scale: 1e3 };
}

export function figure(name, value, axis) {
  const { digits, scale } = unitOf(name, axis);
  return value === null || value === undefined ? NONE : fixed(value * scale, digits);
}

// "x step 0.30 m", "yaw doublet 20°, 3 times"
export function describe({ axis, shape, amplitude, repeats }) {
  const size = axis === "yaw" ? `${fixed(amplitude * DEGREES, 0)}°` : `${fixed(amplitude, 2)} m`;
  return `${words(axis)} ${shape} ${size}${repeats > 1 ? `, ${repeats} times` : ""}`;
}
