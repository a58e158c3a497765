// Setting up a pad: each function is given a stick by moving it, or a button by pressing it. The
// sticks are off meanwhile, so that nothing tried out here flies.

import { element, optionsOf } from "../core/dom.js";
import { fixed } from "../core/format.js";
import {
  AXES,
  BUTTONS,
  DEAD_ZONE,
  EXPO,
  PRESETS,
  forget,
  isPressed,
  mappingOf,
  preset,
  presetOf,
  readPad,
  remember,
} from "./mapping.js";

const FUNCTIONS = {
  forward: ["Forward", "Push the stick for forward all the way away from you"],
  left: ["Left", "Push the stick for left all the way to the left"],
  up: ["Up", "Push the stick for up all the way up"],
  yaw: ["Turn left", "Push the stick for turning all the way to the left"],
  deadMan: ["Sticks on (hold)", "Press the button that you will hold while flying"],
  land: ["Emergency land", "Press the button for emergency land"],
  cut: ["Cut (hold 0.5 s)", "Press the button for cutting the motors"],
};
const MOVED = 0.6; // of full travel, from where it was
const GUESS = {
  axes: preset("Mode 2").axes,
  buttons: { deadMan: [], land: [], cut: [] },
  deadZone: 0.08,
  expo: 0.3,
};

export class StickEditor {
  rest;

  constructor(place, sticks) {
    this.sticks = sticks;
    this.wanted = null; // the function that waits for a stick or button
    this.rows = Object.entries(FUNCTIONS).map(([name, [label]]) => this.row(name, label));
    this.title = element("h2");
    this.modes = element(
      "select",
      { ariaLabel: "preset", onchange: () => this.choose() },
      ...optionsOf([...PRESETS, ["", "own"]]),
    );
    this.deadZone = this.slider(
      "dead zone",
      DEAD_ZONE,
      "deadZone",
      "travel around the centre that counts as centred",
    );
    this.expo = this.slider("expo", EXPO, "expo", "0: straight; 1: fine around the centre");
    this.hint = element("p", { className: "hint", role: "status" });
    this.box = element(
      "section",
      { id: "stick-editor", hidden: true, ariaLabel: "set up the pad" },
      element("header", {}, this.title, element("button", { onclick: () => this.close() }, "Done")),
      element(
        "div",
        { className: "line" },
        element("label", {}, "Preset ", this.modes),
        element(
          "button",
          { onclick: () => this.reset(), title: "discard the set-up of this type of gamepad" },
          "Standard",
        ),
      ),
      ...this.rows.map(({ line }) => line),
      this.deadZone.line,
      this.expo.line,
      this.hint,
    );
    place.append(this.box);
    this.box.addEventListener("keydown", (event) => {
      if (event.key === "Escape") {
        if (this.wanted) this.detect(null);
        else this.close();
      }
    });
    sticks.clock.addEventListener("message", () => {
      if (this.isOpen) this.draw();
    });
  }

  get isOpen() {
    return !this.box.hidden;
  }
  get pad() {
    return this.sticks.pad;
  }

  row(name, label) {
    const where = element("output"),
      bar = element("i"),
      isAxis = AXES.includes(name);
    const set = element(
      "button",
      {
        title: isAxis ? "move the stick you want" : "press the button you want",
        ariaLabel: `${isAxis ? "move the stick" : "press the button"} for ${label}`,
        onclick: () => this.detect(this.wanted === name ? null : name),
      },
      isAxis ? "Move…" : "Press…",
    );
    const invert = element(
      "button",
      {
        ariaPressed: "false",
        hidden: !isAxis,
        ariaLabel: `invert ${label}`,
        onclick: () =>
          this.change((mapping) => {
            mapping.axes[name].inverted = !mapping.axes[name].inverted;
          }),
      },
      "Invert",
    );
    const meter = element("span", { className: isAxis ? "meter" : "lamp" }, bar);
    return {
      name,
      isAxis,
      where,
      bar,
      set,
      invert,
      meter,
      line: element("div", { className: "function" }, element("span", {}, label), meter, where, set, invert),
    };
  }

  /** @type {(label: string, bounds: number[], key: string, title: string) => any} */
  slider(label, [low, high], key, title) {
    const value = element("output"),
      input = element("input", { type: "range", min: low, max: high, step: 0.01, ariaLabel: label, title });
    input.addEventListener("input", () =>
      this.change((mapping) => {
        mapping[key] = input.valueAsNumber;
      }),
    );
    return {
      key,
      value,
      input,
      line: element("label", { className: "function wide" }, element("span", {}, label), input, value),
    };
  }

