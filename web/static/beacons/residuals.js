// Residuals: the angle between the newest bearing to each beacon and the one the chosen estimate
// expects, drawn against three standard deviations of the sensor.

import { wordsOf } from "./estimate_names.js";
import { element, setText } from "../core/dom.js";
import { fixed, NONE } from "../core/format.js";

const FULL = 5 / 3; // a whole bar, in units of 3σ: where a fall-back counts a bearing as wrong

export class Residuals {
  constructor(place) {
    this.of = element("span");
    this.limit = element("span", {
      className: "limit",
      title:
        "three standard deviations of the sensor's noise on one axis; 1.1 % of good bearings lie outside",
    });
    this.list = element("div", { className: "residuals" });
    this.rows = new Map();
    this.note = element("p", { className: "offset", role: "status", hidden: true });
    this.note.dataset.topic = "status";
    place.append(element("h2", {}, "Residuals", this.of, this.limit), this.list, this.note);
  }

  // ids: of the confirmed layout
  beacons(ids) {
    this.rows.clear();
    for (const id of ids) {
      const fill = element("i"),
        value = element("output", {}, NONE);
      const line = element(
        "div",
        { className: "residual stale" },
        element("span", { title: `beacon ${id}` }, String(id)),
        element("div", { className: "track" }, fill, element("b")),
        value,
      );
      line.dataset.id = id;
      this.rows.set(id, { line, fill, value });
    }
    this.list.replaceChildren(...[...this.rows.values()].map(({ line }) => line));
  }

  // What the vehicle finds of the mean residuals: the beacon whose bearings are off, by its status.
  mark(status, isOld) {
    const isOff = Boolean(status?.flags?.includes("beacon_off")) && !isOld,
      id = status?.suspect_beacon;
    for (const [one, { line }] of this.rows) line.classList.toggle("off", isOff && Number(one) === id);
    this.note.hidden = !isOff;
    if (!isOff) return;
    const offset = `${fixed((status.suspect_offset * 180) / Math.PI, 1)}° off on average`;
    setText(
      this.note,
      id < 0
        ? `One beacon is ${offset}; which one cannot be determined without the tracker or a fifth beacon.`
        : `Beacon ${id} is ${offset}${status.suspect_left_out ? ", left out" : ""}.`,
    );
  }

  // one: an estimator's name and residuals, or undefined; sigma in degrees
  show(one, sigma, isStale) {
    setText(
      this.of,
      one ? ` of ${one.name === "vehicle" ? "the vehicle's estimate" : wordsOf(one.name)}` : "",
    );
    setText(this.limit, sigma ? `3σ = ${fixed(3 * sigma, 2)}°` : "");
    const seen = new Map(one?.residuals ?? []);
    for (const [id, { line, fill, value }] of this.rows) {
      const angle = seen.get(id) ?? null,
        isOld = isStale || angle === null;
      line.classList.toggle("stale", isOld);
      line.title = isStale
        ? "no residuals received"
        : angle === null
          ? "not in the newest frame of bearings"
          : "";
      if (angle === null || !sigma) {
        line.classList.remove("beyond");
        continue;
      } // the last value stays, grey
      const share = angle / (3 * sigma);
      fill.style.width = `${(100 * Math.min(1, share / FULL)).toFixed(1)}%`;
      line.classList.toggle("beyond", share > 1 && !isOld);
      setText(value, `${fixed(angle, 2)}°`);
    }
  }
}
