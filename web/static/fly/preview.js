// A trajectory before it is flown: drawn in the 3D view when its row on the Fly tab is chosen, with what it
// asks of the vehicle.

import { request } from "../core/api.js";
import { setIfChanged, setText } from "../core/dom.js";
import { duration, fixed, reasonOf } from "../core/format.js";

const PAUSE = 400; // ms of typing or pointing
const HINT = "Point at a trajectory, or change a field, to see its path in the 3D view.";

export class Preview {
  // valuesOf(behavior): {values, problem} of its fields.
  constructor(note, valuesOf) {
    this.note = note;
    this.valuesOf = valuesOf;
    setText(note, HINT);
  }

  offer(row, behavior) {
    const choose = () => {
      clearTimeout(this.timer);
      this.timer = setTimeout(() => {
        this.behavior = behavior;
        this.ask();
      }, PAUSE);
    };
    for (const type of ["pointerenter", "focusin", "input"]) row.addEventListener(type, choose);
    row.addEventListener("pointerleave", () => clearTimeout(this.timer));
  }

  // What the newest question found.
  async ask() {
    const { label } = this.behavior,
      { values, problem } = this.valuesOf(this.behavior),
      asked = (this.asked = Symbol(label));
    if (problem) {
      this.say(problem, "warn");
      return;
    }
    if (values.trajectory === "file") {
      this.say(`${label}: the vehicle checks its own files when they are started.`);
      return;
    }
    if ("waypoints" in values && !values.waypoints) {
      this.say(`${label}: enter points to see the path.`);
      return;
    }
    const found = await request("POST", "/api/trajectories/preview", { arguments: values }).catch(
      (error) => ({ refusal: error.message }),
    );
    if (asked !== this.asked) return;
    const { duration: lasts, speed, refusal } = found;
    this.say(
      refusal
        ? `${label}: ${reasonOf(refusal)}`
        : `${label}: ${duration(lasts)}, up to ${fixed(speed, 2)} m/s; the vehicle can fly it.`,
      refusal ? "warn" : "good",
    );
  }

  say(text, tone = "") {
    setText(this.note, text);
    setIfChanged(this.note, "className", tone);
  }
}
