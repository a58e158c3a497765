// Colours and heights of a replay's charts: as on the live page.

const AXIS = { x: "#e5827c", y: "#76c495", z: "#79a9ea", roll: "#e5827c", pitch: "#76c495", yaw: "#79a9ea" };
const OTHERS = ["#c9b06b", "#b08fd8", "#6fc3c6", "#d08fae", "#9aa8b4", "#e0a36a", "#8fbf73"];
const LEAST = { m: 0.02, "m/s": 0.05, "m/s²": 0.2, "°": 1, "°/s": 2, N: 0.5, "N m": 0.02, kg: 0.01, V: 0.2, mm: 2, ms: 5, "µs": 50, count: 2, "%": 1, Hz: 2 };

// Colour and dashes of each signal: an axis has its colour, a reference that of what it is for.
export function styleOf(names) {
  const others = [...OTHERS];
  return names.map((name) => {
    const isThin = name.startsWith("reference.") || name.startsWith("truth.position.");
    return { stroke: AXIS[name.split(".").at(-1)] ?? others.shift() ?? "#d5dbe1", dash: isThin ? [5, 4] : undefined };
  });
}

// A little air, and a least height for each unit: noise should look like noise.
export function spread(low, high, units) {
  if (low === null || high === null || low === undefined) return [-1, 1];
  const least = Math.max(1e-6, 1e-6 * Math.abs(high), ...[...units].map((unit) => LEAST[unit] ?? 0)), height = high - low;
  const room = Math.max(0.08 * height, 0.5 * (least - height));
  return [low - room, high + room];
}
