// Two campaigns flight by flight: is this one better than the other? Pairs have the same seed and factors.

import { get } from "/static/core/api.js";
import { attempt, element, optionsOf } from "/static/core/dom.js";
import { titleOf } from "/static/experiments/figures.js";
import { short } from "./drawings.js";

const NONE = "–";

export class Comparison {
  name = ""; // of the campaign that is compared

  constructor() {
    this.other = element("select", { ariaLabel: "campaign to compare with", onchange: () => this.read() });
    this.reason = element("p", { className: "reason", hidden: true });
    this.table = element("table", { className: "pairs", hidden: true });
    this.place = element(
      "div",
      { className: "against" },
      element("h2", {}, "Against"),
      this.other,
      this.reason,
      this.table,
    );
  }

  // Offers the other campaigns that have rows.
  offer(name, campaigns) {
    const others = campaigns
      .filter((one) => one.name !== name && one.rows && !one.problem)
      .map((one) => one.name);
    const chosen = name === this.name && others.includes(this.other.value) ? this.other.value : NONE;
    if (name !== this.name) this.show(null);
    this.name = name;
    this.place.hidden = !others.length;
    this.other.replaceChildren(...optionsOf([NONE, ...others], chosen));
  }

  async read() {
    this.show(null);
    const { name } = this,
      other = this.other.value;
    await attempt(this.reason, async () => {
      if (other === NONE) return;
      const found = await get(
        `/api/campaigns/${encodeURIComponent(name)}/against/${encodeURIComponent(other)}`,
      );
      if (name === this.name && other === this.other.value) this.show(found);
    });
  }

  show(found) {
    this.table.hidden = !found;
    if (!found) return;
    const rows = Object.entries(found.tests).map(([metric, one]) => this.row(metric, one));
    const head = [`${found.pairs} pairs`, "other", "this", "difference"].map((text) =>
      element("th", {}, text),
    );
    this.table.replaceChildren(
      element("thead", {}, element("tr", {}, ...head)),
      element("tbody", {}, ...rows),
    );
  }

  row(
    metric,
    { first, second, difference, low, high, worse, better, p, test, is_worse: isWorse, is_better: isBetter },
  ) {
    const change =
      metric === "passed"
        ? `${better} better, ${worse} worse`
        : difference === null
          ? NONE
          : `${signed(difference)}  ${signed(low)} … ${signed(high)}`;
    const verdict = isWorse ? "worse" : isBetter ? "better" : "";
    const title = `${test}, p = ${short(p, 2)}; the interval of the median difference is that of 95 %`;
    const cells = [first, second].map((value) => element("td", {}, value === null ? NONE : short(value)));
    const last = element(
      "td",
      { title },
      change,
      element("b", { className: isWorse ? "amber" : "" }, verdict),
    );
    return element("tr", {}, element("th", { scope: "row" }, titleOf(metric)), ...cells, last);
  }
}

const signed = (value) => `${value > 0 ? "+" : ""}${short(value, 3)}`;
