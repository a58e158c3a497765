// Keys of the page, each with what it does, so that the help can list them.

import { windowIn } from "./dom.js";

const ACTIONS = new Map(); // by key
export const TYPING =
  "input:not([type=range], [type=checkbox], [type=radio]), select, textarea, [contenteditable]";
const PRESSED = "button:not([data-flight]), a, summary, input"; // what the space bar presses

const ALWAYS = /** @type {(event: any) => boolean} */ (() => true);

// act(event) on `key` (as in KeyboardEvent.key), except while somebody types or holds a modifier.
// `meaning` is shown in the help. `hold`: ms it must be held; without it a press is enough. `when(event)`: else the key
// is left to others.
export function onKey(key, meaning, act, { hold = 0, when = ALWAYS } = {}) {
  if (ACTIONS.has(key)) throw new Error(`the key ${key} has a meaning already: ${ACTIONS.get(key).meaning}`);
  ACTIONS.set(key, { key, meaning, act, hold, when, timer: null, since: 0 });
}

export const keys = () => [...ACTIONS.values()];

// What a key writes, small: with Shift or caps lock a letter comes as its capital. Where a layout
// writes no Latin letter (Cyrillic, Greek, …) it is what an American keyboard has at that place.
export function characterOf({ key, code = "", shiftKey }) {
  if (key.length > 1) return key; // ArrowLeft
  if (key <= "~") return key.toLowerCase();
  const [, plain] = /^(?:Key|Digit)(.)$/.exec(code) ?? [];
  if (plain) return plain.toLowerCase();
  if (code === "Slash") return shiftKey ? "?" : "/";
  return { BracketLeft: "[", BracketRight: "]" }[code] ?? key;
}

const actionOf = (event) => ACTIONS.get(characterOf(event));

function stop(action) {
  clearTimeout(action.timer);
  action.timer = null;
}

function down(event) {
  const action = actionOf(event);
  if (!action || event.ctrlKey || event.altKey || event.metaKey || event.target.closest?.(TYPING)) return;
  if (!action.when(event)) return;
  if (event.key === " " && event.target.closest?.(PRESSED)) return;
  event.preventDefault();
  if (event.view !== window) event.stopImmediatePropagation(); // in the 3D view "e" moves the camera, too
  if (event.repeat || action.timer !== null) return;
  if (!action.hold) action.act(event);
  else {
    action.since = event.timeStamp;
    action.timer = setTimeout(() => {
      action.timer = null;
      action.act(event);
    }, action.hold);
  }
}

function up(event) {
  const action = actionOf(event);
  if (!action || action.timer === null) return;
  stop(action);
  // A busy page may run its timers late: what counts is how long it was really held.
  if (event.timeStamp - action.since >= action.hold) action.act(event);
}

function stopAll() {
  for (const action of ACTIONS.values()) stop(action);
}

document.addEventListener("keydown", down);
document.addEventListener("keyup", up);
window.addEventListener("blur", stopAll);

// The same keys while the focus is inside a frame of our own origin, whichever document it shows.
export function listenInside(frame) {
  const listen = () => {
    const inside = windowIn(frame);
    if (!inside) return;
    inside.addEventListener("keydown", down, true);
    inside.addEventListener("keyup", up, true);
    inside.addEventListener("blur", stopAll);
  };
  frame.addEventListener("load", listen);
  listen(); // what is there already; a listener that is added twice is one
}
