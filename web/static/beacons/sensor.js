// The emulated sensor: its parameters as rows with sliders, as in the Gains tab, in four groups.

import { element } from "../core/dom.js";
import { fillWhenOpen, GainRow } from "../gains/row.js";

const PREFIX = "station.bearings.";
const GROUPS = [
  ["Frames and noise", ["rate", "sigma", "distribution", "degrees_of_freedom", "seed"]],
  ["Latency", ["delay", "jitter", "stamp_error"]],
  ["What is not seen", ["drop_out", "swap", "lost", "occlusion", "occlusion_spell"]],
  [
    "Optics and mounting",
    [
      "field_of_view",
      "range_min",
      "range_max",
      "mount_roll",
      "mount_pitch",
      "mount_yaw",
      "bias_x",
      "bias_y",
      "bias_z",
      "beacon_bias",
    ],
  ],
];
const ELSEWHERE = ["layout"];

export class Sensor {
  counts;

  constructor(place, { gains, isOperator }) {
    this.gains = gains;
    this.isOperator = isOperator;
    this.rows = new Map();
    this.groups = element("div", { className: "sensor" });
    place.append(element("h2", {}, "Sensor"), this.groups);
  }

  parameters() {
    const names = [...this.gains.rows.keys()].filter(
      (name) => name.startsWith(PREFIX) && !ELSEWHERE.includes(name.slice(PREFIX.length)),
    );
    if (names.join() !== [...this.rows.keys()].join()) this.build(names);
    for (const [name, row] of this.rows) row.confirm(this.gains.value(name));
  }

  confirm(name, value) {
    this.rows.get(name)?.confirm(value);
  }

  build(names) {
    const open = new Set(
      [...this.groups.querySelectorAll("details[open]")].map((details) => details.dataset.group),
    );
    this.rows = new Map(
      names.map((name) => {
        const description = { ...this.gains.rows.get(name).description, value: this.gains.value(name) };
        return [
          name,
          new GainRow(
            description,
            this.isOperator,
            (value) => this.gains.change(name, value),
            () => this.count(),
          ),
        ];
      }),
    );
    const known = GROUPS.flatMap(([, members]) => members),
      others = names.map((name) => name.slice(PREFIX.length)).filter((name) => !known.includes(name));
    this.counts = new Map();
    this.groups.replaceChildren(
      ...[...GROUPS, ["Other", others]].map(([title, members]) => {
        const rows = members.map((name) => this.rows.get(PREFIX + name)).filter(Boolean),
          count = element("span", { className: "count" });
        const details = element(
          "details",
          { hidden: !rows.length, open: open.has(title) },
          element("summary", {}, element("b", {}, title), count),
          ...rows.map((row) => row.place),
        );
        details.dataset.group = title;
        fillWhenOpen(details, rows);
        this.counts.set(count, rows);
        return details;
      }),
    );
    this.count();
  }

  count() {
    for (const [count, rows] of this.counts ?? []) {
      const modified = rows.filter((row) => row.isModified);
      count.textContent = modified.length ? `${modified.length} modified` : "";
    }
  }
}
