// The tree of parameters by component: which branches are open (remembered in this browser), how
// many values in each are modified, and what a search leaves of it.

import { element, recall, remember } from "../core/dom.js";
import { fill, fillWhenOpen } from "./row.js";

const KEY = "quadlab.commands.gains.open";
const SIMULATED = "simulator.";
const OPEN = ["control", "control.position", "control.attitude"];

export class ParameterTree {
  // place: where it is drawn.
  constructor(place) {
    this.place = place;
    this.branches = new Map(); // by path
    this.isSearching = false;
    const open = recall(KEY);
    this.open = new Set(Array.isArray(open) ? open : OPEN);
  }

  build(rows) {
    this.branches.clear();
    this.rows = rows;
    const trunk = element("div");
    for (const row of rows) {
      const path = row.description.name.split(".").slice(0, -1).join(".");
      const branch = this.branch(path, trunk);
      branch.rows.push(row);
      branch.leaves.append(row.place);
    }
    this.place.replaceChildren(trunk);
    // A simulated vehicle's parameters come after all others.
    const isSimulated = rows.some(({ description }) => description.name.startsWith(SIMULATED));
    this.absent = isSimulated
      ? null
      : element(
          "p",
          { className: "absent" },
          element("b", {}, "simulator"),
          " not there: wind, faults and noise can be set for a simulated vehicle only",
        );
    if (this.absent) this.place.append(this.absent);
    for (const branch of this.branches.values()) this.count(branch);
  }

  branch(path, trunk) {
    const known = this.branches.get(path);
    if (known) return known;
    const above = path.includes(".") ? this.branch(path.slice(0, path.lastIndexOf(".")), trunk) : null;
    const count = new Text(""); // a text node: another value in it moves nothing else
    const summary = element(
      "summary",
      {},
      element("b", {}, path.slice(path.lastIndexOf(".") + 1)),
      element("span", { className: "count" }, count),
    );
    const leaves = element("div", { className: "leaves" });
    const details = element("details", { open: this.open.has(path) }, summary, leaves);
    summary.addEventListener("click", () => this.remember(path, !details.open));
    const made = { path, above, details, leaves, count, rows: [], below: [] };
    this.branches.set(path, made);
    fillWhenOpen(details, made.rows);
    if (above) above.below.push(made);
    (above?.details ?? trunk).append(details);
    return made;
  }

  remember(path, isOpen) {
    if (this.isSearching) return;
    if (isOpen) this.open.add(path);
    else this.open.delete(path);
    remember(KEY, [...this.open]);
  }

  // text: in lower case; only(row): whether it is wanted at all, or null.
  filter(text, only) {
    const wasSearching = this.isSearching;
    this.isSearching = Boolean(text) || only !== null;
    if (!this.isSearching && !wasSearching) return 0;
    if (this.absent) this.absent.hidden = this.isSearching;
    const words = text.split(/\s+/).filter(Boolean);
    let found = 0;
    for (const row of this.rows ?? []) {
      const isHit = words.every((word) => row.text.includes(word)) && (only === null || only(row));
      row.place.hidden = !isHit;
      found += isHit;
    }
    for (const branch of this.branches.values()) {
      if (!branch.above) this.shape(branch);
    }
    return found;
  }

  // Whether something in it is shown.
  shape(branch) {
    const below = branch.below.map((one) => this.shape(one)).some(Boolean); // of all, not up to the first
    const isShown = below || branch.rows.some((row) => !row.place.hidden);
    branch.details.hidden = !isShown;
    branch.details.open = this.isSearching || this.open.has(branch.path);
    if (branch.details.open) fill(branch.rows); // at once: rows that a search found
    return isShown;
  }

  // A row's mark came or went.
  changed(row) {
    let branch = this.branches.get(row.description.name.split(".").slice(0, -1).join("."));
    for (; branch; branch = branch.above) this.count(branch);
  }

  count(branch) {
    const modified = modifiedIn(branch),
      text = modified ? `${modified} modified` : "";
    if (branch.count.data !== text) branch.count.data = text;
  }
}

function modifiedIn(branch) {
  return (
    branch.rows.filter((row) => row.isModified).length +
    branch.below.reduce((sum, one) => sum + modifiedIn(one), 0)
  );
}
