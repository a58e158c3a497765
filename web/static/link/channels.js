// Contact with the vehicle, judged once from all channels: its ticks, its status, the station's word on link
// and heartbeats, and this page's own connection. Pill, notice, Link tab, 3D view and buttons go by it alone.

import { seconds } from "../core/format.js";

const SERVER = 0.4; // s without a connection that is worth a word
const SILENT = 0.2; // s without ticks, as the station counts outages
const STATUS = 1,
  STATION = 0.9; // s; both come 5 times a second or more
const GONE = 1.5; // s of the station's silence that no busy computer explains
const TIMEOUT = 0.4; // s until the vehicle reacts, while safety.link_timeout is not known
const NEVER = 4; // s from the page's start until a vehicle that was never heard is worth a word
const BEAT = 300; // ms between two beats of a page that was held up
const PATIENCE = 3000; // ms of such beats alone, after which it judges nevertheless
const SURE = 1.2; // s of silence until it is known that station and link are not the reason

// Fires `change` when ticks cease or come again, or contact does: with the frame that says so, long before the next
// summary.
export class Channels extends EventTarget {
  /** @param {{ events: any, telemetry: EventTarget, ages: { age(topic: string): number }, gains: any }} parts */
  constructor({ events, telemetry, ages, gains }) {
    super();
    this.events = events;
    this.ages = ages;
    this.gains = gains;
    /** @type {number | null} */
    this.closed = null; // when the events broke off
    this.began = performance.now();
    this.known = ""; // the newest judgement
    this.beaten = this.began; // ms, the newest beat
    this.timely = this.began; // ms, the newest that was not late
    this.isSilent = false; // no ticks, as frames say: without frames nothing is said of the vehicle
    events.addEventListener("close", () => {
      this.closed ??= performance.now();
    });
    events.addEventListener("open", () => {
      this.closed = null;
    });
    // the table wants it always
    telemetry.addEventListener("frame", (/** @type {any} */ { detail }) => this.hear(detail.age.state));
  }

  // Called every 0.1 s. After a late beat what arrived in the meantime is yet to be read.
  beat() {
    const now = performance.now();
    if (now - this.beaten < BEAT) this.timely = now;
    this.beaten = now;
  }
  get isHeldUp() {
    const silent = performance.now() - this.timely;
    return silent > BEAT && silent < PATIENCE;
  }

  // A page that was held up judged before it read what had arrived: the frame says at once that there is contact.
  /** @param {number | undefined} age */
  hear(age) {
    const isSilent = age === undefined ? this.isSilent : age >= SILENT,
      shown = this.known;
    if (isSilent === this.isSilent && (this.away || this.cause === shown)) return;
    this.isSilent = isSilent;
    this.dispatchEvent(new Event("change"));
  }

  get away() {
    return this.closed === null ? 0 : (performance.now() - this.closed) / 1e3;
  } // s
  get silent() {
    return Math.min(this.ages.age("state"), this.ages.age("status"));
  } // s
  get station() {
    return Math.min(this.ages.age("link_status"), this.ages.age("station_status"));
  } // s

  // What is gone: page, station, link, flight, or not known yet (silent); "" while the vehicle is heard.
  get cause() {
    const { events, ages } = this,
      { link, status } = events.summary,
      isGood = link?.state === "good";
    if (this.away) return this.away > SERVER ? "page" : this.known;
    if (this.isHeldUp) return this.known;
    const isHeard =
      ages.age("state") < (this.gains.value("safety.link_timeout") ?? TIMEOUT) ||
      (ages.age("status") < STATUS && isGood);
    const isNew = !status && performance.now() - this.began < 1e3 * NEVER;
    this.known =
      isHeard || isNew
        ? ""
        : !(this.station < STATION)
          ? this.station < GONE
            ? "silent"
            : "station"
          : link && !isGood
            ? "link"
            : this.silent > SURE
              ? "flight"
              : "silent";
    return this.known;
  }

  get hasContact() {
    return Boolean(this.events.summary.status) && this.cause === "";
  }
  get hasStatus() {
    return this.hasContact && this.ages.age("status") < STATUS;
  } // not only what was true once

  // Each channel that is late while there is contact: "status 9.7 s old".
  get late() {
    const { ages } = this,
      found = /** @type {[string, number, number][]} */ ([
        ["telemetry", ages.age("state"), SILENT],
        ["status", ages.age("status"), STATUS],
        ["station", this.station, STATION],
      ]);
    return found
      .filter(([, age, limit]) => !(age < limit))
      .map(
        ([name, age]) =>
          `${name} ${Number.isFinite(age) ? `${seconds(Math.round(10 * age) / 10)} old` : "missing"}`,
      );
  }
}
