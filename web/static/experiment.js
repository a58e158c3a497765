// The Fly tab's experiments: options, start by a hold (it arms), finish, stop, and the verdict.

import { get, request } from "./api.js";
import { duration, element, exact, words } from "./format.js";
import { onHold } from "./hold.js";

const RUNNING = ["flying", "finishing", "evaluating"];
const HELP = "Any command of a person, or a deflected stick, takes over and ends it.";
const BY_HAND = "Flown by hand: hold Shift, or a shoulder button of the pad.";
const RETRY = 3000; // ms, while the station does not tell its experiments

export class ExperimentSection {
  constructor(place, events, fly, isOperator, ages) {
    this.events = events;
    this.ages = ages;
    this.fly = fly;
    this.isOperator = isOperator;
    this.place = place;
    this.known = null; // asked for when the section is open
    this.again = 0;
    this.fields = [];
    this.state = element("output");
    this.select = element("select", { ariaLabel: "experiment", onchange: () => this.showOptions() });
    this.options = element("div", { className: "options" });
    this.start = element("button", { className: "hold", title: "hold for 0.8 s: arms, takes off and flies it" }, "Start");
    this.finish = element("button", { title: "end the manoeuvre now: handed back, landed, judged", onclick: () => this.ask("finish") }, "Finish");
    this.stop = element("button", { title: "command no more: the vehicle brakes and hovers; land it", onclick: () => this.ask("stop") }, "Stop");
    this.bar = element("i");
    this.step = element("p", { className: "step" });
    this.result = element("div", { className: "result" });
    this.state.dataset.topic = this.step.dataset.topic = "experiment_status";
    place.append(
      element("summary", {}, "Experiment", this.state), this.select, this.options,
      element("div", { className: "act" }, this.start, this.finish, this.stop),
      element("div", { className: "progress" }, this.bar), this.step, this.result);
    onHold(this.start, 800, () => this.begin());
    place.addEventListener("toggle", () => place.open && this.load());
    events.on("summary", () => this.draw());
    setInterval(() => this.draw(), 500);
  }

  get status() { return this.events.summary.experiment ?? null; }

  async load() {
    if (this.known || performance.now() < this.again) return;
    this.again = performance.now() + RETRY;
    try {
      const { experiments } = await get("/api/experiments");
      if (!experiments.length) throw new Error("The station knows no experiments.");
      this.known = experiments;
    } catch (error) {
      this.options.replaceChildren(element("p", { className: "empty" }, error.message));
      return;
    }
    this.select.replaceChildren(...this.known.map(({ name }) => element("option", { value: name }, words(name))));
    const running = this.known.find(({ name }) => name === this.status?.name);
    this.select.value = (running ?? this.known.find(({ name }) => name === "bearings") ?? this.known[0])?.name ?? "";
    this.showOptions();
  }

  showOptions() {
    const chosen = this.known.find(({ name }) => name === this.select.value);
    this.select.title = chosen?.description ?? "";
    this.fields = (chosen?.options ?? []).map((option) => [option, this.input(option)]);
    this.options.replaceChildren(...this.fields.map(([option, input]) =>
      element("label", { className: option.type === "str" && !option.choices.length ? "wide" : option.unit ? "" : "bare" }, element("span", {}, words(option.name)), input, ...(option.unit ? [element("small", {}, option.unit)] : []))));
    this.draw();
  }

  input(option) {
    const bounds = option.minimum !== null && option.maximum !== null ? `, ${exact(option.minimum)} to ${exact(option.maximum)} ${option.unit}` : "";
    const common = { title: `${option.description}${bounds}`, ariaLabel: option.name };
    if (option.choices.length) {
      const select = element("select", common, ...option.choices.map((choice) => element("option", { value: choice }, words(choice))));
      select.value = option.default;
      return select;
    }
    if (option.type === "bool") return element("input", { ...common, type: "checkbox", checked: option.default });
    if (option.type === "str") return element("input", { ...common, type: "text", value: option.default, placeholder: "none" });
    return element("input", { ...common, type: "number", value: option.default, min: option.minimum ?? "", max: option.maximum ?? "", step: "any" });
  }

