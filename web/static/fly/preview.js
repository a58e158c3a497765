// A trajectory before it is flown: drawn in the 3D view when its row on the Fly tab is chosen, with what it
// asks of the vehicle.

import { request } from "../core/api.js";
import { setIfChanged, setText } from "../core/dom.js";
import { duration, fixed, reasonOf } from "../core/format.js";

const PAUSE = 400; // ms of typing or pointing
const KEPT = 20_000; // ms: the vehicle may be elsewhere by then
const HINT = "Point at a trajectory, or change a field, to see its path in the 3D view.";

export class Preview {
  // valuesOf(behavior): {values, problem} of its fields.
  constructor(note, valuesOf) {
    this.note = note; this.valuesOf = valuesOf;
    this.shown = { arguments: "", at: -Infinity };
    setText(note, HINT);
  }

  offer(row, behavior) {
    const choose = () => {
      clearTimeout(this.timer);
      this.timer = setTimeout(() => { this.behavior = behavior; this.ask(); }, PAUSE);
    };
    for (const type of ["pointerenter", "focusin", "input"]) row.addEventListener(type, choose);
    row.addEventListener("pointerleave", () => clearTimeout(this.timer));
  }

  // One question at a time, the newest last.
  async ask() {
    const { label } = this.behavior, { values, problem } = this.valuesOf(this.behavior), asked = JSON.stringify(values);
    if (problem) { this.say(problem, "warn"); return; }
    if (values.trajectory === "file") { this.say(`${label}: the vehicle checks its own files when they are started.`); return; }
    if ("waypoints" in values && !values.waypoints) { this.say(`${label}: enter points to see the path.`); return; }
    if (this.isAsking || asked === this.shown.arguments && performance.now() - this.shown.at < KEPT) return;
    this.isAsking = true;
    try {
      const { duration: lasts, speed, refusal } = await request("POST", "/api/trajectories/preview", { arguments: values });
      this.shown = { arguments: asked, at: performance.now() };
      this.say(refusal ? `${label}: ${reasonOf(refusal)}` : `${label}: ${duration(lasts)}, up to ${fixed(speed, 2)} m/s; the vehicle can fly it.`, refusal ? "warn" : "good");
    } catch (error) {
      this.shown.arguments = "";
      this.say(`${label}: ${error.message}`, "warn");
    } finally { this.isAsking = false; }
    const newest = this.valuesOf(this.behavior);
    if (!newest.problem && JSON.stringify(newest.values) !== asked) this.ask();
  }

  say(text, tone = "") {
    setText(this.note, text);
    setIfChanged(this.note, "className", tone);
  }
}
