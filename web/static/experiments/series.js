// Several flights of one experiment: each as often as wanted, or over a list of values of one option. In a simulation
// one follows the other; a real vehicle is started by a person each time. It goes on while this page is open.

import { badge, decisive, number, unitOf } from "./figures.js";
import { isThere } from "../core/vehicle_path.js";
import { element, hide, optionsOf, setText } from "../core/dom.js";
import { exact, parseNumber, words } from "../core/format.js";

const MOST = 50; // flights
const BREAKS = ["stopped", "refused"]; // phases after which nothing more is flown

// What each flight of a series has: [{ options, value }]. Throws an Error with the line to show.
/**
 * @param {Record<string, any>} options @param {number} times @param {any} over @param {string} text
 * @returns {{ options: Record<string, any>, value: any }[]}
 */
export function planned(options, times, over, text) {
  const values = over ? valuesOf(over, text) : [undefined];
  if (!Number.isInteger(times) || times < 1 || times * values.length > MOST)
    throw new Error(`A series has 1 to ${MOST} flights, here ${times * values.length || "?"}.`);
  return values.flatMap((value) =>
    Array.from({ length: times }, () => ({
      value,
      options: over ? { ...options, [over.name]: value } : { ...options },
    })),
  );
}

/** @param {any} option @param {string} text @returns {any[]} */
function valuesOf(option, text) {
  const parts = text.split(/[\s;]+/).filter(Boolean);
  if (!parts.length) throw new Error(`Series over ${words(option.name)}: enter its values, as “1 1.5 2”.`);
  if (option.choices.length) {
    const wrong = parts.find((one) => !option.choices.includes(one));
    if (wrong === undefined) return parts;
    throw new Error(`${words(option.name)} = ${wrong}; allowed ${option.choices.join(", ")}`);
  }
  const numbers = parts.map(parseNumber),
    { minimum: low, maximum: high } = option;
  const wrong = numbers.findIndex((one) => !(one >= (low ?? -Infinity) && one <= (high ?? Infinity)));
  if (wrong < 0) return numbers;
  throw new Error(
    `${words(option.name)} = ${parts[wrong]}; allowed ${exact(low)} to ${exact(high)} ${option.unit}`,
  );
}

// Mean, least and greatest of the deciding figure.
/** @param {any[][]} all metrics of each flight */
export function summary(all) {
  const found = all.map(decisive).filter((one) => one !== null && Number.isFinite(one.value)),
    [first] = found;
  if (found.length < 2 || found.some(({ name }) => name !== first.name)) return "";
  const values = found.map(({ value }) => value),
    mean = values.reduce((sum, one) => sum + one, 0) / values.length;
  const [low, high] = [Math.min(...values), Math.max(...values)].map((one) => number(one, first.name));
  return `mean ${number(mean, first.name)} ${unitOf(first.name)}, ${low} to ${high}`;
}

export class Series {
  flights = /** @type {{ options: Record<string, any>, value: any, result?: any }[]} */ ([]);
  at = 0; // the next one
  name = "";

  constructor() {
    this.times = element("input", { type: "number", min: 1, max: MOST, step: 1, value: 1 });
    this.over = element("select", { onchange: () => this.fit() });
    this.values = element("input", { type: "text", placeholder: "1 1.5 2" });
    this.valuesLabel = element("label", { className: "wide" }, element("span", {}, "values"), this.values);
    this.form = element(
      "div",
      { className: "options series" },
      element("label", { className: "bare" }, element("span", {}, "flights"), this.times),
      element("label", { className: "bare" }, element("span", {}, "over"), this.over),
      this.valuesLabel,
    );
    this.state = element("p");
    this.rows = element("ol");
    this.compare = element("a", { target: "_blank" }, "Compare");
    this.end = element("button", { className: "link", onclick: () => this.stop() }, "End the series");
    this.place = element(
      "section",
      { className: "series", hidden: true },
      element("h2", {}, "Series"),
      this.rows,
      this.state,
      element("p", { className: "links" }, this.compare, this.end),
    );
  }

  // Whether flights are still to come.
  get goesOn() {
    return this.at < this.flights.length;
  }
  get next() {
    return this.flights[this.at];
  }
  get count() {
    return `${this.at + 1} of ${this.flights.length}`;
  }

  // The options over which a series of this experiment can go.
  offer(experiment) {
    this.options = (experiment?.options ?? []).filter(
      ({ type, choices }) => choices.length || type === "float" || type === "int",
    );
    this.over.replaceChildren(
      ...optionsOf([["", "nothing"], ...this.options.map(({ name }) => [name, words(name)])]),
    );
    this.fit();
  }

  fit() {
    hide(this.valuesLabel, !this.over.value);
    const option = this.options.find(({ name }) => name === this.over.value);
    this.values.placeholder = option?.choices.length ? option.choices.join(" ") : "1 1.5 2";
  }

  // Throws an Error with the line to show. One flight is no series.
  begin(name, options) {
    const over = this.options.find((one) => one.name === this.over.value);
    const flights = planned(options, this.times.valueAsNumber, over, this.values.value);
    this.name = name;
    this.unit = over?.unit ?? "";
    this.flights = flights.length > 1 ? flights : [];
    this.at = 0;
    this.draw();
    return flights[0].options;
  }

  // The flight that was under way has ended; whether another follows.
  took({ name, phase, verdict, metrics, run_id: run }) {
    if (!this.goesOn || name !== this.name) return false;
    this.next.result = { verdict: verdict || phase, metrics, run };
    this.at += 1;
    if (BREAKS.includes(phase)) this.stop();
    this.draw();
    return this.goesOn;
  }

  stop() {
    this.flights.splice(this.at);
    this.draw();
  }

  draw(wait = "") {
    hide(this.place, !this.flights.length);
    const done = this.flights.flatMap(({ result }) => (result ? [result] : []));
    this.rows.replaceChildren(
      ...this.flights.flatMap(({ value, result }) =>
        result
          ? [
              element(
                "li",
                {},
                element("span", {}, value === undefined ? "" : `${value} ${this.unit}`),
                isThere("replay")
                  ? element("a", { href: `/replay/${encodeURIComponent(result.run)}` }, badge(result))
                  : badge(result),
              ),
            ]
          : [],
      ),
    );
    const more = this.goesOn ? `Flight ${this.count}${wait}` : `${done.length} flights flown`;
    setText(this.state, [more, summary(done.map(({ metrics }) => metrics))].filter(Boolean).join(" · "));
    const query = new URLSearchParams(done.slice(0, 12).map(({ run }) => ["run", run]));
    hide(this.compare, done.length < 2);
    this.compare.setAttribute("href", `compare?${query}`);
    hide(this.end, !this.goesOn);
  }
}
