// Where the beacons stand: the same table as in the Beacons tab.

import { get } from "../core/api.js";
import { Layout } from "../beacons/layout.js";
import { element } from "../core/dom.js";

const LAYOUT = "station.bearings.layout";

export class BeaconSection {
  constructor(place, events, isOperator) {
    this.layout = new Layout(place, isOperator);
    place.querySelector("h2").textContent = "Beacons";
    place.append(
      element(
        "p",
        { className: "hint" },
        "View, drag and check them on the ",
        element("a", { href: "/#tab=beacons" }, "Beacons tab"),
        ".",
      ),
    );
    events.on("hello", () => this.load());
    events.on("parameters", () => this.load());
    events.on("parameter", ({ name }) => {
      if (name === LAYOUT) this.load();
    });
  }

  async load() {
    const answer = await get("/api/beacons").catch(() => null);
    if (!answer?.beacons) return; // not read yet: `parameters` follows
    this.layout.show(answer.beacons, answer.presets, answer.layout in answer.presets ? answer.layout : "");
  }
}
