// How finely the 3D view is drawn: less where the browser cannot keep up, and then it is said.

import { hide, setText } from "../core/dom.js";

export const SLOW = 15; // Hz
const PATIENCE = 2; // slow samples until less is drawn
const SAMPLE = 1500, PAUSE = 6000; // ms
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software/i;
// Pixels for each of the page's; null leaves it to viser.
export const LEVELS = [{ dpr: null, shadows: true }, { dpr: 0.6, shadows: false }, { dpr: 0.45, shadows: false }];

// Whether WebGL is drawn by the processor.
function isSoftware() {
  const gl = document.createElement("canvas").getContext("webgl");
  if (!gl) return false;
  const info = gl.getExtension("WEBGL_debug_renderer_info"), name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(name);
}

// The level after some samples in frames a second, the newest last.
/** @param {number} level @param {number[]} rates */
export function nextLevel(level, rates) {
  const isSlow = rates.length >= PATIENCE && rates.slice(-PATIENCE).every((rate) => rate < SLOW);
  return isSlow ? Math.min(level + 1, LEVELS.length - 1) : level;
}

// What the view says of it; "" at full quality.
/** @param {number} level @param {boolean} software @param {number} rate of the newest sample, NaN before the first */
export function words(level, software, rate) {
  const pace = Number.isFinite(rate) ? rate < 1 ? ", below 1 Hz" : `, ${Math.round(rate)} Hz` : "";
  if (level) return `${software ? "no graphics card: " : ""}reduced quality${pace}`;
  return rate < SLOW ? `drawn slowly${pace}` : "";
}

export class Quality {
  // frame: of viser; note: where it is said; shade(shadows): asks for the view with or without shadows and a shaded ground.
  constructor(frame, note, shade) {
    this.frame = frame; this.note = note; this.shade = shade;
    this.isFull = new URLSearchParams(location.search).has("fixedDpr"); // chosen by hand: nothing is changed
    this.software = !this.isFull && isSoftware();
    this.level = this.software ? 1 : 0;
    this.rates = [];
    frame.addEventListener("load", () => { this.applied = undefined; });
    setInterval(() => this.apply(), 1000);
    setTimeout(() => this.sample(), PAUSE);
  }

  // Everything is drawn, whatever it costs, or what the browser can keep up with.
  choose(isFull) {
    this.isFull = isFull;
    this.level = isFull || !this.software ? 0 : 1;
    this.rates = [];
    this.apply();
  }

  // Once viser has started, and again when it was loaded anew.
  apply() {
    const settings = this.frame.contentWindow?.__viserTestpoints?.devSettings, { dpr, shadows } = LEVELS[this.level];
    if (!settings || this.applied === this.level) return;
    if (this.applied !== undefined || this.level) { settings.set({ fixedDpr: dpr }); this.shade(shadows); }
    this.applied = this.level;
    this.say();
  }

  say() {
    const text = words(this.level, this.software, this.rates.at(-1) ?? NaN);
    setText(this.note, text);
    hide(this.note, !text);
  }

  sample() {
    const inside = this.frame.contentWindow, start = performance.now();
    let count = 0;
    const end = () => {
      if (!document.hidden && this.applied !== undefined) {
        this.rates.push(count / ((performance.now() - start) / 1e3));
        this.rates = this.rates.slice(-PATIENCE);
        const level = this.isFull ? this.level : nextLevel(this.level, this.rates);
        if (level !== this.level) this.rates = [];
        this.level = level;
        this.apply();
        this.say();
      }
      setTimeout(() => this.sample(), PAUSE);
    };
    const frame = () => {
      count++;
      if (performance.now() - start < SAMPLE) inside?.requestAnimationFrame(frame); else end();
    };
    const isShown = this.applied !== undefined && !document.hidden;
    if (inside && isShown) inside.requestAnimationFrame(frame); else setTimeout(() => this.sample(), PAUSE);
  }
}
