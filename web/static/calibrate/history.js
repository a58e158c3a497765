// What the vehicle keeps of one calibration, newest first; the newest is in force.

import { isChanged, recordView, sign } from "./record.js";
import { when, who } from "./labels.js";
import { element } from "../core/dom.js";

export class CalibrationHistory {
  constructor(gains) {
    this.gains = gains;
    this.title = element("h2");
    this.list = element("ol", { className: "kept" });
    this.place = element("section", {}, this.title, this.list);
    this.shown = "";
  }

  // records: of one name, newest first, or null when the vehicle has not told.
  show(label, records, problem) {
    const isHandMade = Boolean(records?.length) && isChanged(records[0], this.gains);
    const key = JSON.stringify([label, problem, isHandMade, records?.map(({ stamp_ns: stamp }) => stamp)]);
    if (key === this.shown) return; // what is open stays open
    this.shown = key;
    this.title.textContent = `${label}: history`;
    if (!records) this.list.replaceChildren(element("li", { className: "empty" }, problem));
    else if (!records.length)
      this.list.replaceChildren(
        element(
          "li",
          { className: "empty" },
          "None yet: the values are the vehicle's defaults, or were set by hand.",
        ),
      );
    else
      this.list.replaceChildren(
        ...records.map((record, i) =>
          element(
            "li",
            {},
            this.line(record, i ? "" : isHandMade ? "changed since" : "in force", records[i + 1]),
          ),
        ),
      );
  }

  line(record, state, before) {
    const facts = element("span", { className: "facts" }, `${when(record)} · ${who(record)}`);
    const line = element(
      "details",
      {},
      element(
        "summary",
        {},
        facts,
        ...(state ? [element("b", {}, state)] : []),
        ...(record.quality.length ? [sign(record.good)] : []),
      ),
    );
    line.addEventListener("toggle", () => {
      if (line.open && line.children.length === 1)
        line.append(recordView(record, { gains: this.gains, before, isKept: true }));
    });
    return line;
  }
}
