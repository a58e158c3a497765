// How old every number is: what is past its deadline goes grey, gets a hollow dot and a title that
// says when it was last received. An element tells by data-topic which message it shows.

import { setIfChanged } from "./dom.js";
import { seconds } from "./format.js";

const PERIOD = 200; // ms

export class Ages {
  /**
   * @typedef {{ age(topic: string): number }} Source
   * @param {Source} events
   * @param {Source} telemetry
   * @param {Record<string, number>} deadlines s by topic, of /api/signals
   */
  constructor(events, telemetry, deadlines) {
    this.events = events;
    this.telemetry = telemetry;
    this.deadlines = deadlines;
    this.titles = new WeakMap(); // an element's own title, while it is old
    setInterval(() => this.draw(), PERIOD);
  }

  // s since the newest message of a topic; what comes 25 times a second knows best.
  /** @param {string} topic */
  age(topic) {
    return Math.min(this.events.age(topic), this.telemetry.age(topic));
  }
  /** @param {string} topic */
  isOld(topic) {
    return !(this.age(topic) < (this.deadlines[topic] ?? 1));
  }

  draw() {
    if (document.hidden) return;
    for (const place of document.querySelectorAll("[data-topic]")) this.mark(place);
  }

  /** @param {any} place */
  mark(place) {
    const { topic } = place.dataset,
      age = this.age(topic),
      isOld = this.isOld(topic);
    if (place.classList.contains("stale") !== isOld) place.classList.toggle("stale", isOld);
    if (isOld) {
      if (!this.titles.has(place)) this.titles.set(place, place.title);
      const text = Number.isFinite(age)
        ? `last received ${seconds(Math.round(age * 10) / 10)} ago`
        : "never received";
      setIfChanged(place, "title", text);
    } else if (this.titles.has(place)) {
      place.title = this.titles.get(place);
      this.titles.delete(place);
    }
  }
}
