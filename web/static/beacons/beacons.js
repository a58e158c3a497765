// The Beacons tab: what flies on bearings, how well, and where the beacons stand.
// While the tab is hidden it draws nothing.

import { get } from "../core/api.js";
import { CameraPicture } from "../camera/picture.js";
import { Layout } from "./layout.js";
import { Residuals } from "./residuals.js";
import { Sensor } from "./sensor.js";
import { Session } from "./session.js";
import { Survey } from "./survey.js";
import { BeaconView } from "./view.js";
import { $, element } from "../core/dom.js";

const LAYOUT = "station.bearings.layout";
const PERIOD = 200; // ms
const LOCKED = "Beacons cannot be moved while the vehicle flies on them. Press Back to tracker first.";

// Events: "open" and "close" of the tab, and "draw".
export class Beacons extends EventTarget {
  constructor({ events, gains, isOperator, ages }) {
    super();
    const shared = { events, gains, isOperator, ages };
    this.ages = ages;
    this.events = events;
    this.gains = gains;
    this.isOperator = isOperator;
    this.presets = {};
    this.chosen = "vehicle"; // whose residuals are shown
    this.session = new Session($("beacons-session"), shared);
    $("beacons-camera").append(element("h2", {}, "Camera on board"));
    new CameraPicture($("beacons-camera"), events, "camera", "the camera on board");
    this.residuals = new Residuals($("beacons-residuals"));
    this.view = new BeaconView($("beacons-view"), { isOperator, chosen: (name) => this.follow(name) });
    this.layout = new Layout($("beacons-layout"), isOperator);
    this.survey = new Survey($("beacons-survey"), isOperator);
    this.sensor = new Sensor($("beacons-sensor"), shared);
    document.addEventListener("tab", ({ detail }) => (detail === "beacons" ? this.show() : this.hide()));
    gains.addEventListener("read", () => this.isOpen && this.parameters());
    events.on("parameter", ({ name, value }) => this.isOpen && this.parameter(name, value));
    events.on("beacon_view", (view) => this.isOpen && this.view.show(view));
    events.on("hello", () => this.isOpen && this.load());
  }

  show() {
    if (this.isOpen) return;
    this.isOpen = true;
    this.timer = setInterval(() => this.draw(), PERIOD);
    this.load();
    this.dispatchEvent(new Event("open"));
  }

  hide() {
    if (!this.isOpen) return;
    this.isOpen = false;
    this.survey.hide();
    clearInterval(this.timer);
    this.dispatchEvent(new Event("close"));
  }

  async load() {
    const read = await get("/api/beacons").catch(() => null);
    if (read === null) return; // web is away; the hello of its return loads again
    this.survey.load();
    this.presets = read.presets;
    this.view.show(read);
    this.session.load(read.gains);
    this.parameters();
  }

  // All of them may be new.
  parameters() {
    this.session.parameters();
    this.sensor.parameters();
    this.beacons();
  }

  parameter(name, value) {
    if (name === LAYOUT) this.beacons();
    else if (name.startsWith("station.bearings.")) this.sensor.confirm(name, value);
    else if (name.startsWith("estimation.")) this.session.draw();
  }

  beacons() {
    const text = this.gains.value(LAYOUT);
    if (text === undefined) return;
    const rows = rowsOf(text, this.presets),
      ids = rows.map(([id]) => id).join();
    this.layout.show(rows, this.presets, text in this.presets ? text : "");
    if (ids !== this.ids) this.residuals.beacons(rows.map(([id]) => id));
    this.ids = ids;
  }

  // The ghost is everybody's, and only operators choose it; whose residuals these are is one's own.
  choose(name) {
    this.chosen = name;
    if (this.isOperator) this.view.change({ estimate: name });
    this.draw();
  }

  follow(name) {
    if (name !== "none" && name !== "one frame") this.chosen = name;
    this.draw();
  }

  draw() {
    if (document.hidden) return;
    this.session.draw();
    const locked = this.session.isFlown ? LOCKED : "";
    this.layout.lock(locked);
    this.survey.lock(locked);
    this.residuals.mark(this.events.summary.status, this.ages.isOld("status"));
    this.dispatchEvent(new Event("draw"));
  }
}

// [[id, x, y, z], …] of the parameter's text: a preset's name, or `id x y z; …`
function rowsOf(text, presets) {
  if (text in presets) return presets[text];
  return text
    .split(/[;\n]/)
    .map((part) => part.trim())
    .filter(Boolean)
    .map((part) => part.split(/[\s,]+/).map(Number))
    .filter((row) => row.length === 4);
}
