// Several values that would change, each with a tick: what is and what would be. Nothing is sent
// before Apply; then all ticked ones at once, or none.

import { attempt, element } from "../core/dom.js";
import { exact } from "../core/format.js";

export class Diff {
  // lines: of the API (name, unit, now, new, reason, steps); done(applied) after it went well.
  constructor(gains, { title, note = "", lines, same, done, empty = "Nothing would change." }) {
    this.gains = gains;
    this.done = done;
    this.good = lines.filter(({ reason }) => !reason);
    this.boxes = new Map();
    this.cells = new Map();
    this.reason = element("div", { className: "reason", hidden: true, role: "status" });
    this.all = element("input", {
      type: "checkbox",
      checked: true,
      onchange: () => this.tickAll(),
      ariaLabel: "all of them",
    });
    this.apply = element("button", { className: "apply", onclick: () => this.send() });
    const equal = same ? `${same} ${same === 1 ? "value is" : "values are"} the same.` : "";
    const steps = Math.max(1, ...this.good.map((line) => line.steps));
    const walk = steps > 1 ? `In flight it takes ${steps} steps, all values together.` : "";
    this.place = element("section", { className: "diff" }, element("h2", {}, title));
    for (const text of [note, this.good.length ? "" : empty, equal, walk].filter(Boolean))
      this.place.append(element("p", { className: "facts" }, text));
    if (this.good.length) {
      this.place.append(
        element("div", { className: "diff-head" }, element("label", {}, this.all, " all"), this.apply),
        this.reason,
      );
    }
    this.place.append(element("ul", {}, ...lines.map((line) => this.line(line))));
    this.onConfirmed = ({ detail }) => this.confirmed(detail.name);
    gains.addEventListener("confirmed", this.onConfirmed);
    this.count();
  }

  stop() {
    this.gains.removeEventListener("confirmed", this.onConfirmed);
  }

  line({ name, unit, now, new: value, reason }) {
    const box = element("input", {
      type: "checkbox",
      checked: !reason,
      disabled: Boolean(reason),
      onchange: () => this.count(),
      ariaLabel: `${name} to ${exact(value)}`,
    });
    const cell = element("span", { className: "now" }, now === null ? "–" : exact(now));
    const text = element(
      "span",
      { className: "values" },
      cell,
      " → ",
      element("b", {}, exact(value)),
      unit ? ` ${unit}` : "",
    );
    if (!reason) {
      this.boxes.set(name, { box, value });
      this.cells.set(name, cell);
    }
    return element(
      "li",
      { className: reason ? "bad" : "" },
      element("label", {}, box, element("span", { className: "name" }, name), text),
      ...(reason ? [element("div", { className: "reason" }, reason)] : []),
    );
  }

  // Somebody changed it meanwhile.
  confirmed(name) {
    if (!this.place.isConnected) {
      this.stop();
      return;
    }
    const cell = this.cells.get(name);
    if (cell) cell.textContent = exact(this.gains.value(name));
  }

  tickAll() {
    for (const { box } of this.boxes.values()) box.checked = this.all.checked;
    this.count();
  }

  get chosen() {
    return [...this.boxes].filter(([, { box }]) => box.checked);
  }

  count() {
    const count = this.chosen.length;
    this.apply.textContent = count ? `Apply ${count}` : "Apply";
    this.apply.disabled = count === 0 || !this.gains.isOperator || Boolean(this.busy);
    this.all.checked = count === this.boxes.size;
    this.all.indeterminate = count > 0 && count < this.boxes.size;
  }

  async send() {
    this.busy = true;
    this.count();
    await attempt(this.reason, async () => {
      const applied = await this.gains.set(
        Object.fromEntries(this.chosen.map(([name, { value }]) => [name, value])),
        true,
      );
      this.stop();
      this.done(applied);
    });
    this.busy = false;
    this.count();
  }
}
