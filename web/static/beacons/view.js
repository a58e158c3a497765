// How the 3D view shows beacons and estimates: one choice for all pages.

import { request } from "../core/api.js";
import { wordsOf } from "./estimate_names.js";
import { attempt, element, optionsOf } from "../core/dom.js";
import { exact } from "../core/format.js";

const SWITCHES = [
  ["rays", "Rays", "lines from the vehicle to the beacons it sees"],
  ["cones", "3σ cones", "three standard deviations of the sensor about each ray"],
  ["map", "Bound map", "the least rms position error one frame allows, over a slice of the flight volume"],
  ["drag", "Drag beacons", "handles in the 3D view; station and vehicle check each step"],
];

export class BeaconView {
  // chosen(name): another estimate is the ghost
  constructor(place, { isOperator, chosen }) {
    this.isOperator = isOperator;
    this.chosen = chosen;
    this.view = {};
    this.boxes = new Map(
      SWITCHES.map(([key, , title]) => {
        const box = element("input", { type: "checkbox", disabled: !isOperator, title });
        box.addEventListener("change", () => {
          const wanted = box.checked;
          box.checked = !wanted;
          this.change({ [key]: wanted });
        });
        box.dataset.view = key;
        return [key, box];
      }),
    );
    this.height = element("input", {
      type: "number",
      min: 0,
      max: 20,
      step: 0.1,
      disabled: !isOperator,
      ariaLabel: "height of the bound map",
    });
    this.height.addEventListener("change", () => {
      const height = this.height.valueAsNumber;
      this.draw();
      if (Number.isFinite(height)) this.change({ map_height: height });
    });
    this.ghost = element("select", { disabled: !isOperator, ariaLabel: "estimate shown as a ghost" });
    this.ghost.addEventListener("change", () => {
      const wanted = this.ghost.value;
      this.draw();
      this.change({ estimate: wanted });
    });
    this.legend = element("div", { className: "scale", hidden: true });
    this.reason = element("div", { className: "reason", hidden: true });
    const label = (key, ...more) => {
      const box = this.boxes.get(key),
        text = SWITCHES.find(([name]) => name === key)?.[1];
      return element("label", { title: box?.title }, box ?? "", text ?? "", ...more);
    };
    place.append(
      element("h2", {}, "3D view", element("span", { className: "limit" }, "shared by all pages")),
      element(
        "div",
        { className: "boxes view" },
        label("rays"),
        label("cones"),
        label("drag"),
        label("map"),
        element("label", { className: "height" }, "at", this.height, "m"),
        element("label", { className: "ghost" }, "Ghost", this.ghost),
      ),
      this.legend,
      this.reason,
    );
    this.estimates(["vehicle"]);
  }

  estimates(names) {
    const all = [...new Set(["none", "one frame", ...names, this.view.estimate].filter(Boolean))];
    if (all.join() === [...this.ghost.options].map((option) => option.value).join()) return;
    this.ghost.replaceChildren(...optionsOf(all.map((name) => [name, wordsOf(name)])));
    this.draw();
  }

  show({ view, legend }) {
    const isNews = this.view.estimate !== view.estimate;
    this.view = view;
    this.estimates(
      [...this.ghost.options]
        .map((option) => option.value)
        .filter((name) => !["none", "one frame"].includes(name)),
    );
    this.scale(view.map ? legend : null);
    this.draw();
    if (isNews) this.chosen(view.estimate);
  }

  // of the bound map: ends in m, colours from low to high on a logarithmic scale; null without one
  scale(legend) {
    this.legend.hidden = !legend;
    if (!legend) return;
    const bar = element("i"),
      unit = (metres) =>
        metres < 0.995
          ? `${exact(Number((1e3 * metres).toPrecision(2)))} mm`
          : `${exact(Number(metres.toPrecision(2)))} m`;
    bar.style.background = `linear-gradient(to right, ${legend.colors.join(", ")})`;
    const middle = Math.sqrt(legend.low * legend.high);
    this.legend.replaceChildren(
      bar,
      ...[legend.low, middle, legend.high].map((value) => element("span", {}, unit(value))),
      element("small", {}, "least rms position error of one frame; logarithmic"),
    );
  }

  async change(part) {
    // What is shown comes as an event, in its order with the map's: the answer may be older.
    if (!(await attempt(this.reason, () => request("PUT", "/api/beacons/view", part)))) this.draw();
  }

  draw() {
    for (const [key, box] of this.boxes) box.checked = this.view[key] === true;
    if (document.activeElement !== this.height)
      this.height.value = this.view.map_height === undefined ? "" : exact(this.view.map_height);
    this.ghost.value = this.view.estimate ?? "none";
  }
}
