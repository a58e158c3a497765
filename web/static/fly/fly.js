// The Fly tab: behaviors with their arguments, recording, and the answer to the last command.

import { command } from "../core/api.js";
import { CommandNotice } from "./command_notice.js";
import { Preview } from "./preview.js";
import { flightButton } from "../core/flight_button.js";
import { $, element, setText } from "../core/dom.js";
import { bytes } from "../core/format.js";
import { icon } from "../icons/icons.js";

// An argument as its field shows it: an angle in degrees; `scale` leads back.
function asShown(described) {
  const { unit, minimum, maximum } = described;
  if (minimum === null || maximum === null) return { ...described, range: "", scale: 1 };
  const inDegrees = unit === "rad",
    scale = inDegrees ? Math.PI / 180 : 1;
  const [low, high] = inDegrees
    ? [Math.ceil(minimum / scale), Math.floor(maximum / scale)]
    : [minimum, maximum];
  const shown = inDegrees ? "°" : unit;
  return {
    ...described,
    unit: shown,
    minimum: low,
    maximum: high,
    range: `${low} to ${high}${shown ? ` ${shown}` : ""}`,
    scale,
  };
}

export class Fly {
  // behaviors: of /api/behaviors; the vehicle knows and checks them all.
  constructor(events, behaviors, isOperator) {
    this.events = events;
    this.behaviors = behaviors;
    this.forms = new Map();
    this.started = null; // {name, values}: the last behavior this page started
    this.isOperator = isOperator;
    this.notice = new CommandNotice($("answer"), events);
    this.preview = new Preview($("plan"), (behavior) => this.valuesOf(behavior));
    const plain = element("div", { className: "plain" });
    for (const behavior of behaviors) {
      if (behavior.arguments.length) $("behaviors").append(this.row(behavior));
      else plain.append(this.button(behavior));
    }
    $("behaviors").append(plain);
    $("record").addEventListener("click", () => this.record());
    $("record").disabled = !isOperator;
    events.on("summary", () => this.showRecording());
  }

  button(behavior) {
    const { label, title, arguments: fields } = behavior;
    if (!fields.length) this.forms.set(behavior, []);
    return flightButton(
      element(
        "button",
        { title, disabled: !this.isOperator, onclick: () => this.start(behavior) },
        icon(behavior.fixed?.trajectory ?? behavior.name),
        label,
      ),
    );
  }

  row(behavior) {
    const onkeydown = (event) => {
      if (event.key === "Enter") this.start(behavior);
    };
    const inputs = behavior.arguments.map((described) => {
      const field = asShown(described),
        title = `${described.description}${field.range ? `; ${field.range}` : ""}`;
      return [
        field,
        element(
          "input",
          field.type === "bool"
            ? { type: "checkbox", checked: field.default, title, onkeydown }
            : field.type === "str"
              ? { type: "text", placeholder: field.placeholder ?? "", title, onkeydown }
              : {
                  type: "number",
                  value: field.default,
                  placeholder: "auto",
                  min: field.minimum,
                  max: field.maximum,
                  step: field.type === "int" ? 1 : "any",
                  title,
                  onkeydown,
                },
        ),
      ];
    });
    this.forms.set(behavior, inputs);
    const shown = inputs.map(([field, input]) =>
      element(
        "label",
        { className: field.type === "str" ? "argument text" : "argument" },
        field.label ?? field.name,
        input,
        ...(field.unit ? [field.unit] : []),
      ),
    );
    const row = element(
      "div",
      { className: "behavior" },
      this.button(behavior),
      element("div", { className: "arguments" }, ...shown),
    );
    if (this.isOperator && behavior.name === "follow_trajectory") this.preview.offer(row, behavior);
    return row;
  }

  // which: a behavior of the list, or the name of one.
  start(which) {
    const behavior = typeof which === "string" ? this.behaviors.find(({ name }) => name === which) : which;
    const { name, label } = behavior,
      { values, problem } = this.valuesOf(behavior);
    if (problem) {
      this.refuse(problem);
      return;
    }
    this.attempt(
      async () => {
        await command("start_behavior", { name, arguments: values });
        this.started = { name, values };
      },
      label,
      (status) => status.behavior?.toLowerCase() === name,
    );
  }

  // {values, problem} of a behavior's fields.
  valuesOf(behavior) {
    const values = { ...behavior.fixed };
    for (const [field, input] of this.forms.get(behavior)) {
      if (field.type === "bool") {
        values[field.name] = input.checked;
        continue;
      }
      if (input.value === "") continue; // the vehicle's own default
      if (field.type === "str") {
        values[field.name] = input.value.trim();
        continue;
      }
      const wrong = !input.checkValidity() || !Number.isFinite(input.valueAsNumber);
      if (wrong)
        return {
          values,
          problem: `${behavior.label}: ${field.label ?? field.name} = ${input.value || "?"}; allowed ${field.range}`,
        };
      values[field.name] = input.valueAsNumber * field.scale;
    }
    return { values, problem: "" };
  }

  // Runs a command and says what became of it; see static/fly/command_notice.js.
  /** @param {((status: any) => boolean) | null} shows */
  attempt(act, label = "", shows = null) {
    return this.notice.run(label, act, shows);
  }
  say(content) {
    this.notice.say(content);
  }
  refuse(content) {
    this.notice.refuse(content);
  }

  record() {
    const start = !this.events.summary.station?.recording;
    this.attempt(() => command("record", { start }), start ? "record" : "stop recording");
  }

  showRecording() {
    const station = this.events.summary.station;
    $("record").textContent = station?.recording ? "Stop" : "Record";
    const note = !station
      ? ""
      : station.recording
        ? station.run_id
        : `${bytes(station.free_bytes)} free; starts on arming`;
    setText($("record-note"), note);
  }
}
