// The tracking system: what comes from it, how old it is at the vehicle, and its parameters.

import { element } from "../core/dom.js";
import { fixed, NONE } from "../core/format.js";
import { Fields } from "./parameters.js";

const PERIOD = 500; // ms
const LABELS = [["rate", "Rate"], ["delay", "Delay"], ["drop_out", "Share lost"], ["position_noise", "Position noise"], ["attitude_noise", "Attitude noise"]];

export class TrackerSection {
  constructor(place, events, parameters) {
    this.events = events;
    this.parameters = parameters;
    this.facts = element("dl", { className: "facts" });
    const fields = element("div");
    place.append(element("p", { className: "hint" }, "Poses of the simulated tracking system, made by the station from the simulator's truth; what is set here is what its measurements suffer."), this.facts, fields);
    new Fields(fields, parameters, LABELS.map(([name, label]) => [`station.tracker.${name}`, label]));
    this.timer = setInterval(() => this.draw(), PERIOD);
    this.draw();
  }

  draw() {
    const { station, preflight } = this.events.summary, old = !(this.events.age("station_status") < 1.5);
    const nominal = this.parameters.value("station.tracker.rate"), lost = this.parameters.value("station.tracker.drop_out");
    const rate = old ? undefined : station?.tracker_rate;
    const missing = rate === undefined || !nominal ? NONE : `${fixed(100 * Math.max(0, 1 - rate / nominal), 0)} % of ${fixed(nominal, 0)} Hz`;
    const pose = preflight?.armed ? undefined : preflight?.checks.find(({ name }) => name === "measurements");
    const rows = [
      ["Source", old ? NONE : rate > 0 ? `simulated tracker${this.parameters.value("station.tracker.positions_only") ? " of a single marker: positions alone" : ""}` : "none: no data from a simulator or tracking system"],
      ["Rate", rate === undefined ? NONE : `${fixed(rate, 0)} Hz`],
      ["Missing", `${missing}${lost ? ` (${fixed(100 * lost, 0)} % are lost on purpose)` : ""}`],
      ["At the vehicle", pose ? `${pose.found} (${pose.wanted})` : NONE],
    ];
    const key = JSON.stringify(rows);
    if (key === this.drawn) return;
    this.drawn = key;
    this.facts.replaceChildren(...rows.flatMap(([label, text]) => [element("dt", {}, label), element("dd", {}, text)]));
  }
}
