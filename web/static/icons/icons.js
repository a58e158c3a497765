// The page's icons: lines of the text's colour on 20 × 20.

import { svg } from "../core/dom.js";

/** @param {number} x @param {number} y @param {number} r */
const ring = (x, y, r) => `M${x - r} ${y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`;

/** @type {Record<string, string>} */
const PATHS = {
  bell: "M5 13.5V9a5 5 0 0 1 10 0v4.5l1.5 2h-13zM8 17.5h4",
  // pages and tabs
  fly: `M6.5 6.5l7 7M13.5 6.5l-7 7${ring(5, 5, 2.5)}${ring(15, 5, 2.5)}${ring(5, 15, 2.5)}${ring(15, 15, 2.5)}`,
  experiments: "M8 2.5h4M8.5 2.5v5L4 15.5a1.5 1.5 0 0 0 1.3 2h9.4a1.5 1.5 0 0 0 1.3-2L11.5 7.5v-5M6.3 12h7.4",
  gains: `M3 5h7M14 5h3M3 10h2M9 10h8M3 15h7M14 15h3${ring(12, 5, 2)}${ring(7, 10, 2)}${ring(12, 15, 2)}`,
  beacons: `M10 9.5V17M5 2.5a7 7 0 0 0 0 9.5M15 2.5a7 7 0 0 1 0 9.5${ring(10, 7.5, 2)}`,
  calibrate: `M10 2v5M10 13v5M2 10h5M13 10h5${ring(10, 10, 5)}`,
  link: "M3.5 16v-3M7.8 16v-6M12.2 16V7M16.5 16V4",
  charts: "M3 3v14h14M6 13l3-5 3 3 4-6",
  runs: "M7.5 5H17M7.5 10H17M7.5 15H17M3 5h1M3 10h1M3 15h1",
  setup:
    "M10 2.5v2.5M10 15v2.5M2.5 10H5M15 10h2.5M4.7 4.7l1.8 1.8M13.5 13.5l1.8 1.8M15.3 4.7l-1.8 " +
    `1.8M6.5 13.5l-1.8 1.8${ring(10, 10, 5)}${ring(10, 10, 1.5)}`,
  fleet: "M3 3h5v5H3zM12 3h5v5h-5zM3 12h5v5H3zM12 12h5v5h-5z",
  // behaviors; those of follow_trajectory by their trajectory
  take_off: "M10 13V3M6 7l4-4 4 4M4 17h12",
  land: "M10 3v10M6 9l4 4 4-4M4 17h12",
  fly_to: `M10 18c-3-3.5-5-6.5-5-9.5a5 5 0 0 1 10 0c0 3-2 6-5 9.5z${ring(10, 8.5, 1.5)}`,
  figure_eight: "M10 10C8 6 3 6 3 10s5 4 7 0 7-4 7 0-5 4-7 0z",
  circle: `${ring(10, 10, 6.5)}M14.5 8l2 2 1.8-2.2`,
  waypoints: `M4.8 13.6l4-7M11.2 6.5l3.8 5${ring(4, 15, 1.6)}${ring(10, 5, 1.6)}${ring(16, 13, 1.6)}`,
  keep_out: "M3 6.5l7-4 7 4v7l-7 4-7-4zM6 7l8 7M14 7l-8 7",
  volume: "M3 6.5l7-4 7 4v7l-7 4-7-4zM3 6.5l7 4 7-4M10 10.5v7",
  file: "M5 2.5h6l4 4v11H5zM11 2.5v4h4",
  near_hovering: `M2 12l4.6-1.2M13.4 9.2L18 8${ring(10, 10, 3.5)}`,
  hover: "M3 6h14M10 6v4M6.5 10h7M4 16.5h12",
  brake: "M7 3h6l4 4v6l-4 4H7l-4-4V7zM7 10h6",
  velocity: `M10 7.5V13M4 13h12v4H4z${ring(10, 5, 2.5)}`,
  external: "M9 4H4v12h12v-5M12 3h5v5M17 3l-8 8",
  // tools of charts and of the replay
  spectrum: "M3.5 16V9M7.8 16V4M12.2 16v-5M16.5 16v-3",
  spectrogram: "M3 3h14v14H3zM3 7.7h14M3 12.3h14M7.7 3v14M12.3 3v14",
  expand: "M11 3h6v6M9 17H3v-6M17 3l-6 6M3 17l6-6",
  more: `${ring(4, 10, 1)}${ring(10, 10, 1)}${ring(16, 10, 1)}`,
  add: "M10 4v12M4 10h12",
  close: "M5 5l10 10M15 5L5 15",
  start: "M5 4v12M15 4.5L8 10l7 5.5z",
  end: "M15 4v12M5 4.5L12 10l-7 5.5z",
  earlier: "M12.5 4.5L7 10l5.5 5.5",
  later: "M7.5 4.5L13 10l-5.5 5.5",
  backwards: "M15 4L5 10l10 6z",
  play: "M5 4l10 6-10 6z",
  pause: "M7 4v12M13 4v12",
};

export const ICONS = Object.keys(PATHS);

/** @param {string} name @param {string} [path] of an icon that is not the page's own */
export function icon(name, path = PATHS[name] ?? PATHS.more) {
  return svg("svg", { class: "icon", viewBox: "0 0 20 20", "aria-hidden": "true" }, svg("path", { d: path }));
}
