// The light or dark theme: the system's, or the one chosen by hand. A cookie keeps the choice, so that the
// server makes even the sign-in page by it. And what core/tokens.css says, for what is drawn on a canvas.

import { element, optionsOf } from "./dom.js";

const COOKIE = "quadlab_theme"; // as in web/theme.py
const CHOICES = [
  ["", "System"],
  ["light", "Light"],
  ["dark", "Dark"],
];
const root = document.documentElement;
const resolved = new Map(); // of the theme that is shown
/** @type {HTMLElement | null} */
let probe = null;
let isPaper = false;

// "change" when colours are others.
export const theme = new EventTarget();

function changed() {
  resolved.clear();
  theme.dispatchEvent(new Event("change"));
}
const isDark = matchMedia("(prefers-color-scheme: dark)");
isDark.addEventListener("change", changed);

// Draws anew what stands in `place`, while it stands in the page, when colours are others.
/** @param {Node} place @param {() => void} draw */
export function onTheme(place, draw) {
  const again = () => {
    if (place.isConnected) draw();
    else theme.removeEventListener("change", again);
  };
  theme.addEventListener("change", again);
}

// A CSS colour, "var(--x)" or a mix of such, as a canvas takes it.
/** @param {string} color */
export function paint(color) {
  let found = resolved.get(color);
  if (found === undefined) {
    if (!probe?.isConnected) document.body.append((probe = element("i", { hidden: true })));
    probe.style.colorScheme = isPaper ? "light" : "";
    probe.style.color = color;
    resolved.set(color, (found = getComputedStyle(probe).color));
  }
  return found;
}

// What act() draws on canvases has the colours of the light theme; the page keeps its own.
/** @param {() => Promise<void>} act */
export async function onPaper(act) {
  resolved.clear();
  isPaper = true;
  try {
    await act();
  } finally {
    isPaper = false;
    resolved.clear();
  }
}

/** @param {string} color @param {number} percent */
export const faint = (color, percent) => `color-mix(in srgb, ${color} ${percent}%, transparent)`;

// Of small text on a canvas whose pixels are `ratio` times as fine as the page's.
export const font = (ratio = 1, style = "") =>
  `${style} ${ratio * parseFloat(getComputedStyle(root).getPropertyValue("--small"))}px system-ui, sans-serif`.trim();

// What the axes of all plots have in common, for uPlot.
export const axisLook = () => ({
  stroke: () => paint("var(--dim)"),
  font: font(),
  labelFont: font(),
  ticks: { show: false },
  grid: { stroke: () => paint("var(--grid)"), width: 1 },
  values: (_, ticks) => ticks.map(numberText),
});

// uPlot's own text has three decimals at most, so that ticks of 0.0005 read as 0.001.
/** @param {number | null} tick */
const numberText = (tick) => (tick === null ? "" : String(Number(tick.toPrecision(9))).replace("-", "−"));

const chosen = () => root.dataset.theme ?? "";

/** @param {string} choice */
function choose(choice) {
  if (choice) root.dataset.theme = choice;
  else delete root.dataset.theme;
  document.cookie = `${COOKIE}=${choice}; path=/; samesite=strict; max-age=${choice ? 31_536_000 : 0}`;
  changed();
}

export const themeChoice = () =>
  element(
    "label",
    { className: "theme" },
    "Theme",
    element("select", { onchange: ({ target }) => choose(target.value) }, ...optionsOf(CHOICES, chosen())),
  );

// A frame's document, of our own origin, has the page's theme.
/** @param {HTMLIFrameElement} frame */
export function themeFrame(frame) {
  const follow = () => {
    const inside = frame.contentDocument?.documentElement;
    if (inside) inside.dataset.theme = chosen() || (isDark.matches ? "dark" : "light"); // whatever else it loads
  };
  frame.addEventListener("load", follow);
  theme.addEventListener("change", follow);
  follow();
}
