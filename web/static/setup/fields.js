// Some parameters as fields on the Settings page: confirmed values, and drafts until they are applied.

import { element, showNote } from "../core/dom.js";
import { exact, parseNumber } from "../core/format.js";

// Some numbers with one Apply for all: what is typed is a draft, marked, until it is applied.
// Fires `draft` when something was typed or taken back.
export class Fields extends EventTarget {
  // labels: [[parameter's name, label], …]
  constructor(place, parameters, labels) {
    super();
    this.parameters = parameters;
    this.inputs = labels.map(([name, label]) => {
      const input = element("input", {
        disabled: true,
        inputMode: "decimal",
        spellcheck: false,
        autocomplete: "off",
        ariaLabel: label,
      });
      input.addEventListener("input", () => this.edited());
      input.addEventListener("keydown", (event) => {
        if (event.key === "Enter") this.apply();
        if (event.key === "Escape") this.discard();
      });
      return { name, input, unit: element("small") };
    });
    this.button = element("button", { disabled: true, onclick: () => this.apply() }, "Apply");
    this.back = element("button", { hidden: true, onclick: () => this.discard() }, "Discard");
    this.reason = element("p", { className: "reason", role: "alert", hidden: true });
    place.append(
      element(
        "div",
        { className: "fields" },
        ...this.inputs.map(({ input, unit }, i) =>
          element("label", {}, element("span", {}, labels[i][1]), input, unit),
        ),
      ),
      element("div", { className: "acts" }, this.button, this.back),
      this.reason,
    );
    for (const type of ["read", "confirmed"]) parameters.addEventListener(type, () => this.show());
    this.show();
  }

  get isDraft() {
    return this.inputs.some(({ input }) => input.classList.contains("draft"));
  }

  // What is typed, by name; the confirmed value where nothing is.
  values() {
    return Object.fromEntries(
      this.inputs.map(({ name, input }) => [
        name,
        input.classList.contains("draft") ? parseNumber(input.value) : this.parameters.value(name),
      ]),
    );
  }

  show() {
    for (const { name, input, unit } of this.inputs) {
      const description = this.parameters.known.get(name);
      input.disabled = !description || !this.parameters.isOperator || description.read_only;
      if (!description) {
        input.value = "–";
        continue;
      }
      unit.textContent = description.unit;
      input.title =
        `${description.description}; ${exact(description.minimum ?? -Infinity)} to ` +
        `${exact(description.maximum ?? Infinity)} ${description.unit}; ${name}`;
      if (!input.classList.contains("draft")) input.value = exact(description.value);
    }
    this.edited();
  }

  edited() {
    for (const { name, input } of this.inputs)
      input.classList.toggle(
        "draft",
        this.parameters.known.has(name) && parseNumber(input.value) !== this.parameters.value(name),
      );
    this.button.disabled = !this.isDraft || !this.parameters.isOperator;
    this.back.hidden = !this.isDraft;
    if (!this.isDraft) this.reason.hidden = true;
    this.dispatchEvent(new Event("draft"));
  }

  discard() {
    for (const { input } of this.inputs) input.classList.remove("draft");
    this.show();
  }

  async apply() {
    const all = this.values();
    const changed = Object.fromEntries(
      this.inputs
        .filter(({ input }) => input.classList.contains("draft"))
        .map(({ name }) => [name, all[name]]),
    );
    if (!Object.keys(changed).length) return;
    const wrong = this.inputs.find(({ name }) => name in changed && !Number.isFinite(changed[name]));
    if (wrong) {
      this.refuse(`${wrong.input.ariaLabel}: ${wrong.input.value || "nothing"} is not a number`);
      return;
    }
    try {
      await this.parameters.set(changed);
      this.discard();
    } catch (error) {
      this.refuse(error.message);
    }
  }

  refuse(text) {
    showNote(this.reason, `Not changed: ${text}`);
  }
}
