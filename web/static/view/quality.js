// How finely the 3D view is drawn: less where the browser cannot keep up, and then it is said.

import { hide, setText, windowIn } from "../core/dom.js";

export const SLOW = 15; // Hz
const PATIENCE = 2; // slow samples until less is drawn
const SAMPLE = 1500,
  PAUSE = 6000,
  LATER = 1000; // ms
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software/i;
// Pixels for each of the page's; null leaves it to viser. Period: least ms between two frames, 20 Hz on a
// screen of 60 Hz:
// drawing takes the processor that the laboratory runs on.
export const LEVELS = [
  { dpr: null, shadows: true, period: 0 },
  { dpr: 0.8, shadows: false, period: 42 },
  { dpr: 0.6, shadows: false, period: 42 },
];

// Whether WebGL is drawn by the processor.
function isSoftware() {
  const gl = document.createElement("canvas").getContext("webgl");
  if (!gl) return false;
  const info = gl.getExtension("WEBGL_debug_renderer_info"),
    name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
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
  const pace = Number.isFinite(rate) ? (rate < 1 ? ", below 1 Hz" : `, ${Math.round(rate)} Hz`) : "";
  if (level) return `${software ? "no graphics card: " : ""}reduced quality${pace}`;
  return rate < SLOW ? `drawn slowly${pace}` : "";
}

/**
 * Keeps a window's frames apart: the least ms between two of them is in `period`.
 * @param {Pick<Window, "requestAnimationFrame" | "cancelAnimationFrame">} view
 */
export function paced(view) {
  const ask = view.requestAnimationFrame.bind(view),
    cancel = view.cancelAnimationFrame.bind(view);
  const waiting = new Map(),
    pace = { period: 0 }; // newest request by the first one's number
  let last = -Infinity;
  view.requestAnimationFrame = (draw) => {
    const first = ask(function next(time) {
      if (time !== last && time < last + pace.period) {
        waiting.set(first, ask(next));
        return;
      }
      waiting.delete(first);
      last = time;
      draw(time);
    });
    return first;
  };
  view.cancelAnimationFrame = (first) => {
    cancel(waiting.get(first) ?? first);
    waiting.delete(first);
  };
  return pace;
}

// Lines thinner than a pixel would be dashed, where edges are not smoothed.
function widen(scene, least) {
  scene.traverse(({ material }) => {
    if (material?.isLineMaterial && material.linewidth < least) material.linewidth = least;
  });
}

export class Quality {
  // frame: for viser, at this address; note: where it is said; shade(shadows): asks for the view with or
  // without shadows and a shaded ground.
  constructor(frame, address, note, shade) {
    this.frame = frame;
    this.address = address;
    this.note = note;
    this.shade = shade;
    this.isFull = new URLSearchParams(location.search).has("fixedDpr"); // chosen by hand: nothing is changed
    this.software = false;
    this.level = 0;
    this.rates = [];
    this.pace = undefined; // of the frame's window, once it is there
    frame.addEventListener("load", () => {
      const inside = windowIn(frame);
      this.applied = undefined;
      this.pace = inside ? paced(inside) : undefined;
    });
    // The page's values and buttons come first: viser keeps the page busy as long as all else together.
    const later = window.requestIdleCallback ?? ((act) => setTimeout(act, LATER));
    later(() => this.start(), { timeout: LATER });
  }

  start() {
    this.software = !this.isFull && isSoftware();
    this.level = this.software ? 1 : 0;
    this.load();
    setInterval(() => this.apply(), 1000);
    setTimeout(() => this.sample(), PAUSE);
  }

  // A context of WebGL has smoothed edges (four samples a pixel) or has not, for good.
  load() {
    this.pace = undefined;
    // In place of what it shows: a new entry of the history would take the browser's way forward.
    this.frame.contentWindow.location.replace(
      `${this.address}${this.software && !this.isFull ? "&plain" : ""}`,
    );
  }

  // Everything is drawn, whatever it costs, or what the browser can keep up with.
  choose(isFull) {
    this.isFull = isFull;
    this.level = isFull || !this.software ? 0 : 1;
    this.rates = [];
    if (this.software) {
      this.shade(isFull);
      this.load();
    } else this.apply();
  }

  // Once viser has started, and again when it was loaded anew.
  apply() {
    const inside = windowIn(this.frame),
      settings = inside?.__viserTestpoints?.devSettings,
      { dpr, shadows, period } = LEVELS[this.level];
    if (!settings || !this.pace) return;
    if (this.software && dpr) widen(inside.__viserMutable.scene, 1 / dpr);
    if (this.applied === this.level) return;
    if (this.applied !== undefined || this.level) {
      settings.set({ fixedDpr: dpr });
      this.shade(shadows);
    }
    this.pace.period = period;
    // a picture behind the scene, of which there is none: all pixels once more
    inside.__viserMutable.backgroundMaterial.visible = false;
    this.applied = this.level;
    this.say();
  }

  say() {
    const text = words(this.level, this.software, this.rates.at(-1) ?? NaN);
    setText(this.note, text);
    hide(this.note, !text);
  }

  sample() {
    const inside = windowIn(this.frame),
      start = performance.now();
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
      if (performance.now() - start < SAMPLE) inside?.requestAnimationFrame(frame);
      else end();
    };
    const isShown = this.applied !== undefined && !document.hidden;
    if (inside && isShown) inside.requestAnimationFrame(frame);
    else setTimeout(() => this.sample(), PAUSE);
  }
}
