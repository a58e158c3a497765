// The colours of a flown path by a signal, and their legend; the ends are those of web/view/options.py.

import { element } from "../core/dom.js";

/** @type {Record<string, [number, number, string]>} */
export const RANGES = { error: [0, 0.1, "m"], speed: [0, 2, "m/s"], thrust: [0.8, 1.2, "× weight"] };
export const RAMP = [
  [64, 120, 200],
  [64, 192, 160],
  [230, 190, 80],
  [229, 90, 80],
];

/** @param {number[]} rgb */
const css = (rgb) => `rgb(${rgb.map(Math.round).join(" ")})`;

/** @param {string} signal @param {number} value */
export function colorOf(signal, value) {
  const [low, high] = RANGES[signal],
    at = Math.max(0, Math.min(1, (value - low) / (high - low))) * (RAMP.length - 1);
  const k = Math.min(Math.floor(at), RAMP.length - 2);
  return css(RAMP[k].map((a, i) => a + (at - k) * (RAMP[k + 1][i] - a)));
}

/** @param {string} signal */
export function legend(signal) {
  const bar = element("i"),
    [low, high, unit] = RANGES[signal];
  bar.style.background = `linear-gradient(to right, ${RAMP.map(css).join(", ")})`;
  return element("span", { className: "ramp" }, `${signal} ${low}`, bar, `${high} ${unit}`);
}
