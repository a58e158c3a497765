// A button that acts only when held: by pointer, or by space or enter.

// `note` is asked at the press, and its answer given to `act`.

export function onHold(button, milliseconds, act, note = () => undefined) {
  let timer = null, since = 0, noted;
  button.style.setProperty("--hold", `${milliseconds}ms`);
  const stop = () => { clearTimeout(timer); timer = null; button.classList.remove("holding"); };
  const fire = () => { stop(); act(noted); };
  const start = (event) => {
    if (button.disabled || timer !== null) return;
    since = event.timeStamp;
    noted = note();
    button.classList.add("holding");
    timer = setTimeout(fire, milliseconds);
  };
  // A busy page may run its timers late: what counts is how long it was really held.
  const release = (event) => {
    if (timer === null) return;
    if (event.timeStamp - since >= milliseconds) fire();
    else stop();
  };
  button.addEventListener("pointerdown", (event) => { if (event.button === 0) start(event); });
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
