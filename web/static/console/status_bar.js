// The bar: what the vehicle says of itself, grey when old, and the controls always in sight.

import { command } from "../core/api.js";
import { flightButton } from "../core/flight_button.js";
import { $, setIfChanged, setText } from "../core/dom.js";
import { bytes, duration, fixed, NONE, seconds, words } from "../core/format.js";
import { onHold } from "../core/hold_button.js";
import { armNote } from "../fly/preflight.js";
import { controlOf, isAlone } from "../core/control_authority.js";
import { BatteryLeft } from "./battery_left.js";
import { consistencyOf } from "./consistency.js";
import { Primary } from "./primary.js";
import { flownOn, lapOf, lineOf, oscillates, pillOf, restoreLabel } from "./vehicle_words.js";

const SHOWN = {
  arm: ({ armed }) => armed,
  disarm: ({ armed, mode }) => !armed && mode?.toLowerCase() !== "cut",
};
const isCut = (status) => status?.mode?.toLowerCase() === "cut";
const SLOW = 0.98; // of real time
const percent = (share) =>
  share === null || share === undefined ? NONE : `${fixed(100 * share, share < 0.0995 ? 1 : 0)} %`;

// A clock, and a size that leaves as a whole where there is no room.
const recorded = (station) =>
  `● ${duration(station.recording_duration)} ${bytes(station.recording_bytes).replace(" ", "\u00a0")}`;

export class StatusBar {
  height;
  error; // m, of the newest sample
  batteryLeft = new BatteryLeft();

  constructor(events, fly, isOperator, { ages, channels, telemetry, gains, vehicle }) {
    this.events = events;
    this.ages = ages; // greys what is old, too
    this.channels = channels;
    this.gains = gains;
    this.kept = `quadlab.airborne.${vehicle}`; // since when, for a page that is loaded again
    this.controls = ["disarm", "arm", "take-off", "land"].map($);
    this.primary = new Primary($("primary"), $("disarm"));
    this.isOperator = isOperator;
    // What the label said at the press, whatever has been heard since.
    const ask = (wanted) => fly.attempt(() => command(wanted), wanted, SHOWN[wanted]);
    onHold($("arm"), 800, ask, () => this.nextArm);
    onHold($("disarm"), 800, () => ask("disarm"));
    flightButton($("take-off")).addEventListener("click", () => fly.start("take_off"));
    flightButton($("land")).addEventListener("click", () => fly.start("land"));
    flightButton($("restore")).addEventListener("click", () => this.restore(fly));
    if (!isOperator)
      for (const button of this.controls) {
        button.disabled = true;
        button.title = "viewers cannot do this; ask an operator for an invitation to command";
      }
    setInterval(() => this.draw(), 200);
    events.on("summary", ({ link }) => {
      if (link && link.state !== this.linkDrawn) this.draw();
    });
    channels.addEventListener("change", () => this.draw());
    telemetry.addEventListener("frame", ({ detail: { value } }) => {
      this.height = value["state.position.z"];
      this.error = Math.hypot(...["x", "y", "z"].map((axis) => value[`error.position.${axis}`])) / 1e3;
    });
  }

  // Disarming also acknowledges a cut, and ends a bench test.
  get nextArm() {
    const { status } = this.events.summary;
    return status?.armed || isCut(status) ? "disarm" : "arm";
  }
  fresh(topic) {
    return !this.ages.isOld(topic);
  }

  draw() {
    const { status, link, battery, station } = this.events.summary;
    this.drawState(status);
    this.drawControl(status);
    this.set(
      "behavior",
      status &&
        (isAlone(status) ? "lands alone" : (lapOf(this.events.summary.trajectory) ?? words(status.behavior))),
    );
    this.linkDrawn = link?.state;
    this.set(
      "link",
      link && `${seconds(this.linkAge(link))} · ${percent(link.loss)}`,
      link && (this.channels.isSilent || link.state !== "good"),
    );
    this.set("telemetry", link && `${fixed(link.telemetry_rate, 0)} Hz`);
    this.set(
      "tick",
      status && `${this.lateness(status.lateness_p99)} · ${percent(status.missed_share)}`,
      status?.missed_share > 0.01,
    );
    this.drawBattery(status, battery);
    const refused = this.refused(status);
    this.set(
      "tracker",
      station && (station.tracker_rate > 0 ? `${fixed(station.tracker_rate, 0)} Hz${refused}` : "none"),
      station?.tracker_rate < 10 || Boolean(refused),
    );
    this.drawEstimate(status, this.events.summary.estimate);
    this.set("recording", station && (station.recording ? recorded(station) : "off"));
    this.drawPace(station?.real_time_factor);
    const disarms = this.nextArm === "disarm";
    $("arm").textContent = disarms ? "Disarm" : "Arm";
    if (this.isOperator) $("arm").disabled = $("disarm").disabled = !this.channels.hasStatus;
    if (this.isOperator)
      $("arm").title = disarms
        ? "hold for 0.8 s to acknowledge the cut, or to stop the motors on the ground"
        : armNote(this.events.summary.preflight) || "hold for 0.8 s to start the motors";
  }

  // With the minutes until its warning, where the flight so far tells them.
  drawBattery(status, battery) {
    if (battery && this.fresh("battery"))
      this.batteryLeft.add(Math.floor(performance.now() / 1e3), battery.voltage, Boolean(status?.airborne));
    const [warns, lands] = ["safety.battery_warning", "safety.battery_land"].map((name) =>
      this.gains.value(name),
    );
    const minutes = this.batteryLeft.minutes(warns),
      left = minutes === null ? "" : ` · ${minutes < 1 ? "< 1" : Math.round(minutes)} min`;
    this.set(
      "battery",
      battery && `${fixed(battery.voltage, 1)} V${left}`,
      status?.flags?.some((flag) => /battery/i.test(flag)),
    );
    setIfChanged(
      $("battery").parentElement,
      "title",
      `warning below ${fixed(warns, 1)} V, reaction below ${fixed(lands, 1)} V; minutes: until the ` +
        "warning, by the voltage of this flight",
    );
  }

