// Contact lost: a red notice over the full width, in a layer of its own, which moves nothing. It
// tells what is gone (this page's server, the base station, the link, the vehicle's flight
// process), what was seen last and how long ago, and what the vehicle does next by itself.

import { showSignedOut } from "../core/connection.js";
import { byItself, lastState } from "./contact_text.js";
import { element, setText } from "../core/dom.js";
import { seconds } from "../core/format.js";

const TICK = 100; // ms
const SERVER = 0.4; // s without a connection that is worth a word
const STATUS = 0.8, STATION = 0.9; // s; both come 5 times a second or more
const GONE = 1.5; // s of the station's silence that no busy computer explains
const TIMEOUT = 0.4; // s until the vehicle reacts, while safety.link_timeout is not known
const NEVER = 4; // s from the page's start until a vehicle that was never heard is worth a word

const SURE = 1.2; // s of silence until it is known that station and link are not the reason

const HEADS = {
  silent: "no data from the vehicle",
  page: "this page's server does not answer",
  station: "the base station does not answer",
  link: "no link to the vehicle",
  flight: "the vehicle's flight process has stopped; its computer still answers",
};
const NOT_YET = { station: "No data from the base station yet", link: "No data from the vehicle yet" };

export class Contact {
  constructor(place, { events, telemetry, ages, gains }) {
    this.place = place; this.events = events; this.ages = ages; this.gains = gains; this.cause = "";
    this.signedOut = false;
    this.height = NaN; // m, of the newest sample, however old
    this.closed = null; // when the events broke off
    this.began = performance.now();
    this.lost = element("b", {}, "Contact lost");
    this.ago = element("span", { className: "ago", ariaHidden: "true" });
    this.head = element("b", { role: "alert" });
    this.last = element("span", { className: "last" });
    this.next = element("span", { className: "next" });
    place.append(element("p", { className: "head" }, this.lost, this.ago, this.head), element("p", {}, this.last, " ", this.next));
    events.addEventListener("close", () => { this.closed ??= performance.now(); });
    events.addEventListener("open", () => { this.closed = null; this.signedOut = false; });
    telemetry.addEventListener("frame", ({ detail }) => {
      const height = detail.value["state.position.z"];
      if (Number.isFinite(height)) this.height = height;
    });
    setInterval(() => this.draw(), TICK);
  }

  safety(name) { return this.gains.value(`safety.${name}`); }
  get silent() { return Math.min(this.ages.age("state"), this.ages.age("status")); } // s

  // What is gone; "" while the vehicle is heard.
  judge() {
    const { events, ages } = this, { link } = events.summary;
    if (this.closed !== null) return performance.now() - this.closed > 1e3 * SERVER ? "page" : this.cause;
    const station = Math.min(ages.age("link_status"), ages.age("station_status"));
    const hasContact = ages.age("state") < (this.safety("link_timeout") ?? TIMEOUT) || ages.age("status") < STATUS && link?.state === "good";
    if (hasContact) return "";
    if (!events.summary.status && performance.now() - this.began < 1e3 * NEVER) return "";
    if (!(station < STATION)) return station < GONE ? "silent" : "station";
    if (link && link.state !== "good") return "link";
    return this.silent > SURE ? "flight" : "silent";
  }

  draw() {
    const cause = this.judge();
    if (cause !== this.cause) this.begin(cause);
    if (!cause) return;
    const { status, battery } = this.events.summary, silent = cause === "page" ? (performance.now() - this.closed) / 1e3 : this.silent;
    setText(this.ago, Number.isFinite(silent) && !this.signedOut ? ` for ${seconds(Math.round(10 * silent) / 10)}: ` : "");
    setText(this.last, this.signedOut ? "" : status ? `Last seen: ${lastState(status, this.height, battery)}.` : "");
    setText(this.next, this.signedOut ? "The vehicle does not depend on this page." : byItself(cause, status, silent, (name) => this.safety(name)));
  }

  begin(cause) {
    this.cause = cause;
    this.place.hidden = !cause;
    this.place.dataset.cause = cause;
    if (!cause) return;
    const isNew = !this.events.summary.status; // nothing that could be lost yet
    this.place.classList.toggle("never", isNew);
    this.lost.hidden = isNew;
    this.head.replaceChildren((isNew && NOT_YET[cause]) || HEADS[cause]);
    if (cause === "page") this.askWhy();
  }

  async askWhy() {
    if (await showSignedOut(this.head, () => this.cause === "page")) this.signedOut = this.lost.hidden = true;
  }
}
