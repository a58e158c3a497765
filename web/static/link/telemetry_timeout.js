// Whether the vehicle has fallen silent, known as soon as a frame says so: 25 times a second, long
// before the next summary. While no frame comes it is this page's way to web that is broken, and
// nothing is said of the vehicle's.

const TOPIC = "state"; // the table wants it always
const SILENT = 0.2; // s, as the station counts outages

export class TelemetryTimeout extends EventTarget {
  /** @param {EventTarget} telemetry */
  constructor(telemetry) {
    super();
    this.holds = false;
    telemetry.addEventListener("frame", (/** @type {any} */ { detail }) => this.judge(detail.age[TOPIC]));
  }

  /** @param {number | undefined} age */
  judge(age) {
    if (age === undefined || age >= SILENT === this.holds) return;
    this.holds = !this.holds;
    this.dispatchEvent(new Event("change"));
  }
}
