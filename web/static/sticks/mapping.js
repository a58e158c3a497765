// Which axis and button of a pad is what, remembered for each kind of pad. The axes we send are
// forward, left, up, yaw (turn left), -1 to 1; a pad's own point right and down.

/**
 * @typedef {{ index: number, inverted: boolean }} AxisOfPad
 * @typedef {{
 *   axes: Record<string, AxisOfPad>, buttons: Record<string, number[]>, deadZone: number, expo: number
 * }} Mapping
 */

export const AXES = ["forward", "left", "up", "yaw"];
export const BUTTONS = ["deadMan", "land", "cut"];
export const DEAD_ZONE = [0, 0.3];
export const EXPO = [0, 1];
const STORE = "quadlab.sticks.";

// Where a standard pad (or a transmitter that looks like one) has its two sticks.
/** @type {Record<string, Record<string, number>>} */
const MODES = {
  "Mode 1": { forward: 1, left: 2, up: 3, yaw: 0 },
  "Mode 2": { forward: 3, left: 2, up: 1, yaw: 0 },
};
export const PRESETS = Object.keys(MODES);

/** @param {string} name @returns {Mapping} */
export function preset(name) {
  return {
    axes: Object.fromEntries(AXES.map((axis) => [axis, { index: MODES[name][axis], inverted: true }])),
    buttons: { deadMan: [4, 5], land: [1], cut: [8] }, // shoulders, B, Back
    deadZone: 0.08,
    expo: 0.3,
  };
}

/** @param {Mapping} mapping */
export const presetOf = (mapping) =>
  PRESETS.find((name) => JSON.stringify(preset(name).axes) === JSON.stringify(mapping.axes)) ?? "";

/** @param {any} value */
const isIndex = (value) => Number.isInteger(value) && value >= 0 && value < 128;
/** @type {(value: any, bounds: number[]) => boolean} */
const isWithin = (value, [low, high]) => typeof value === "number" && value >= low && value <= high;

/** @param {any} value @returns {value is Mapping} */
function isMapping(value) {
  return (
    Boolean(value) &&
    isWithin(value.deadZone, DEAD_ZONE) &&
    isWithin(value.expo, EXPO) &&
    AXES.every(
      (axis) => isIndex(value.axes?.[axis]?.index) && typeof value.axes[axis].inverted === "boolean",
    ) &&
    BUTTONS.every((button) => Array.isArray(value.buttons?.[button]) && value.buttons[button].every(isIndex))
  );
}

// The remembered mapping; of a standard pad else Mode 2; null for a pad that must be set up first.
/** @param {Gamepad} pad @returns {Mapping | null} */
export function mappingOf(pad) {
  try {
    const kept = JSON.parse(localStorage.getItem(STORE + pad.id) ?? "null");
    if (isMapping(kept)) return kept;
  } catch {
    /* not ours, or storage is forbidden */
  }
  return pad.mapping === "standard" ? preset("Mode 2") : null;
}

/** @param {Gamepad} pad @param {Mapping} mapping */
export function remember(pad, mapping) {
  try {
    localStorage.setItem(STORE + pad.id, JSON.stringify(mapping));
  } catch {
    /* forbidden: holds until the page closes */
  }
}

/** @param {Gamepad} pad */
export function forget(pad) {
  try {
    localStorage.removeItem(STORE + pad.id);
  } catch {
    /* nothing is kept */
  }
}

/** @type {(pad: Gamepad, button: number) => boolean} */
export const isPressed = (pad, button) =>
  Boolean(pad.buttons[button]?.pressed || pad.buttons[button]?.value > 0.5);

// The dead zone is taken out and the rest stretched over the whole way, then bent by expo.
/** @param {number} value @param {{ deadZone: number, expo: number }} mapping */
export function shape(value, { deadZone, expo }) {
  const size = Math.min(1, Math.max(0, (Math.abs(value) - deadZone) / (1 - deadZone)));
  return Math.sign(value) * ((1 - expo) * size + expo * size ** 3);
}

/**
 * {raw, axes}: as the pad has them, and shaped; in our directions. {deadMan, land, cut}: pressed.
 * @param {Gamepad} pad
 * @param {Mapping} mapping
 */
export function readPad(pad, mapping) {
  const raw = AXES.map((axis) => {
    const { index, inverted } = mapping.axes[axis],
      value = pad.axes[index];
    return Number.isFinite(value) ? Math.max(-1, Math.min(1, inverted ? -value : value)) : 0;
  });
  /** @type {any} */
  const read = { raw, axes: raw.map((value) => shape(value, mapping)) };
  for (const button of BUTTONS) read[button] = mapping.buttons[button].some((index) => isPressed(pad, index));
  return read;
}
