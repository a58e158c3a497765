// A button that makes the vehicle fly: pressed by pointer or Enter, not by the space bar, which pauses
// the charts. After a click a button keeps the focus, and a space meant for the charts would start it
// again.

/** @template {HTMLElement} T @param {T} button */
export function flightButton(button) {
  /** @param {KeyboardEvent} event */
  const leave = (event) => {
    if (event.key === " ") event.preventDefault();
  };
  button.dataset.flight = "";
  button.addEventListener("keydown", leave);
  button.addEventListener("keyup", leave); // where browsers press at the release
  return button;
}
