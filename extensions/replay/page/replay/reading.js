// What stands in the place of a page until its runs are read: the outline of its parts, and how far it is.

import { element, hide, setText } from "/static/core/dom.js";

export class Reading {
  // place: where the words stand; page: of which the outline is; areas: of its grid.
  /** @param {HTMLElement} place @param {HTMLElement} page @param {string[]} areas */
  constructor(place, page, areas) {
    this.words = element("span", {}, "Opening the run …");
    this.bar = element("progress", { max: 1, ariaLabel: "share of the run that is read" });
    this.outline = areas.map((area) => {
      const part = element("div", { className: "outline", ariaHidden: "true" });
      part.style.gridArea = area;
      return part;
    });
    place.replaceChildren(this.words, this.bar);
    page.append(...this.outline);
    hide(this.bar, true);
  }

  /** @param {string} id @param {number} share */
  show(id, share) {
    setText(this.words, `Reading ${id}: ${Math.round(100 * share)} %`);
    this.bar.value = share;
    hide(this.bar, false);
  }

  end() {
    for (const part of this.outline) part.remove();
    this.bar.remove();
  }
}