  toggle() {
    if (this.isOpen) this.close();
    else this.open();
  }

  open() {
    this.sticks.drop("editing");
    this.sticks.editing = true;
    this.box.hidden = false;
    this.show();
    this.modes.focus();
  }

  close() {
    this.detect(null);
    this.sticks.editing = false;
    this.box.hidden = true;
  }

  // Where the pad stands now is what a stick must move away from.
  detect(name) {
    this.wanted = name;
    this.rest =
      name && this.pad
        ? { axes: [...this.pad.axes], buttons: this.pad.buttons.map((_, i) => isPressed(this.pad, i)) }
        : null;
    this.hint.textContent = name ? `${FUNCTIONS[name][1]}. Esc: skip it.` : "";
    for (const row of this.rows) row.set.setAttribute("aria-pressed", String(row.name === name));
  }

  change(act) {
    if (!this.pad) return;
    const mapping = structuredClone(this.sticks.mapping ?? GUESS);
    act(mapping);
    remember(this.pad, mapping);
    this.sticks.mapping = mapping;
    this.show();
  }

  choose() {
    if (this.modes.value)
      this.change((mapping) => {
        mapping.axes = preset(this.modes.value).axes;
      });
  }

  reset() {
    if (!this.pad) return;
    forget(this.pad);
    this.sticks.mapping = mappingOf(this.pad);
    this.show();
  }

  // What does not move with the sticks.
  show() {
    const mapping = this.sticks.mapping,
      known = mapping ?? GUESS;
    this.modes.value = mapping ? presetOf(mapping) : "";
    for (const { name, isAxis, where, invert } of this.rows) {
      const source = isAxis ? known.axes[name] : known.buttons[name];
      where.textContent =
        !mapping && isAxis
          ? "not set"
          : isAxis
            ? `axis ${source.index}`
            : source.length
              ? `button ${source.join(", ")}`
              : "none";
      invert.setAttribute("aria-pressed", String(Boolean(mapping && source.inverted)));
    }
    for (const { key, input, value } of [this.deadZone, this.expo]) {
      input.value = known[key];
      value.textContent = fixed(known[key], 2);
    }
  }

  draw() {
    const { pad } = this;
    this.title.textContent = pad ? pad.id : "No gamepad yet: press one of its buttons";
    if (!pad) {
      if (this.wanted) this.detect(null);
      return;
    }
    if (this.shownPad !== pad.id) {
      this.shownPad = pad.id;
      this.show();
    }
    const mapping = this.sticks.mapping ?? GUESS;
    readPad(pad, mapping).raw.forEach((value, i) => {
      this.rows[i].bar.style.transform = `translateX(${50 * value}%)`;
    });
    for (const row of this.rows)
      if (!row.isAxis)
        row.meter.classList.toggle(
          "lit",
          mapping.buttons[row.name].some((index) => isPressed(pad, index)),
        );
    if (this.wanted) this.look(pad);
  }

  look(pad) {
    const name = this.wanted;
    if (BUTTONS.includes(name)) {
      const index = pad.buttons.findIndex((_, i) => isPressed(pad, i) && !this.rest.buttons[i]);
      this.rest.buttons = pad.buttons.map((_, i) => isPressed(pad, i) && this.rest.buttons[i]);
      if (index < 0) return;
      this.change((mapping) => {
        for (const other of BUTTONS)
          mapping.buttons[other] = mapping.buttons[other].filter((one) => one !== index);
        mapping.buttons[name] = [index];
      });
    } else {
      const moved = [...pad.axes].map((value, i) => value - (this.rest.axes[i] ?? 0));
      const index = moved.reduce((best, value, i) => (Math.abs(value) > Math.abs(moved[best]) ? i : best), 0);
      if (!(Math.abs(moved[index]) > MOVED)) return;
      this.change((mapping) => {
        const other = AXES.find((axis) => axis !== name && mapping.axes[axis].index === index);
        if (other) mapping.axes[other] = { ...mapping.axes[name] }; // they change places
        mapping.axes[name] = { index, inverted: moved[index] < 0 };
      });
    }
    this.detect(null);
    this.hint.textContent = `${FUNCTIONS[name][0]} is set.`;
  }
}
