// A button that acts only when held: by pointer, or by space or enter.

export function onHold(button, milliseconds, act) {
  let timer = null;
  button.style.setProperty("--hold", `${milliseconds}ms`);
  const stop = () => { clearTimeout(timer); timer = null; button.classList.remove("holding"); };
  const start = () => {
    if (button.disabled || timer !== null) return;
    button.classList.add("holding");
    timer = setTimeout(() => { stop(); act(); }, milliseconds);
  };
  button.addEventListener("pointerdown", (event) => { if (event.button === 0) start(); });
  for (const type of ["pointerup", "pointerleave", "pointercancel", "blur"]) button.addEventListener(type, stop);
  button.addEventListener("keydown", (event) => { if (event.key === " " || event.key === "Enter") { event.preventDefault(); start(); } });
  button.addEventListener("keyup", stop);
  button.addEventListener("contextmenu", (event) => event.preventDefault());
}
