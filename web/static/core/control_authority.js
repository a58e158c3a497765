// Who turns what into motor references, and what an emergency landing is at present, in words.

export const ONLY_CUT = "only Cut is obeyed";

// control_mode of the status → {text, tone: "", warn or alarm, title}
/** @type {Record<string, { text: string, tone: string, title: string }>} */
const CONTROL = {
  direct: { text: "direct", tone: "", title: "the flight computer commands the motors" },
  near_hovering: {
    text: "near-hovering",
    tone: "warn",
    title:
      "the flight computer sends angles and thrust; the microcontroller holds them with its own " +
      "filter, but does not hold position",
  },
  emergency: { text: "emergency", tone: "alarm", title: `the microcontroller lands alone; ${ONLY_CUT}` },
};

// What a press of Emergency land does, by safety.emergency_land.
/** @type {Record<string, string>} */
const PRESSED = {
  emergency: "the microcontroller lands it alone: level, descending by its barometer, position not held",
  descend: "level descent by the barometer, position not held",
  land: "controlled descent on the spot; without a pose by the barometer, position not held",
};

/** @param {any} status */
export const controlOf = (status) => CONTROL[status?.control_mode?.toLowerCase()] ?? null;
/** @param {any} status */
export const isAlone = (status) => status?.control_mode?.toLowerCase() === "emergency";
/** @param {string} chosen */
export const pressed = (chosen) => PRESSED[chosen] ?? "";

// Of an emergency landing under way: who flies and how; "" of none.
/** @param {any} status */
export function landing(status) {
  if (isAlone(status)) return CONTROL.emergency.title;
  if (status?.mode?.toLowerCase() !== "emergency_land" || status.airborne === false) return "";
  const how =
    status.behavior?.toLowerCase() === "emergency_landing"
      ? "level descent by the barometer, position not held"
      : "landing under control";
  return `${how}; ${ONLY_CUT}`;
}
