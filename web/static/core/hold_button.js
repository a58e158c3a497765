// A button that acts only when held, by pointer, space or enter; it says "hold", and after a short
// press "keep holding".

import { element } from "./dom.js";

const SHOWN = 2000; // ms
const GAP = 6; // px below the button
const hint = element("div", { id: "hold-hint", role: "status" });
let hiding = 0;

// `note` is asked at the press, and its answer given to `act`.
/** @param {() => any} note */
export function onHold(button, milliseconds, act, note = () => undefined) {
  let timer = null,
    since = 0,
    noted;
  button.classList.add("hold");
  button.style.setProperty("--hold", `${milliseconds}ms`);
  if (!hint.isConnected) document.body.append(hint);
  const stop = () => {
    clearTimeout(timer);
    timer = null;
    button.classList.remove("holding");
  };
  const fire = () => {
    stop();
    act(noted);
  };
  const start = (event) => {
    if (button.disabled || timer !== null) return;
    hint.textContent = "";
    since = event.timeStamp;
    noted = note();
    button.classList.add("holding");
    timer = setTimeout(fire, milliseconds);
  };
  // A busy page may run its timers late: what counts is how long it was really held.
  const release = (event) => {
    if (timer === null) return;
    if (event.timeStamp - since >= milliseconds) fire();
    else {
      stop();
      tell(button, `keep holding, ${milliseconds / 1e3} s`);
    }
  };
  button.addEventListener("pointerdown", (event) => {
    if (event.button === 0) start(event);
  });
  button.addEventListener("pointerup", release);
  for (const type of ["pointerleave", "pointercancel", "blur"]) button.addEventListener(type, stop);
  button.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    if (!event.repeat) start(event);
  });
  button.addEventListener("keyup", release);
  button.addEventListener("contextmenu", (event) => event.preventDefault());
}

function tell(button, text) {
  const { left, right, bottom } = button.getBoundingClientRect();
  hint.textContent = text;
  const { width, height } = hint.getBoundingClientRect();
  hint.style.left = `${Math.max(GAP, Math.min((left + right - width) / 2, innerWidth - width - GAP))}px`;
  hint.style.top = `${Math.min(bottom + GAP, innerHeight - height - GAP)}px`;
  clearTimeout(hiding);
  hiding = setTimeout(() => {
    hint.textContent = "";
  }, SHOWN);
}