  // What the last act of this flight changed and is not back yet.
  get changed() {
    return Object.entries(this.events.summary.restorable ?? {}).map(([name, old]) => ({
      name,
      old,
      now: this.gains.value(name),
    }));
  }

  restore(fly) {
    const values = Object.fromEntries(this.changed.map(({ name, old }) => [name, old]));
    fly.attempt(() => this.gains.set(values, true), restoreLabel(this.changed));
  }

  drawRestore(status) {
    const { changed } = this,
      isShown = this.isOperator && oscillates(status) && changed.length > 0;
    setIfChanged($("restore"), "hidden", !isShown);
    if (isShown) setText($("restore"), restoreLabel(changed));
  }

  // The pill, the line in words, and the button of the moment.
  drawState(status) {
    const { preflight, trajectory } = this.events.summary,
      { hasContact } = this.channels;
    const seen = {
      status,
      hasContact,
      preflight: this.events.age("preflight") < 2 ? preflight : null,
      airborne: this.airborneFor(status, hasContact),
      source: this.gains.value("estimation.source"),
      height: this.height,
      error: this.error,
      problems: this.problems(status),
      trajectory: hasContact ? trajectory : null,
      changed: this.changed,
    };
    const { word, tone } = pillOf(seen);
    setText($("doing"), word);
    for (const id of ["pill", "bar"]) setIfChanged($(id).dataset, "tone", tone);
    setIfChanged(
      $("pill"),
      "title",
      status ? `${words(status.mode)}, ${words(status.behavior)}, ${words(status.control_mode)}` : "",
    );
    setText($("flown-on"), hasContact && status.airborne ? flownOn(seen) : "");
    setText($("in-words"), lineOf(seen));
    setIfChanged($("progress"), "hidden", !trajectory?.duration);
    if (trajectory?.duration)
      $("progress").style.width = `${(100 * trajectory.elapsed) / trajectory.duration}%`;
    this.primary.show(status);
    this.drawRestore(hasContact ? status : null);
  }

  // s in the air; null of a flight that was under way when this page came.
  airborneFor(status, hasContact) {
    if (!hasContact) return null;
    if (!status.airborne) {
      sessionStorage.removeItem(this.kept);
      this.sawGround = true;
      return null;
    }
    const now = performance.timeOrigin + performance.now(); // no setting of a clock moves it
    if (this.sawGround) sessionStorage[this.kept] ??= String(now);
    const since = Number(sessionStorage.getItem(this.kept));
    return since ? (now - since) / 1e3 : null;
  }

  // What is not well beside the vehicle's flags.
  problems(status) {
    const { link, station, estimate } = this.events.summary,
      { word } = consistencyOf(status?.flags ?? [], estimate);
    return [
      ...this.channels.late,
      ...(link && link.state !== "good" ? [`link ${link.state}`] : []),
      ...(word === "inconsistent" ? ["estimate inconsistent"] : []),
      ...(status?.missed_share > 0.01 ? [`${percent(status.missed_share)} of the ticks missed`] : []),
      ...(this.fresh("station_status") ? (station?.alarms ?? []) : []),
    ];
  }

  drawControl(status) {
    const control = controlOf(status),
      output = $("control-mode"),
      title = control?.title ?? "";
    this.set(
      "control-mode",
      control ? `${control.tone === "alarm" ? "⚠ " : ""}${control.text}` : words(status?.control_mode),
      control?.tone === "warn",
    );
    output.classList.toggle("alarm", control?.tone === "alarm" && this.fresh("status"));
    setIfChanged(output, "title", title);
    setIfChanged(output, "hidden", !control?.tone); // direct is what is expected
  }

  // One calm word on whether estimate and measurements agree; the numbers are in its tip.
  drawEstimate(status, estimate) {
    const { word, tip } = consistencyOf(status?.flags ?? [], estimate);
    this.set("estimate", status && word, word !== "consistent");
    setIfChanged($("estimate").parentElement, "title", tip);
  }

  // What the vehicle thinks of the poses it gets, while it thinks so.
  refused(status) {
    const flags = this.fresh("status") ? (status?.flags ?? []) : [];
    return flags.includes("tracker_jumped")
      ? " · jumped"
      : flags.includes("measurements_refused")
        ? " · refused"
        : "";
  }

  // Of a simulation that waits. What is recorded makes room for it: nothing moves.
  drawPace(factor) {
    $("pace").hidden = !(factor && factor < SLOW);
    this.set("factor", factor && `${fixed(factor, 2)}× real time`);
  }

  // The station's own figure while it speaks; longer once it is silent.
  linkAge(link) {
    return Math.max(link.age ?? 0, this.fresh("link_status") ? 0 : this.ages.age("link_status"));
  }

  lateness(value) {
    return value === null || value === undefined
      ? NONE
      : value < 1e-3
        ? `${fixed(1e6 * value, 0)} µs`
        : `${fixed(1e3 * value, 1)} ms`;
  }

  set(id, text, warn = false) {
    const output = $(id),
      shown = text || NONE;
    setText(output, shown);
    output.classList.toggle("warn", Boolean(warn) && this.fresh(output.dataset.topic));
  }
}
