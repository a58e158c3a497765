// One parameter: slider, confirmed value, unit, bounds, marks when modified.
// The cell shows what the vehicle confirmed and never what was just sent; the thumb is the hand's
// while it holds it, with the confirmed value as a mark beside it, then follows the confirmed value.

import { element, optionsOf } from "../core/dom.js";
import { digitsOf, exact, parseNumber } from "../core/format.js";
import { GainSender } from "./sender.js";

const MOST_STEPS = 1e6; // of a slider; a seed is typed
const KEY_STEPS = { ArrowUp: 1, ArrowDown: -1, PageUp: 10, PageDown: -10 };

export class GainRow {
  label;
  mark;
  flightMark;
  reason;
  box;
  slider;
  tick;
  details; // made by build()

  /**
   * send(value, walks, press) → Promise; unfold(row, place) fills the row's details when they are opened.
   * @param {((row: any, place: HTMLElement) => void) | null} unfold
   */
  constructor(description, isOperator, send, modifiedChanged, unfold = null) {
    this.description = description;
    this.confirmed = description.value;
    this.flightValue = undefined; // at the start of this flight, when it has changed since
    this.modifiedChanged = modifiedChanged;
    this.unfold = unfold;
    this.locked = !isOperator || description.read_only;
    this.text = [description.name, description.description, description.unit].join(" ").toLowerCase();
    this.press = null; // of the pointer on the slider, whose last value may still be under way
    this.sender = new GainSender(
      (value, walks) => send(value, walks, this.press),
      () => this.draw(),
    );
    this.drawn = ""; // the reason
    this.place = element("div", { className: "gain" });
  }

  // Draws the row, which is empty until then.
  fill() {
    if (this.box) return;
    this.build();
    this.draw();
  }

  get isModified() {
    return this.confirmed !== this.description.default;
  }
  get isChangedInFlight() {
    return this.flightValue !== undefined && this.flightValue !== this.confirmed;
  }
  get isNumber() {
    return ["float", "int"].includes(this.description.type);
  }

  get step() {
    const { type, step, minimum, maximum } = this.description;
    return step || (type === "int" ? 1 : (maximum - minimum) / 200 || "any");
  }

  build() {
    const { name, unit, description, default: initial, minimum, maximum } = this.description;
    const short = name.split(".").at(-1),
      title = `${description}\n${name}, default ${exact(initial)}${unit ? ` ${unit}` : ""}`;
    const label = this.unfold
      ? element(
          "button",
          { className: "fold", title, ariaExpanded: "false", onclick: () => this.toggle() },
          short,
        )
      : element("span", { title }, short);
    this.label = label;
    this.mark = this.button(
      "mark",
      "●",
      () => this.sender.set(initial),
      `${name}: modified; back to the default ${exact(initial)}`,
    );
    this.flightMark = this.button("mark flight", "◆", () => this.sender.set(this.flightValue), "");
    this.reason = element("div", { className: "reason", hidden: true, role: "status" });
    this.place.append(
      element("div", { className: "label" }, label, this.mark, this.flightMark),
      ...this.editor(name),
    );
    if (this.isNumber) this.place.append(element("span", { className: "unit" }, unit));
    if (this.isNumber && minimum !== null && maximum !== null && (maximum - minimum) / this.step < MOST_STEPS)
      this.place.append(this.travel());
    this.place.append(this.reason);
  }

  button(className, text, onclick, title) {
    return element("button", { className, disabled: this.locked, title, ariaLabel: title, onclick }, text);
  }

  travel() {
    const { name, minimum, maximum } = this.description;
    this.slider = element("input", {
      type: "range",
      min: minimum,
      max: maximum,
      step: this.step,
      disabled: this.locked,
      ariaLabel: name,
    });
    this.tick = element("i", { className: "confirmed", title: "confirmed by the vehicle" });
    this.slider.addEventListener("pointerdown", () => {
      this.held = true;
      this.press = {};
      this.draw();
    });
    this.slider.addEventListener("keydown", () => {
      this.press = null;
    });
    for (const type of ["pointerup", "pointercancel", "lostpointercapture", "change", "blur"])
      this.slider.addEventListener(type, () => {
        this.held = false;
        this.draw();
      });
    this.slider.addEventListener("input", () => {
      this.sender.set(this.rounded(Number(this.slider.value)), true);
    });
    return element(
      "div",
      { className: "travel" },
      element("span", {}, exact(minimum)),
      element("div", { className: "track" }, this.slider, this.tick),
      element("span", {}, exact(maximum)),
    );
  }

  rounded(value) {
    return Number(value.toFixed(digitsOf(this.step) + 1));
  }

