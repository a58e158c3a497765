// The fleet's table: one row a vehicle. Grey is old; what needs somebody has a sign and a word.

import { landed } from "./land.js";
import { element, setText } from "../core/dom.js";
import { duration, fixed, NONE, seconds, words } from "../core/format.js";
import { stateOf } from "../core/vehicle_strip.js";

const COLUMNS = [
  ["vehicle", ""],
  ["state", ""],
  ["mode", ""],
  ["behavior", ""],
  ["link", "state of the link and age of the newest telemetry at the station"],
  ["battery", ""],
  ["height", "above the floor, m"],
  ["control", "who commands"],
  ["recording", ""],
  ["alarms", ""],
  ["emergency", "the newest emergency of this vehicle"],
  ["", ""],
];
const OLD = 1; // s

export class FleetTable extends EventTarget {
  constructor(place, names) {
    super();
    this.rows = new Map(names.map((name) => [name, this.row(name)]));
    const heads = COLUMNS.map(([name, title]) => element("th", { scope: "col", title }, name));
    place.append(
      element(
        "table",
        {},
        element("thead", {}, element("tr", {}, ...heads)),
        element("tbody", {}, ...[...this.rows.values()].map(({ row }) => row)),
      ),
    );
  }

  row(name) {
    const cells = Object.fromEntries(
      [
        "state",
        "mode",
        "behavior",
        "link",
        "battery",
        "height",
        "control",
        "recording",
        "alarms",
        "emergency",
      ].map((key) => [key, element("td", { className: key })]),
    );
    const open = element("a", { href: `/v/${name}/` }, name);
    const kill = element(
      "a",
      { href: `/v/${name}/kill`, title: `the emergency page of ${name}: land and cut` },
      "Emergency page",
    );
    const row = element(
      "tr",
      {},
      element("th", { scope: "row" }, open),
      ...Object.values(cells),
      element("td", {}, kill),
    );
    const point = (detail) => this.dispatchEvent(new CustomEvent("point", { detail }));
    for (const [type, detail] of [
      ["pointerenter", name],
      ["pointerleave", null],
      ["focusin", name],
      ["focusout", null],
    ])
      row.addEventListener(type, () => point(detail));
    return { row, cells };
  }

  show(vehicles) {
    for (const vehicle of vehicles) {
      const found = this.rows.get(vehicle.name);
      if (found) this.fill(found, vehicle);
    }
  }

  fill({ row, cells }, vehicle) {
    const { word, tone } = stateOf(vehicle),
      { link } = vehicle,
      isOld = vehicle.age === null || vehicle.age > OLD;
    row.classList.toggle("stale", isOld);
    put(cells.state, isOld && vehicle.age !== null ? `${word}, ${seconds(vehicle.age)}` : word, tone);
    put(cells.mode, words(vehicle.mode));
    put(cells.behavior, words(vehicle.behavior));
    put(
      cells.link,
      link ? `${link.state} · ${seconds(link.age)}` : NONE,
      link && link.state !== "good" ? "warn" : "",
    );
    put(
      cells.battery,
      vehicle.battery === null ? NONE : `${fixed(vehicle.battery, 1)} V`,
      vehicle.flags.some((flag) => /battery/i.test(flag)) ? "warn" : "",
    );
    put(cells.height, vehicle.height === null ? NONE : `${fixed(vehicle.height, 2)} m`);
    put(cells.control, vehicle.holder || (vehicle.holder === null ? NONE : "none"));
    put(cells.recording, vehicle.recording === null ? "off" : `● ${duration(vehicle.recording)}`);
    put(
      cells.alarms,
      vehicle.alarms.length ? `⚠ ${vehicle.alarms.length}` : "none",
      vehicle.alarms.length ? "warn" : "",
    );
    cells.alarms.title = vehicle.alarms.join("\n");
    const { text, tone: outcome } = landed(vehicle.emergency);
    put(cells.emergency, text, outcome);
    cells.emergency.title = text;
  }
}

function put(cell, text, tone = "") {
  setText(cell, text);
  if ((cell.dataset.tone ?? "") !== tone) cell.dataset.tone = tone;
}
