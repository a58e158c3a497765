// A panel that takes the place of the list of runs: a heading, a note and a table.

import { $, element, hide, tableHead } from "../core/dom.js";

export class Panel {
  // page: isOperator, say(text), only(panel).
  constructor(place, opener, page, title, ...columns) {
    this.place = place;
    this.opener = opener;
    this.page = page;
    opener.addEventListener("click", () => this.open(place.hidden));
    place.addEventListener("keydown", (event) => {
      if (event.key === "Escape") {
        this.open(false);
        opener.focus();
      }
    });
    this.body = element("tbody");
    this.note = element("p", { className: "empty" });
    this.head = element("div", { className: "trash-head" }, element("h2", {}, title), this.note);
    place.append(this.head, element("table", { hidden: true }, tableHead(...columns), this.body));
  }

  open(wanted) {
    if (wanted) this.page.only(this);
    this.place.hidden = !wanted;
    this.opener.setAttribute("aria-expanded", String(wanted));
    $("list").hidden = wanted;
  }

  fill(rows) {
    this.body.replaceChildren(...rows);
    hide(this.body.parentElement, !rows.length);
  }
}
