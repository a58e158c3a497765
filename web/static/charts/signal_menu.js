// The list of signals, by topic: one for all charts, built when it is looked at.

import { forget, isDerived } from "./derived.js";
import { element } from "../core/dom.js";
import { words } from "../core/format.js";
import { icon } from "../icons/icons.js";

export const MOST = 8;
export const MOST_UNITS = 3; // in one chart
const FOUND = 80; // results of a search at most
const EXAMPLE = "speed [m/s] = norm(state.velocity.x, state.velocity.y)";
const HINT =
  "LABEL [UNIT] = EXPRESSION; label and unit may be left out. Signals by their names (hover over " +
  "one), numbers, pi, + - * / ^ and brackets; abs, min, max, norm, sign, sqrt, exp, log, sin, cos, " +
  "tan, atan2 (rad), deg, rad; diff (rate of change), integral, lowpass(signal, Hz).";
let ids = 0;

export class ChartMenu {
  // named: how many signals, from the first on, have a name of their own
  // derive(text): a signal derived by an expression, or throws what is wrong with it
  constructor({ signals, named }, derive) {
    this.signals = signals;
    this.derive = derive; // shared with other menus of the page
    this.named = new Set(signals.slice(0, named).map(({ name }) => name));
    this.search = element("input", {
      type: "search",
      placeholder: "Search signals",
      ariaLabel: "search signals",
      oninput: () => this.list(),
    });
    this.note = element("span", { className: "note", role: "status" });
    this.scales = element("div", { className: "scales" });
    this.lists = element("div", { className: "lists" });
    this.place = element(
      "div",
      { className: "menu signals", role: "dialog", id: `signals-${ids++}` },
      element(
        "div",
        { className: "tools" },
        this.search,
        this.note,
        element("button", { onclick: () => this.close() }, "Close"),
      ),
      this.scales,
      this.lists,
    );
    this.place.addEventListener("keydown", (event) => {
      if (event.key === "Escape") {
        this.close();
        event.stopPropagation();
      }
    });
    this.outside = (event) => {
      if (!this.place.parentElement?.contains(event.target)) this.close();
    };
  }

  get isOpen() {
    return this.place.isConnected;
  }

  // changed(): the chart's signals or scales were.
  toggle(chart, button, changed) {
    const again = this.isOpen && this.chart === chart;
    if (this.isOpen) this.close();
    if (again) return;
    this.chart = chart;
    this.button = button;
    this.changed = changed;
    button.ariaExpanded = "true";
    this.place.ariaLabel = `signals of ${chart.place.ariaLabel}`;
    this.search.value = "";
    chart.place.append(this.place);
    document.addEventListener("pointerdown", this.outside);
    this.list();
    this.drawScales();
    this.search.focus();
  }

  close() {
    document.removeEventListener("pointerdown", this.outside);
    this.place.remove();
    this.lists.replaceChildren();
    this.button.ariaExpanded = "false";
    this.button.focus();
  }

  list() {
    const text = this.search.value.trim().toLowerCase();
    if (!text) this.lists.replaceChildren(this.derived(), ...this.topics());
    else {
      const parts = text.split(/\s+/),
        found = this.signals.filter((signal) => {
          const all = `${signal.name} ${signal.group} ${signal.label} ${signal.unit}`.toLowerCase();
          return parts.every((part) => all.includes(part));
        });
      this.lists.replaceChildren(
        ...groups(found.slice(0, FOUND)).map((members) => this.group(members, true)),
      );
      if (!found.length) this.lists.append(element("p", { className: "empty" }, "No signal matches."));
      if (found.length > FOUND)
        this.lists.append(
          element("p", { className: "empty" }, `${found.length - FOUND} more; search for more of the name.`),
        );
    }
    this.limit();
  }

  // Those made by an expression, and a field for another one.
  derived() {
    const all = this.signals.filter(({ name }) => isDerived(name));
    const chosen = all.filter(({ name }) => this.chart.names.includes(name));
    return this.section("derived by an expression", chosen.length, () => {
      const problem = element("p", { className: "problem", role: "alert", hidden: true });
      const field = element("input", {
        type: "text",
        maxLength: 300,
        placeholder: EXAMPLE,
        ariaLabel: "expression of a derived signal",
        title: HINT,
        onkeydown: ({ key }) => {
          if (key === "Enter") add();
        },
      });
      const add = async () => {
        try {
          const signal = await this.derive(field.value);
          if (!this.signals.some(({ name }) => name === signal.name)) this.signals.push(signal);
          if (!this.isFull(signal.unit)) this.choose(signal.name, true);
          this.list();
        } catch (error) {
          problem.textContent = error.message;
          problem.hidden = false;
        }
      };
      return [
        element("div", { className: "expression" }, field, element("button", { onclick: add }, "Add")),
        problem,
        ...all.map((signal) =>
          element(
            "div",
            { className: "expression" },
            this.box(signal),
            element(
              "button",
              {
                className: "icon",
                title: `forget ${signal.name}`,
                ariaLabel: `forget ${signal.name}`,
                onclick: () => this.forget(signal.name),
              },
              icon("close"),
            ),
          ),
        ),
      ];
    });
  }

  forget(name) {
    forget(name);
    if (this.chart.names.includes(name)) this.choose(name, false);
    this.signals.splice(
      this.signals.findIndex((one) => one.name === name),
      1,
    );
    this.list();
  }

