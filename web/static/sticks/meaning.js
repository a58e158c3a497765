// What the sticks' axes do in the behaviors that obey them, in words. `limit(name)` is the
// vehicle's behavior.joy_…, `holds` whether near-hovering holds the height: undefined when another
// page started it.

import { fixed } from "../core/format.js";

const DEGREES = 180 / Math.PI;
/** @type {Record<string, string>} */
const PLACE = { velocity: "the vehicle hovers", near_hovering: "level; it may drift" };

export const OBEYING = { velocity: "Velocity", near_hovering: "Near hover" };

/**
 * [what full stick does, unit, digits] of forward and left, up, turn
 * @typedef {[number, string, number]} Axis
 * @typedef {(name: string) => number} Limit
 * @param {string} behavior
 * @param {Limit} limit
 * @param {boolean | undefined} holds
 * @returns {{ plane: Axis, up: Axis[], turn: Axis }}
 */
function axes(behavior, limit, holds) {
  const turn = /** @type {Axis} */ ([DEGREES * limit("joy_yaw_rate"), "°/s", 0]),
    climb = /** @type {Axis} */ ([limit("joy_speed_z"), "m/s", 2]);
  if (behavior !== "near_hovering") return { plane: [limit("joy_speed_xy"), "m/s", 2], up: [climb], turn };
  const thrust = /** @type {Axis} */ ([100 * limit("joy_thrust"), "% of the weight", 0]);
  return {
    plane: [limit("joy_tilt"), "°", 1],
    up: holds === undefined ? [climb, thrust] : [holds ? climb : thrust],
    turn,
  };
}

/** @type {(share: number, axis: Axis) => string} */
const text = (share, [most, unit, digits]) =>
  Number.isFinite(most)
    ? `${fixed(Math.abs(share) * most, digits)}${unit.startsWith("°") && unit.length === 1 ? "" : " "}${unit}`
    : `${fixed(Math.abs(share) * 100, 0)} %`;

/**
 * Of full stick; "" while the parameters are not known.
 * @param {string} behavior
 * @param {Limit} limit
 * @param {boolean | undefined} holds
 */
export function limits(behavior, limit, holds) {
  const { plane, up, turn } = axes(behavior, limit, holds);
  if (!Number.isFinite(plane[0])) return "";
  return (
    `Full stick: ${behavior === "near_hovering" ? "tilt " : ""}${text(1, plane)}, up ` +
    `${up.map((one) => text(1, one)).join(" or ")}, turn ${text(1, turn)}`
  );
}

/**
 * What [forward, left, up, yaw] command now.
 * @param {string} behavior
 * @param {number[]} sent
 * @param {Limit} limit
 * @param {boolean | undefined} holds
 */
export function commanded(behavior, sent, limit, holds) {
  if (sent.every((value) => value === 0)) return `centred, ${PLACE[behavior]}`;
  const { plane, up, turn } = axes(behavior, limit, holds),
    tilts = behavior === "near_hovering" ? "tilted " : "";
  const parts = /** @type {[number, Axis[], string, string][]} */ ([
    [0, [plane], `${tilts}forward`, `${tilts}back`],
    [1, [plane], `${tilts}left`, `${tilts}right`],
    [2, up, "up", "down"],
    [3, [turn], "turning left", "turning right"],
  ]);
  return parts
    .filter(([axis]) => sent[axis] !== 0)
    .map(
      ([axis, most, more, less]) =>
        `${most.map((one) => text(sent[axis], one)).join(" or ")} ${sent[axis] > 0 ? more : less}`,
    )
    .join(", ");
}
