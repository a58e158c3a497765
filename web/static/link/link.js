// The Link tab: how the radio to the vehicle does, and this page's own way to the station.

import { REACTIONS } from "./contact_text.js";
import { element, setText, showNote } from "../core/dom.js";
import { duration, fixed } from "../core/format.js";
import { here } from "../core/vehicle_path.js";
import { viewerButtons } from "../core/viewers.js";
import { LinkStrip } from "./strip.js";
import { LoopPanel } from "./loop_panel.js";

const TOPIC = "link_status";
const SIGNS = { good: "●", degraded: "◐", lost: "○" };
const SAMPLE = 200; // ms
const SLOW = 0.15,
  FRAMES = 20; // s, Hz: of this page's own link
const PATHS = { datagram: "UDP", quic: "the link itself" };
const GREY = 0.3; // s, deadline of what telemetry shows

export class LinkPanel {
  constructor(place, { events, telemetry, gains, ages, channels }) {
    this.channels = channels;
    this.place = place;
    this.events = events;
    this.telemetry = telemetry;
    this.gains = gains;
    this.ages = ages;
    this.frames = 0;
    this.counted = performance.now();
    this.rate = NaN;
    this.state = element("output", { className: "state" });
    this.since = element("span");
    this.outages = element("p");
    this.problem = element("p", { className: "problem", role: "alert", hidden: true });
    this.way = element("p", { className: "way" });
    this.reaction = element("p", { className: "reaction" });
    this.verdict = element("p", { className: "verdict", role: "status", hidden: true });
    this.state.dataset.topic = this.outages.dataset.topic = this.way.dataset.topic = TOPIC;
    const ms = (value) => `${fixed(1e3 * value, Math.abs(value) < 0.01 ? 1 : 0)} ms`,
      percent = (value) => `${fixed(100 * value, 1)} %`,
      hertz = (value) => `${fixed(value, 0)} Hz`;
    const strip = (label, options) => new LinkStrip(label, { topic: TOPIC, ...options });
    this.strips = {
      round_trip: strip("Round trip", {
        format: ms,
        least: 0.01,
        title: "round trip of a clock request to the vehicle, once a second",
      }),
      age: strip("Age", {
        format: ms,
        least: 0.05,
        deadline: { value: () => GREY, text: "numbers go grey" },
        title: "age of the newest telemetry at the station",
      }),
      loss: strip("Loss", {
        format: percent,
        least: 0.05,
        title: "share of telemetry packets lost over two seconds",
      }),
      jitter: strip("Jitter", {
        format: ms,
        least: 0.005,
        title: "standard deviation of the telemetry's transit time over two seconds",
      }),
      telemetry_rate: strip("Telemetry", { format: hertz, least: 120, title: "packets a second" }),
      clock_offset: strip("Clock offset", {
        format: (value) => (Math.abs(value) < 1 ? ms(value) : `${fixed(value, 3)} s`),
        least: 0.002,
        zero: false,
        title: "vehicle's clock minus the station's",
      }),
    };
    this.page = {
      roundTrip: new LinkStrip("Round trip", {
        format: ms,
        least: 0.02,
        deadline: { value: () => SLOW, text: "slow" },
        title: "round trip from this page to its server, once a second",
      }),
      rate: new LinkStrip("Frames", {
        format: hertz,
        least: 30,
        title: "telemetry frames received by this page; 25 are sent per second",
      }),
    };
    place.append(
      element("div", { className: "link-state" }, element("span", {}, "Radio"), this.state, this.since),
      this.outages,
      this.problem,
      this.way,
      this.reaction,
      ...Object.values(this.strips).map(({ place: line }) => line),
      element("h2", {}, "This page to the station"),
      this.verdict,
      ...Object.values(this.page).map(({ place: line }) => line),
      element(
        "p",
        { className: "span" },
        "last five minutes; logged as link_status, except for this page's own link",
      ),
    );
    this.loop = new LoopPanel(place, { events, ages });
    this.addViewers(place);
    telemetry.addEventListener("frame", () => {
      this.frames += 1;
    });
    setInterval(() => this.sample(), SAMPLE);
    setInterval(() => this.draw(), 1000);
    document.addEventListener("tab", ({ detail }) => {
      if (detail === "link") this.draw();
    });
  }

  addViewers(place) {
    const said = element("p", { className: "said", role: "status", hidden: true });
    const say = (...content) => {
      said.replaceChildren(...content);
      said.hidden = false;
    };
    const layout = element(
      "a",
      {
        href: here("/api/foxglove/layout"),
        download: "",
        title: "3D view, plots, events and parameters, to import there",
      },
      "Layout",
    );
    place.append(
      element("h2", {}, "View the flight in other programs"),
      element("div", { className: "links" }, ...viewerButtons(() => "/api/foxglove/link", say), layout),
      said,
    );
  }