  // The control in the value's column; a select or check box spans the unit's, too.
  editor(name) {
    const { type, choices } = this.description;
    if (type === "bool") {
      this.box = element("input", {
        type: "checkbox",
        disabled: this.locked,
        ariaLabel: name,
        onchange: () => this.sender.set(this.box.checked),
      });
      return [this.box, element("span")];
    }
    if (choices.length) {
      this.box = element(
        "select",
        { disabled: this.locked, ariaLabel: name, onchange: () => this.sender.set(this.box.value) },
        ...optionsOf(choices),
      );
      return [this.box];
    }
    this.box = element("input", {
      className: this.isNumber ? "value" : "value text",
      disabled: this.locked,
      ariaLabel: `${name}, value`,
      inputMode: this.isNumber ? "decimal" : "text",
      spellcheck: false,
    });
    this.box.addEventListener("focus", () => {
      this.typing = true;
      this.box.select();
    });
    this.box.addEventListener("blur", () => {
      this.typing = false;
      this.draw();
    });
    this.box.addEventListener("keydown", (event) => this.key(event));
    return [this.box];
  }

  key(event) {
    if (event.key === "Escape") this.box.blur();
    if (event.key === "Enter") {
      this.enter(this.box.value.trim());
      this.box.blur();
    }
    const steps = this.isNumber ? KEY_STEPS[event.key] : undefined;
    if (steps === undefined || this.step === "any") return;
    event.preventDefault();
    this.press = null;
    const { minimum, maximum } = this.description;
    const value = Math.min(
      maximum ?? Infinity,
      Math.max(minimum ?? -Infinity, this.rounded(this.confirmed + steps * this.step)),
    );
    this.typing = false; // the cell shows the confirmed value, as it comes
    this.sender.set(value, true);
  }

  enter(text) {
    this.press = null;
    if (!this.isNumber) {
      this.sender.set(text);
      return;
    }
    const number = parseNumber(text);
    if (!Number.isFinite(number)) this.fail(`${text || "nothing"} is not a number`);
    else this.sender.set(number);
  }

  confirm(value) {
    this.sender.noteConfirmed();
    if (value === this.confirmed) return;
    const was = this.isModified;
    this.confirmed = value;
    this.draw();
    if (was !== this.isModified) this.modifiedChanged(this);
  }

  // The value at the start of this flight; undefined when it has not changed since.
  flightBegan(value) {
    if (value === this.flightValue) return;
    this.flightValue = value;
    this.draw();
  }

  fail(reason) {
    this.sender.reason = reason;
    this.sender.refused = undefined;
    this.sender.to("refused");
  }

  toggle() {
    const isOpen = this.label.getAttribute("aria-expanded") !== "true";
    this.label.setAttribute("aria-expanded", String(isOpen));
    this.details?.remove();
    this.details = isOpen ? element("div", { className: "details" }) : null;
    if (!isOpen) return;
    this.place.append(this.details);
    this.unfold?.(this, this.details);
  }

  draw() {
    if (!this.box) return;
    const { state } = this.sender,
      shown = state === "idle" ? "" : state;
    if (this.shown !== shown) {
      this.place.classList.remove("waiting", "late", "refused");
      if (shown) this.place.classList.add(shown);
      this.shown = shown;
    }
    this.place.classList.toggle("changed", this.isModified);
    this.place.classList.toggle("flown", this.isChangedInFlight);
    if (this.isChangedInFlight) {
      this.flightMark.title = `changed in this flight; back to ${exact(this.flightValue)}, as it was at take-off`;
      this.flightMark.ariaLabel = `${this.description.name}: ${this.flightMark.title}`;
    }
    this.drawReason();
    if (this.box.type === "checkbox") this.box.checked = this.confirmed === true;
    else if (!this.typing)
      this.box.value = typeof this.confirmed === "number" ? exact(this.confirmed) : this.confirmed;
    // Late or refused: the thumb goes back to what is true, unless a hand holds it.
    if (this.slider && !this.held && state !== "waiting") this.slider.value = this.confirmed;
    if (this.slider) this.drawSlider(state);
  }

  drawReason() {
    const { reason, refused } = this.sender;
    if (reason === this.drawn) return;
    this.drawn = reason;
    this.reason.hidden = !reason;
    const limit = this.description.flight_step,
      steps = Math.ceil(Math.abs(refused - this.confirmed) / limit);
    const walks =
      limit && reason.includes("in flight") && steps > 1
        ? [
            " ",
            element(
              "button",
              { className: "link", onclick: () => this.sender.set(refused, true) },
              `Apply in ${steps} steps`,
            ),
          ]
        : [];
    this.reason.replaceChildren(reason, ...walks);
  }

  drawSlider(state) {
    const { minimum, maximum } = this.description,
      at = (value) => (value - minimum) / (maximum - minimum);
    this.slider.style.setProperty("--at", `${100 * at(Number(this.slider.value))}%`);
    const isAway = (this.held || state !== "idle") && Number(this.slider.value) !== this.confirmed;
    this.tick.classList.toggle("away", isAway);
    if (isAway) this.tick.style.setProperty("--at", String(at(this.confirmed)));
  }
}

export function fill(rows) {
  for (const row of rows) if (!row.place.hidden) row.fill();
}

// Rows are drawn once they are shown, because most of their thousands of elements never are.
export function fillWhenOpen(details, rows) {
  details.addEventListener("toggle", () => {
    if (details.open) fill(rows);
  });
}
