// The large button of the moment: Arm, Take off or Land, in one place. A button that has just come takes no
// press for a moment: a second click was meant for the one before.

import { setIfChanged } from "../core/dom.js";
import { maySwitchOff, nextStep } from "./vehicle_words.js";

const CALM = 700; // ms

export class Primary {
  constructor(place, disarm) {
    this.place = place;
    this.buttons = [...place.children];
    this.disarm = disarm;
    for (const type of ["pointerdown", "keydown", "click"])
      place.addEventListener(type, (event) => this.keepCalm(event), true);
    this.show(null);
  }

  keepCalm(event) {
    if (!("new" in this.place.dataset) || event.key === "Tab") return;
    event.preventDefault();
    event.stopPropagation();
  }

  beNew() {
    this.place.dataset.new = "";
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      delete this.place.dataset.new;
    }, CALM);
  }

  show(status) {
    const next = nextStep(status),
      shown = this.buttons.find(({ id }) => id === next);
    setIfChanged(this.disarm.style, "visibility", maySwitchOff(status) ? "visible" : "hidden"); // its place stays
    if (shown === this.shown) return;
    const hadFocus = document.activeElement !== null && document.activeElement === this.shown;
    if (this.shown) this.beNew();
    this.shown = shown;
    for (const button of this.buttons) button.style.visibility = button === shown ? "visible" : "hidden";
    if (hadFocus) shown.focus();
  }
}