  // Always, so that the tab has its five minutes when it is opened.
  sample() {
    const { link } = this.events.summary,
      time = performance.now() / 1e3,
      isOld = this.ages.isOld(TOPIC);
    for (const [name, strip] of Object.entries(this.strips)) {
      const isMeasured = (name !== "round_trip" && name !== "clock_offset") || link?.round_trip > 0;
      strip.add(time, link && !isOld && isMeasured ? (link[name] ?? NaN) : NaN);
    }
    this.loop.sample();
    if (!document.hidden) this.samplePage(time);
  }

  samplePage(time) {
    const waited = performance.now() - this.counted;
    if (waited > 1000) {
      this.rate = this.telemetry.connected ? (1e3 * this.frames) / waited : NaN;
      this.frames = 0;
      this.counted = performance.now();
    }
    this.page.roundTrip.add(time, this.telemetry.roundTrip ?? NaN);
    this.page.rate.add(time, this.rate);
  }

  draw() {
    if (document.hidden || this.place.hidden) return;
    const { link } = this.events.summary,
      isOld = this.ages.isOld(TOPIC),
      now = performance.now() / 1e3;
    for (const strip of [...Object.values(this.strips), ...Object.values(this.page)]) strip.draw(now);
    this.loop.draw();
    setText(this.state, link ? `${SIGNS[link.state] ?? ""} ${link.state}` : "no data yet");
    this.state.classList.toggle("warn", Boolean(link) && link.state !== "good" && !isOld);
    setText(this.since, link && !isOld ? `for ${spoken(link.state_duration)}` : "");
    setText(this.outages, link ? outages(link) : "");
    setText(this.way, link ? way(link) : "");
    showNote(this.problem, link?.problem && !isOld ? `⚠ Not commanded from here: ${link.problem}.` : "");
    setText(this.reaction, this.reactionText());
    showNote(this.verdict, this.verdictText(link, isOld));
  }

  reactionText() {
    const timeout = this.gains.value("safety.link_timeout"),
      land = this.gains.value("safety.link_land_after");
    const first = REACTIONS[this.gains.value("safety.link_reaction")],
      then = REACTIONS[this.gains.value("safety.link_land_reaction")];
    if (timeout === undefined || land === undefined || !first || !then)
      return "What the vehicle does without the station is not known here: its parameters have not been read.";
    return (
      `Without the station for ${fixed(timeout, 2)} s, a flying vehicle ${first.does} on its ` +
      `own; ${fixed(land, 1)} s later it ${then.does}.`
    );
  }

  // Which of the two ways is the slow one.
  verdictText(link, isOld) {
    const { roundTrip, connected } = this.telemetry,
      { late } = this.channels;
    if (!connected)
      return (
        "This page has no connection to its server: its values are out of date, whatever the " +
        "state of the radio link."
      );
    if (!(roundTrip > SLOW) && !(this.rate < FRAMES))
      return late.length ? `To this page: ${late.join(", ")}.` : "";
    const radio = link && !isOld && link.state === "good" ? "The radio is good: it" : "It";
    const slow =
      roundTrip > SLOW ? `${Math.round(1e3 * roundTrip)} ms` : `${fixed(this.rate, 0)} of 25 frames a second`;
    return `${radio} is this browser or its way to the station that is slow (${slow}).`;
  }
}

const spoken = (seconds) => (seconds < 60 ? `${fixed(seconds, seconds < 10 ? 1 : 0)} s` : duration(seconds));

function outages({ outages: count, outage_last: last, outage_longest: longest, outage_total: total }) {
  if (!count) return "No outage longer than 0.2 s since the first contact with the vehicle.";
  if (count === 1) return `1 outage since the first contact with the vehicle: ${spoken(last)}.`;
  return (
    `${count} outages since the first contact with the vehicle: the last ${spoken(last)}, the ` +
    `longest ${spoken(longest)}, together ${spoken(total)}.`
  );
}

// Where the vehicle is, as whom it lets the station in, and how telemetry comes.
function way({ address, access, path, reopened }) {
  const parts = [
    address && `connected to ${address}`,
    access && `signed in as ${access}`,
    path && `telemetry by ${PATHS[path] ?? path}`,
    reopened && `reopened ${reopened === 1 ? "once" : `${reopened} times`}, because nothing was received`,
  ].filter(Boolean);
  const text = parts.join(", ");
  return text && `${text[0].toUpperCase()}${text.slice(1)}.`;
}