  begin() {
    const options = {};
    for (const [option, input] of this.fields) {
      if (option.type === "bool") options[option.name] = input.checked;
      else if (option.type === "str") options[option.name] = input.value.trim();
      else if (!input.checkValidity() || !Number.isFinite(input.valueAsNumber)) {
        this.fly.refuse(`${words(this.select.value)}: ${words(option.name)} = ${input.value || "?"}; allowed ${exact(option.minimum)} to ${exact(option.maximum)} ${option.unit}`);
        return;
      } else options[option.name] = input.valueAsNumber;
    }
    this.ask("start", { name: this.select.value, options });
  }

  ask(action, body = {}) {
    this.fly.attempt(() => request("POST", `/api/experiments/${action}`, body), `experiment: ${action}`);
  }

  draw() {
    const { status, place } = this;
    const old = this.ages.isOld("experiment_status");
    const runs = Boolean(status) && RUNNING.includes(status.phase);
    if (runs && !this.ran) place.open = true;
    this.ran = runs;
    if (place.open) this.load();
    const inTheAir = runs && status.phase !== "evaluating";
    const time = status?.planned ? `${duration(status.elapsed)} of about ${duration(status.planned)}` : "";
    set(this.state, !status || status.phase === "idle" ? "" : `${words(status.name)} · ${status.phase}`);
    place.classList.toggle("old", old);
    this.start.disabled = !this.isOperator || runs || old || !this.fields.length && !this.select.value;
    this.finish.disabled = !this.isOperator || status?.phase !== "flying" || old;
    this.stop.disabled = !this.isOperator || !runs || old;
    this.select.disabled = runs;
    for (const [, input] of this.fields) input.disabled = runs;
    this.bar.style.width = runs && status.planned ? `${Math.min(100, (100 * status.elapsed) / status.planned)}%` : "0";
    set(this.step, runs ? `${status.manual ? BY_HAND : status.step}${inTheAir && time ? ` · ${time}` : ""}` : this.known ? HELP : "");
    const key = JSON.stringify([status?.phase, status?.run_id, status?.reason, status?.reports, runs]);
    if (key !== this.drawn) { this.drawn = key; this.showResult(status, runs); }
  }

  showResult(status, runs) {
    if (!status || runs || status.phase === "idle") { this.result.replaceChildren(); return; }
    const judged = status.metrics.length > 0, run = encodeURIComponent(status.run_id);
    const links = [
      ...(judged ? [element("a", { href: `/report/${run}`, target: "_blank" }, "Report")] : []),
      ...(status.run_id ? [element("a", { href: `/api/runs/${run}/download`, download: "" }, "Run")] : []),
    ];
    this.result.replaceChildren(
      element("p", { className: `verdict ${status.phase}` }, `${words(status.name)}: ${status.phase}`, element("span", { className: "links" }, ...links)),
      ...(status.reason ? [element("p", { className: "reason" }, status.reason)] : []),
      ...(judged ? [figures(status.metrics)] : []));
  }
}

const UNITS = [["_m_s", "m/s"], ["_deg", "°"], ["_m", "m"], ["_s", "s"]];

// A table of metrics [{name, value, limit}], those above their limit marked; units end their names.
export function figures(metrics) {
  const number = (value) => (value === null || value === undefined ? "" : String(Number(Number(value).toPrecision(3))));
  return element("table", { className: "figures" }, element("thead", {}, element("tr", {}, ...["", "value", "at most", ""].map((text) => element("th", {}, text)))),
    element("tbody", {}, ...metrics.map(({ name, value, limit }) => {
      const above = limit !== null && limit !== undefined && !(value <= limit);
      const [end, unit] = UNITS.find(([ending]) => name.endsWith(ending)) ?? ["", ""];
      return element("tr", { className: above ? "above" : "" }, ...[words(name.slice(0, name.length - end.length)), number(value), number(limit), unit].map((text) => element("td", {}, text)));
    })));
}

function set(place, text) { if (place.textContent !== text) place.textContent = text; }
