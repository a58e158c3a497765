// The last step tests: a box to draw each, what was wrong with it, delete and undo.

import { request } from "/static/core/api.js";
import { element } from "/static/core/dom.js";
import { timeOf } from "/static/core/format.js";
import { icon } from "/static/icons/icons.js";
import { describe } from "./units.js";

export class TuneRuns {
  // chosen: Set of ids; choose(): it changed; refuse(text).
  constructor(place, { isOperator, chosen, choose, refuse }) {
    this.isOperator = isOperator;
    this.chosen = chosen;
    this.choose = choose;
    this.refuse = refuse;
    this.list = element("ol", { className: "tests" });
    this.undo = element("div", { className: "undone", role: "status", hidden: true });
    place.append(element("h2", {}, "Last tests"), this.list, this.undo);
  }

  show(runs, letters, colors) {
    const focus = /** @type {HTMLElement | null} */ (document.activeElement)?.dataset?.test;
    this.list.replaceChildren(
      ...runs.map((run) => this.row(run, letters.get(run.id) ?? "", colors.get(run.id))),
    );
    if (focus) this.list.querySelector(`[data-test="${CSS.escape(focus)}"]`)?.focus();
    if (!runs.length)
      this.list.append(element("li", { className: "empty" }, "None yet; the last 20 are kept."));
  }

  row(run, letter, color) {
    const text = describe(run.plan),
      when = timeOf(new Date(run.started));
    const box = element("input", {
      type: "checkbox",
      checked: this.chosen.has(run.id),
      ariaLabel: `draw ${text} of ${when}`,
      onchange: () => {
        if (box.checked) this.chosen.add(run.id);
        else this.chosen.delete(run.id);
        this.choose();
      },
    });
    box.dataset.test = run.id;
    const mark = element("b", {}, letter);
    if (color) mark.style.color = color;
    const facts = [when, run.requester, run.run_id && `run ${run.run_id}`].filter(Boolean).join(" · ");
    const remove = element(
      "button",
      {
        className: "remove",
        title: "delete this test",
        ariaLabel: `delete ${text} of ${when}`,
        disabled: !this.isOperator,
        onclick: () => this.delete(run, text),
      },
      icon("close"),
    );
    return element(
      "li",
      {},
      element(
        "label",
        {},
        box,
        mark,
        element("span", { className: "what" }, text),
        element("span", { className: "facts", title: facts }, facts),
      ),
      remove,
      ...(run.problems.length ? [element("p", { className: "reason" }, run.problems.join("; "))] : []),
    );
  }

  async delete(run, text) {
    try {
      await request("DELETE", `/api/tuning/runs/${encodeURIComponent(run.id)}`);
    } catch (error) {
      this.refuse(error.message);
      return;
    }
    const back = element("button", { className: "small", onclick: () => this.restore(run) }, "Undo");
    this.undo.replaceChildren(`Deleted: ${text}`, back);
    this.undo.hidden = false;
    back.focus();
  }

  async restore(run) {
    this.undo.hidden = true;
    try {
      await request("POST", `/api/tuning/runs/${encodeURIComponent(run.id)}/restore`, {});
    } catch (error) {
      this.refuse(error.message);
    }
  }
}
