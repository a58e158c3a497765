// The calibrations there are, each with what is in force: when, by whom, how good.

import { isChanged, sign } from "./record.js";
import { CALIBRATIONS, day, labelOf, when, who } from "./labels.js";
import { element, tableHead } from "../core/dom.js";
import { NONE } from "../core/format.js";

export class CalibrationList {
  // choose(name): of an experiment
  constructor({ gains, choose }) {
    this.gains = gains;
    this.choose = choose;
    this.body = element("tbody");
    this.table = element(
      "table",
      { className: "calibrations", hidden: true },
      tableHead("calibration", "in force since", "by", ""),
      this.body,
    );
    this.note = element("p", { className: "empty" }, "Loading from the station.");
    this.place = element("div", {}, this.table, this.note);
    this.drawn = "";
  }

  empty(text) {
    this.note.textContent = text;
  }

  // known: calibrations of /api/experiments; recordsOf(calibration): newest first, or null.
  show(known, chosen, recordsOf) {
    this.table.hidden = !known.length;
    this.note.hidden = known.length > 0;
    const rows = known.map(({ name, calibration, problem }) => {
      const records = recordsOf(calibration),
        record = records?.[0];
      return {
        name,
        problem,
        record,
        isTold: records !== null,
        differs: Boolean(record) && isChanged(record, this.gains),
      };
    });
    const key = JSON.stringify([
      chosen,
      rows.map(({ name, record, isTold, differs }) => [name, record?.stamp_ns, isTold, differs]),
    ]);
    if (key === this.drawn) return;
    this.drawn = key;
    const hadFocus = this.body.contains(document.activeElement);
    this.body.replaceChildren(...rows.map((row) => this.row(row, row.name === chosen)));
    if (hadFocus) this.body.querySelector("input:checked")?.focus();
  }

  row({ name, problem, record, isTold, differs }, isChosen) {
    const radio = element("input", {
      type: "radio",
      name: "calibration",
      value: name,
      checked: isChosen,
      onchange: () => this.choose(name),
    });
    const label = element("label", { title: CALIBRATIONS[name]?.gives ?? "" }, radio, labelOf(name));
    const state = problem
      ? [element("span", { className: "sign beyond" }, element("i", { ariaHidden: "true" }, "!"), "broken")]
      : differs
        ? [
            element(
              "span",
              { className: "sign beyond", title: "values have been changed by hand since" },
              element("i", { ariaHidden: "true" }, "!"),
              "changed",
            ),
          ]
        : record?.quality.length
          ? [sign(record.good)]
          : [];
    return element(
      "tr",
      { className: isChosen ? "chosen" : "" },
      element("th", { scope: "row" }, label),
      element("td", { title: record ? when(record) : "" }, record ? day(record) : isTold ? "never" : NONE),
      element("td", {}, record ? who(record) : ""),
      element("td", {}, ...state),
    );
  }
}
