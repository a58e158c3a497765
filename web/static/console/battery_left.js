// How long the battery lasts, from how its voltage has fallen in this flight.

const WINDOW = 180,
  LEAST = 45; // s of a flight that are looked at, and that are needed
const JUMP = 0.3; // V between two readings: another battery, or another load
const MOST = 60; // min, beyond which nothing is said

export class BatteryLeft {
  /** @type {[t: number, volts: number][]} */
  readings = [];

  // t: s, of any clock.
  /** @param {number} t @param {number} volts @param {boolean} airborne */
  add(t, volts, airborne) {
    const last = this.readings.at(-1);
    if (!airborne || (last && Math.abs(volts - last[1]) > JUMP)) this.readings = [];
    if (!airborne || last?.[0] === t) return;
    this.readings.push([t, volts]);
    while (t - this.readings[0][0] > WINDOW) this.readings.shift();
  }

  // Minutes until the voltage falls below a limit; null while that cannot be said.
  /** @param {number} limit V @returns {number | null} */
  minutes(limit) {
    const { readings } = this,
      n = readings.length;
    if (n < 3 || readings[n - 1][0] - readings[0][0] < LEAST) return null;
    const mean = [0, 1].map((k) => readings.reduce((sum, one) => sum + one[k], 0) / n);
    let above = 0,
      below = 0;
    for (const [t, volts] of readings) {
      above += (t - mean[0]) * (volts - mean[1]);
      below += (t - mean[0]) ** 2;
    }
    const slope = above / below,
      now = mean[1] + slope * (readings[n - 1][0] - mean[0]);
    const left = (limit - now) / slope / 60;
    return slope < 0 && left < MOST ? Math.max(0, left) : null;
  }
}
