// The title of the chosen run: made from what was flown, and written over by hand.

import { request } from "../core/api.js";
import { element, hide } from "../core/dom.js";

export class RunName {
  // page: isOperator, attempt(act), list.
  constructor(page) {
    this.page = page;
    this.place = element("input", {
      className: "name",
      ariaLabel: "title of the run",
      placeholder: "title",
      maxLength: 120,
      disabled: !page.isOperator,
      onchange: () => this.save(),
      onkeydown: (event) => {
        if (event.key === "Enter") this.place.blur();
        else if (event.key === "Escape") {
          this.place.value = this.run?.title ?? "";
          page.list.table.focus();
        }
      },
    });
  }

  // What is being typed stays.
  show(run) {
    const isOther = run?.id !== this.run?.id;
    this.run = run;
    hide(this.place, !run);
    if (!run || (!isOther && document.activeElement === this.place)) return;
    this.place.value = run.title;
    this.place.title = run.title_by
      ? `written by ${run.title_by}; empty it to have the automatic title back`
      : "made from what was flown and changed; write another one here";
  }

  save() {
    const { id } = this.run,
      title = this.place.value;
    this.page.attempt(() => request("PUT", `/api/runs/${encodeURIComponent(id)}/title`, { title }));
  }
}
