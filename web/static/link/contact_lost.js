// Contact lost: a red notice over the full width, in a layer of its own, which moves nothing. It
// tells what is gone (this page's server, the base station, the link, the vehicle's flight
// process), what was seen last and how long ago, and what the vehicle does next by itself.

import { showSignedOut } from "../core/connection.js";
import { byItself, lastState } from "./contact_text.js";
import { element, setText } from "../core/dom.js";
import { seconds } from "../core/format.js";

const TICK = 100; // ms
const HEADS = {
  silent: "no data from the vehicle",
  page: "this page's server does not answer",
  station: "the base station does not answer",
  link: "no link to the vehicle",
  flight: "the vehicle's flight process has stopped; its computer still answers",
};
const NOT_YET = { station: "No data from the base station yet", link: "No data from the vehicle yet" };

export class Contact {
  constructor(place, { events, telemetry, channels, gains }) {
    this.place = place;
    this.events = events;
    this.channels = channels;
    this.gains = gains;
    this.cause = "";
    this.signedOut = false;
    this.height = NaN; // m, of the newest sample, however old
    this.lost = element("b", {}, "Contact lost");
    this.ago = element("span", { className: "ago", ariaHidden: "true" });
    this.head = element("b", { role: "alert" });
    this.last = element("span", { className: "last" });
    this.next = element("span", { className: "next" });
    place.append(
      element("p", { className: "head" }, this.lost, this.ago, this.head),
      element("p", {}, this.last, " ", this.next),
    );
    events.addEventListener("open", () => {
      this.signedOut = false;
    });
    telemetry.addEventListener("frame", ({ detail }) => {
      const height = detail.value["state.position.z"];
      if (Number.isFinite(height)) this.height = height;
    });
    channels.addEventListener("change", () => this.draw());
    setInterval(() => {
      channels.beat();
      this.draw();
    }, TICK);
  }

  safety(name) {
    return this.gains.value(`safety.${name}`);
  }
  draw() {
    const { cause } = this.channels;
    if (cause !== this.cause) this.begin(cause);
    if (!cause) return;
    const { status, battery } = this.events.summary,
      silent = cause === "page" ? this.channels.away : this.channels.silent;
    setText(
      this.ago,
      Number.isFinite(silent) && !this.signedOut ? ` for ${seconds(Math.round(10 * silent) / 10)}: ` : "",
    );
    setText(
      this.last,
      this.signedOut ? "" : status ? `Last seen: ${lastState(status, this.height, battery)}.` : "",
    );
    setText(
      this.next,
      this.signedOut
        ? "The vehicle does not depend on this page."
        : byItself(cause, status, silent, (name) => this.safety(name)),
    );
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
