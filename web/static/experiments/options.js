// The options of one experiment as a form: bounds, choices and units come from the station.

import { element, optionsOf } from "../core/dom.js";
import { exact, words } from "../core/format.js";

export class OptionForm {
  constructor() {
    this.place = element("div", { className: "options" });
    this.fields = [];
  }

  // experiment: of /api/experiments, or undefined for none.
  show(experiment) {
    this.name = experiment?.name ?? "";
    this.fields = (experiment?.options ?? []).map((option) => [option, input(option)]);
    this.place.replaceChildren(
      ...this.fields.map(([option, field]) => {
        const isText = option.type === "str" && !option.choices.length;
        return element(
          "label",
          { className: isText ? "wide" : option.unit ? "" : "bare", title: field.title },
          element("span", {}, words(option.name)),
          field,
          ...(option.unit ? [element("small", {}, option.unit)] : []),
        );
      }),
    );
  }

  // Of a start before, where the options are still there.
  put(values) {
    for (const [option, field] of this.fields) {
      const value = values[option.name];
      if (value === undefined) continue;
      if (option.type === "bool") field.checked = value;
      else field.value = value;
    }
  }

  // What was chosen. Throws an Error with the line to show.
  values() {
    const found = {};
    for (const [option, field] of this.fields) {
      if (option.type === "bool") found[option.name] = field.checked;
      else if (option.type === "str") found[option.name] = field.value.trim();
      else if (!field.checkValidity() || !Number.isFinite(field.valueAsNumber)) {
        throw new Error(
          `${words(this.name)}: ${words(option.name)} = ${field.value || "?"}; allowed ` +
            `${exact(option.minimum)} to ${exact(option.maximum)} ${option.unit}`,
        );
      } else found[option.name] = field.valueAsNumber;
    }
    return found;
  }

  // As it stands, sound or not.
  taken() {
    return Object.fromEntries(
      this.fields.map(([option, field]) => [
        option.name,
        option.type === "bool" ? field.checked : field.value,
      ]),
    );
  }

  disable(isOff) {
    for (const [, field] of this.fields) field.disabled = isOff;
  }
}

function input(option) {
  const bounds =
    option.minimum !== null && option.maximum !== null
      ? `, ${exact(option.minimum)} to ${exact(option.maximum)} ${option.unit}`
      : "";
  const common = { title: `${option.description}${bounds}`, ariaLabel: option.name };
  if (option.choices.length)
    return element(
      "select",
      common,
      ...optionsOf(
        option.choices.map((choice) => [choice, words(choice)]),
        option.default,
      ),
    );
  if (option.type === "bool")
    return element("input", { ...common, type: "checkbox", checked: option.default });
  if (option.type === "str")
    return element("input", { ...common, type: "text", value: option.default, placeholder: "none" });
  return element("input", {
    ...common,
    type: "number",
    value: option.default,
    min: option.minimum ?? "",
    max: option.maximum ?? "",
    step: "any",
  });
}
