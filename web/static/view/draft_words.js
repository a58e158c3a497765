// What a draft of the 3D view is, in words, and the command that its button sends.

import { duration, fixed } from "../core/format.js";

/**
 * @typedef {[number, number, number]} Point
 * @typedef {{ kind: string, points: Point[], by: string, arguments: Record<string, any>, away: number,
 *   checked?: boolean, refusal?: string, duration?: number | null, speed?: number | null,
 *   values?: Record<string, any>, removal?: Record<string, any> | null, boxes?: string[] }} Draft
 * @typedef {{ label: string, why: string, behavior?: string, values: Record<string, any> }} Step
 */

export const CHECKING = "being checked";
const THERE = 0.05; // m: a trajectory starts where the vehicle hovers
const PARAMETERS = / \(behavior\.[^)]*\)/;
const OWN_NAMES = /^(follow_trajectory|fly_to|behavior\.keep_out)( refused)?: /;
/** @param {{ kind: string }} draft */
const isBox = ({ kind }) => kind === "volume" || kind === "keep_out";

/** @param {Point} point */
const place = (point) => `${point.map((c) => fixed(c, 2)).join(", ")} m`;
/** @param {Point} point */
const triple = (point) => point.map((c) => String(Number(c.toFixed(3)))).join(" ");

// `label` is that of the trajectory.
/** @param {Draft} draft @param {string} label */
export function titleOf({ kind, points, arguments: given }, label) {
  if (kind === "target") return `Target ${place(points[0])}`;
  if (kind === "waypoints")
    return `${points.length} way-point${points.length > 1 ? "s" : ""}, the last at ${place(points[points.length - 1])}`;
  if (kind === "trajectory") return `${label} from ${place(points[0])}`;
  const [low, high] = points;
  const spans = ["x", "y", "z"].map((axis, i) => `${axis} ${fixed(low[i], 2)} to ${fixed(high[i], 2)}`);
  return `${kind === "volume" ? "Volume" : given.box} ${spans.join(", ")} m`;
}

/** @param {Draft} draft */
export function noteOf({ kind, checked, refusal, duration: lasts, speed }) {
  if (refusal) return refusal.replace(OWN_NAMES, "").replace(PARAMETERS, "");
  if (kind === "volume") return "Drag the faces.";
  if (kind === "keep_out") return "Drag the faces; a click on the ground moves it there.";
  if (!checked || lasts === null || lasts === undefined) return `${CHECKING} …`;
  return `${duration(lasts)}, up to ${fixed(speed ?? 0, 2)} m/s`;
}

// What the button does now; `why` it cannot, "" where it can.
/** @param {Draft} draft @param {any} status of the vehicle, null while it is not heard @returns {Step} */
export function stepOf(draft, status) {
  const { kind, points, checked, refusal } = draft,
    [x, y, z] = points[0];
  if (isBox(draft)) {
    const why = !status ? "no data from the vehicle" : refusal ? "the vehicle would refuse it" : "";
    return { label: kind === "volume" ? "Set volume" : "Set box", why, values: draft.values ?? {} };
  }
  const goes = kind === "target" || (kind === "trajectory" && draft.away > THERE);
  const behavior = status?.behavior?.toLowerCase();
  const why = !status
    ? "no data from the vehicle"
    : !status.airborne
      ? "take off first"
      : refusal
        ? "the vehicle cannot fly it"
        : !checked
          ? CHECKING
          : !goes && behavior !== "hover"
            ? "wait until it hovers"
            : "";
  if (goes)
    return {
      label: kind === "target" ? "Fly there" : "Fly to its start",
      why,
      behavior: "fly_to",
      values: { x, y, z },
    };
  const values =
    kind === "trajectory"
      ? draft.arguments
      : { trajectory: "waypoints", waypoints: points.map(triple).join("; ") };
  return {
    label: kind === "trajectory" ? "Fly it" : points.length > 1 ? "Fly them" : "Fly there",
    why,
    behavior: "follow_trajectory",
    values,
  };
}
