// The tracking system: what comes from it, how old it is at the vehicle, and its parameters.

import { CameraPicture } from "../camera/picture.js";
import { element, showNote } from "../core/dom.js";
import { fixed, NONE } from "../core/format.js";
import { Fields } from "./fields.js";

const PERIOD = 500; // ms
const CAMERAS = 4; // at most, of one tracker
const LABELS = [
  ["rate", "Rate"],
  ["delay", "Delay"],
  ["drop_out", "Share lost"],
  ["position_noise", "Position noise"],
  ["attitude_noise", "Attitude noise"],
];

export class TrackerSection {
  constructor(place, events, parameters) {
    this.events = events;
    this.parameters = parameters;
    this.facts = element("dl", { className: "facts" });
    this.problem = element("p", { className: "reason", hidden: true });
    this.bars = element("div", { className: "latencies", role: "img" });
    this.latencies = element(
      "figure",
      { hidden: true },
      this.bars,
      element(
        "figcaption",
        {},
        "latency of the frames of the last seconds above the smallest, in bins of 1 ms; the last bar " +
          "has all longer ones",
      ),
    );
    const fields = element("div");
    this.simulated = element(
      "div",
      {},
      element(
        "p",
        { className: "hint" },
        "Poses of the simulated tracking system, made by the station from the simulator's truth; " +
          "these settings are the errors of its measurements.",
      ),
      fields,
    );
    const cameras = Array.from({ length: CAMERAS }, () => element("div", { hidden: true }));
    place.append(
      this.facts,
      this.problem,
      element("div", { className: "pictures" }, ...cameras),
      this.latencies,
      this.simulated,
    );
    cameras.forEach(
      (one, k) => new CameraPicture(one, events, "tracker", `the tracker's camera ${k + 1}`, k),
    );
    new Fields(
      fields,
      parameters,
      LABELS.map(([name, label]) => [`station.tracker.${name}`, label]),
    );
    this.timer = setInterval(() => this.draw(), PERIOD);
    this.draw();
  }

  draw() {
    const { station, preflight, tracker } = this.events.summary,
      old = !(this.events.age("station_status") < 1.5);
    const rate = old ? undefined : station?.tracker_rate;
    const pose = preflight?.armed ? undefined : preflight?.checks.find(({ name }) => name === "measurements");
    const rows = [
      ...(tracker ? this.system(tracker) : this.simulation(old, rate)),
      ["Poses sent", rate === undefined ? NONE : `${fixed(rate, 0)} Hz`],
      ["At the vehicle", pose ? `${pose.found} (${pose.wanted})` : NONE],
    ];
    const silent = tracker && !(this.events.age("tracker_status") < 1.5);
    const problem = silent
      ? "No data from the tracker process: start quadlab tracker, or check its output."
      : (tracker?.problem ?? "");
    const key = JSON.stringify([rows, problem, tracker?.latency_counts]);
    if (key === this.drawn) return;
    this.drawn = key;
    this.facts.replaceChildren(
      ...rows.flatMap(([label, text]) => [element("dt", {}, label), element("dd", {}, text)]),
    );
    showNote(this.problem, problem);
    this.simulated.hidden = Boolean(tracker);
    this.drawLatencies(tracker?.latency_counts ?? []);
  }

  simulation(old, rate) {
    const nominal = this.parameters.value("station.tracker.rate"),
      lost = this.parameters.value("station.tracker.drop_out");
    const missing =
      rate === undefined || !nominal
        ? NONE
        : `${fixed(100 * Math.max(0, 1 - rate / nominal), 0)} % of ${fixed(nominal, 0)} Hz`;
    return [
      [
        "Source",
        old ? NONE : rate > 0 ? "simulated tracker" : "none: no data from a simulator or tracking system",
      ],
      ["Missing", `${missing}${lost ? ` (${fixed(100 * lost, 0)} % are lost on purpose)` : ""}`],
    ];
  }

  system(tracker) {
    const stamped = tracker.latency_counts.some((count) => count > 0);
    return [
      ["Source", tracker.system],
      ["This vehicle's body", `${tracker.body}${tracker.withheld ? " (its poses are withheld)" : ""}`],
      ["Frames", `${fixed(tracker.frame_rate, 0)} Hz`],
      [
        "Bodies seen",
        tracker.seen.map((name, k) => `${name} ${fixed(tracker.rates[k], 0)} Hz`).join(", ") || "none",
      ],
      [
        "Latency",
        stamped
          ? `median ${fixed(1e3 * tracker.latency, 1)} ms, 99 % below ${fixed(1e3 * tracker.latency_p99, 1)} ms`
          : "not known: no stamps of the system",
      ],
      ["Drift of its clock", stamped ? `${fixed(1e6 * tracker.clock_drift, 0)} µs/s` : NONE],
      [
        "Since the start",
        `${tracker.gaps} gaps, ${tracker.jumps} jumps, clock set ${tracker.clock_jumps} times`,
      ],
    ];
  }

  drawLatencies(counts) {
    const most = Math.max(0, ...counts);
    this.latencies.hidden = !most;
    this.bars.ariaLabel = counts.map((count, k) => `${k} ms: ${count}`).join(", ");
    this.bars.replaceChildren(
      ...counts.map((count) => {
        const bar = element("i");
        bar.style.height = `${(100 * count) / Math.max(1, most)}%`;
        return bar;
      }),
    );
  }
}
