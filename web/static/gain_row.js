// One parameter: slider, confirmed value, unit, bounds, mark when modified.
// The cell shows what the vehicle confirmed and never what was just sent; the thumb is the hand's
// while it holds it, then follows the confirmed value.

import { digitsOf, element, exact } from "./format.js";
import { GainPath } from "./gain_path.js";

const MOST_STEPS = 1e6; // of a slider; a seed is typed

export class GainRow {
  constructor(description, isOperator, send, modifiedChanged) {
    this.description = description;
    this.confirmed = description.value;
    this.modifiedChanged = modifiedChanged;
    this.locked = !isOperator || description.read_only;
    this.text = `${description.name} ${description.description}`.toLowerCase();
    this.path = new GainPath(send, () => this.draw());
    this.place = element("div", { className: "gain" });
    this.build();
    this.draw();
  }

  get isModified() { return this.confirmed !== this.description.default; }
  get isNumber() { return ["float", "int"].includes(this.description.type); }

  build() {
    const { name, unit, description, default: initial, minimum, maximum } = this.description;
    const label = element("span", { title: `${description}\n${name}, default ${exact(initial)}${unit ? ` ${unit}` : ""}` }, name.split(".").at(-1));
    const mark = element("button", { className: "mark", disabled: this.locked, title: `modified; back to ${exact(initial)}`, onclick: () => this.path.set(initial) }, "●");
    this.reason = element("div", { className: "reason", hidden: true });
    this.place.append(element("div", { className: "label" }, label, mark), ...this.editor(name));
    if (this.isNumber) this.place.append(element("span", { className: "unit" }, unit));
    if (this.isNumber && minimum !== null && maximum !== null && (maximum - minimum) / this.step < MOST_STEPS) {
      this.slider = element("input", { type: "range", min: minimum, max: maximum, step: this.step, disabled: this.locked, ariaLabel: name });
      this.slider.addEventListener("pointerdown", () => { this.held = true; });
      for (const type of ["pointerup", "pointercancel", "change", "blur"]) this.slider.addEventListener(type, () => { this.held = false; this.draw(); });
      this.slider.addEventListener("input", () => { this.path.set(Number(Number(this.slider.value).toFixed(digitsOf(this.step) + 1))); this.fill(); });
      this.place.append(element("div", { className: "travel" }, element("span", {}, exact(minimum)), this.slider, element("span", {}, exact(maximum))));
    }
    this.place.append(this.reason);
  }

  get step() {
    const { type, step, minimum, maximum } = this.description;
    return step || (type === "int" ? 1 : (maximum - minimum) / 200 || "any");
  }

  // The control in the value's column; a select or check box spans the unit's, too.
  editor(name) {
    const { type, choices } = this.description;
    if (type === "bool") {
      this.box = element("input", { type: "checkbox", disabled: this.locked, ariaLabel: name, onchange: () => this.path.set(this.box.checked) });
      return [this.box, element("span")];
    }
    if (choices.length) {
      this.box = element("select", { disabled: this.locked, ariaLabel: name, onchange: () => this.path.set(this.box.value) }, ...choices.map((choice) => element("option", { value: choice }, choice)));
      return [this.box];
    }
    this.box = element("input", { className: "value", disabled: this.locked, ariaLabel: `${name}, value`, inputMode: "decimal", spellcheck: false });
    this.box.addEventListener("focus", () => { this.typing = true; this.box.select(); });
    this.box.addEventListener("blur", () => { this.typing = false; this.draw(); });
    this.box.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.box.blur();
      if (event.key === "Enter") { this.enter(this.box.value.trim()); this.box.blur(); }
    });
    return this.isNumber ? [this.box] : [this.box, element("span")];
  }

  enter(text) {
    if (!this.isNumber) { this.path.set(text); return; }
    const number = Number(text.replace(",", ".").replace("−", "-"));
    if (text === "" || !Number.isFinite(number)) this.fail(`${text || "nothing"} is not a number`);
    else this.path.set(number);
  }

  confirm(value) {
    const was = this.isModified;
    this.confirmed = value;
    this.draw();
    if (was !== this.isModified) this.modifiedChanged();
  }

  fail(reason) {
    this.path.reason = reason;
    this.path.to("refused");
  }

  draw() {
    const { state, reason } = this.path;
    for (const name of ["waiting", "late", "refused"]) this.place.classList.toggle(name, state === name);
    this.place.classList.toggle("changed", this.isModified);
    this.reason.hidden = !(state === "refused" && reason);
    this.reason.textContent = reason;
    if (this.box.type === "checkbox") this.box.checked = this.confirmed === true;
    else if (!this.typing) this.box.value = typeof this.confirmed === "number" ? exact(this.confirmed) : this.confirmed;
    // Late or refused: the thumb goes back to what is true, unless a hand holds it.
    if (this.slider && !this.held && state !== "waiting") this.slider.value = this.confirmed;
    if (this.slider) this.fill();
  }

  fill() {
    const { minimum, maximum } = this.description;
    this.slider.style.setProperty("--at", `${(100 * (Number(this.slider.value) - minimum)) / (maximum - minimum)}%`);
  }
}