  topics() {
    const plain = this.signals.filter(({ name }) => !isDerived(name));
    return [...new Set(plain.map(({ topic }) => topic))].map((topic) => {
      const all = plain.filter((signal) => signal.topic === topic);
      const named = all.filter(({ name }) => this.named.has(name));
      const chosen = all.filter(({ name }) => this.chart.names.includes(name));
      return this.section(words(topic), chosen.length, () => [
        ...groups(named).map((members) => this.group(members)),
        ...(all.length > named.length
          ? [
              this.rest(
                all.filter(({ name }) => !this.named.has(name)),
                named.length === 0,
              ),
            ]
          : []),
      ]);
    });
  }

  rest(signals, isAll) {
    const make = () => groups(signals).map((members) => this.group(members));
    if (isAll) return element("div", {}, ...make());
    return this.section(
      "other numbers of the message",
      signals.filter(({ name }) => this.chart.names.includes(name)).length,
      make,
    );
  }

  // Its members are made when it is first opened.
  section(title, chosen, make) {
    const place = element(
      "details",
      {},
      element("summary", {}, title, element("span", {}, chosen ? `${chosen} shown` : "")),
    );
    const fill = () => {
      if (place.open && place.children.length === 1) {
        place.append(...make());
        this.limit();
      }
    };
    place.addEventListener("toggle", fill);
    if (chosen) {
      place.open = true;
      place.append(...make());
    }
    return place;
  }

  group(members, withTopic = false) {
    const { group, topic } = members[0];
    const unit = members.every((one) => one.unit === members[0].unit) ? members[0].unit : "";
    return element(
      "fieldset",
      {},
      element("legend", {}, `${withTopic ? `${words(topic)}: ` : ""}${group}${unit ? `, ${unit}` : ""}`),
      ...members.map((signal) => this.box(signal)),
    );
  }

  box(signal) {
    const input = element("input", {
      type: "checkbox",
      checked: this.chart.names.includes(signal.name),
      onchange: () => this.choose(signal.name, input.checked),
    });
    input.dataset.name = signal.name;
    const constant = "constant" in signal ? `: always ${signal.constant ?? "empty"}` : ""; // of a recorded run
    return element(
      "label",
      { title: signal.name + constant, className: constant && "constant" },
      input,
      signal.label,
    );
  }

  choose(name, isWanted) {
    const names = this.chart.names.filter((other) => other !== name);
    this.chart.select(isWanted ? [...names, name] : names);
    this.limit();
    this.drawScales();
    this.changed();
  }

  isFull(unit) {
    const { names, units } = this.chart;
    return names.length >= MOST || (units.length >= MOST_UNITS && !units.includes(unit));
  }

  limit() {
    const { names, units } = this.chart,
      isFull = names.length >= MOST,
      noUnit = units.length >= MOST_UNITS;
    for (const box of this.lists.querySelectorAll("input[type=checkbox]")) {
      const { name } = box.dataset;
      box.disabled = !box.checked && this.isFull(this.signals.find((one) => one.name === name)?.unit);
      box.parentElement.classList.toggle("off", box.disabled);
    }
    this.note.textContent = isFull
      ? `${MOST} of ${MOST} signals`
      : noUnit
        ? `${names.length} of ${MOST} signals, ${MOST_UNITS} of ${MOST_UNITS} units`
        : `${names.length} of ${MOST} signals`;
  }

  // By unit: as the values are, or fixed.
  drawScales() {
    this.scales.replaceChildren(
      ...this.chart.units.map((unit) => {
        const fixed = this.chart.scales[unit],
          [low, high] = fixed ?? this.shown(unit);
        const field = (value, label) =>
          element("input", {
            type: "number",
            step: "any",
            value,
            disabled: !fixed,
            ariaLabel: `${label} end of the ${unit || "plain"} scale`,
            onchange: () => apply(),
          });
        const from = field(low, "lower"),
          to = field(high, "upper");
        const auto = element("input", {
          type: "checkbox",
          checked: !fixed,
          onchange: () => {
            from.disabled = to.disabled = auto.checked;
            apply();
          },
        });
        const apply = () => {
          const isWrong = !(from.valueAsNumber < to.valueAsNumber);
          to.setCustomValidity(!auto.checked && isWrong ? "above the lower end" : "");
          if (!auto.checked && isWrong) return;
          this.chart.setScale(unit, auto.checked ? null : [from.valueAsNumber, to.valueAsNumber]);
          this.changed();
        };
        return element(
          "div",
          {},
          element("span", {}, `scale ${unit || "without unit"}`),
          element("label", {}, auto, "auto"),
          from,
          "to",
          to,
          element(
            "label",
            {},
            "line at",
            element("input", {
              type: "number",
              step: "any",
              value: this.chart.limits[unit] ?? "",
              placeholder: "none",
              ariaLabel: `line across the ${unit || "plain"} scale`,
              onchange: ({ target }) => {
                this.chart.setLimit(unit, target.valueAsNumber);
                this.changed();
              },
            }),
          ),
        );
      }),
    );
  }

  shown(unit) {
    // x of one signal over another has none
    const { min, max } = this.chart.uplot.scales[`y${this.chart.units.indexOf(unit)}`] ?? {};
    return [min, max].map((value) => Number((value ?? 0).toPrecision(3)));
  }
}

// Members of the same topic and group, in their order.
function groups(signals) {
  const found = new Map();
  for (const signal of signals) {
    const key = `${signal.topic} ${signal.group}`;
    if (!found.has(key)) found.set(key, []);
    found.get(key).push(signal);
  }
  return [...found.values()];
}
