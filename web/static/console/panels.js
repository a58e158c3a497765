// Panels of extensions: the server puts an element for each into the document, and a script of its own
// beside that of the page.

import { element } from "../core/dom.js";

const waiting = new Map(); // functions by panel, before the page has begun
let parts;

// Called by the script of a panel; show(place, parts) fills its element.
export function addPanel(name, show) {
  if (parts) fill(name, show);
  else waiting.set(name, show);
}

// Called once, with the parts of the page that panels may use.
export function showPanels(given) {
  parts = given;
  for (const [name, show] of waiting) fill(name, show);
  if (document.readyState === "complete") tellMissing();
  else window.addEventListener("load", tellMissing);
}

function fill(name, show) {
  const place = document.querySelector(`[data-panel="${name}"]`);
  place.dataset.shown = "";
  place.replaceChildren();
  try {
    show(place, parts);
  } catch (error) {
    tell(place, error.message);
  }
}

// All scripts have run or failed by then.
function tellMissing() {
  const empty = document.querySelectorAll("[data-panel]:not([data-shown])");
  for (const place of empty) tell(place, "its script did not run");
}

function tell(place, why) {
  const line = `The extension ${place.dataset.extension} cannot show this: ${why}`;
  place.append(element("p", { className: "bad", role: "alert" }, line));
}
