// The gauge: what the runs take, what is free, how long recording still lasts.

import { get } from "../core/api.js";
import { element } from "../core/dom.js";
import { bytes } from "../core/format.js";

// "35 h", "12 min"; s.
export function lasting(value) {
  if (value === null || value === undefined) return "";
  if (value < 60) return "less than a minute";
  if (value < 5400) return `${Math.floor(value / 60)} min`;
  return value < 172800 ? `${Math.floor(value / 3600)} h` : `${Math.floor(value / 86400)} days`;
}

export class Gauge {
  constructor(place) {
    this.place = place;
    this.days = 7;
    this.fill = element("i");
    this.bar = element("span", { className: "bar", role: "img" }, this.fill);
    this.text = element("span");
    place.append(this.bar, this.text);
  }

  async refresh() {
    const {
      run_bytes: used,
      deleted_bytes: deleted,
      replay_bytes: replays,
      free,
      warn_free: warn,
      keep_free: keep,
      lasts,
      recording,
      trash_days: days,
    } = await get("/api/storage");
    this.days = Number(days.toFixed(2));
    const taken = used + deleted + replays,
      all = taken + free,
      share = all ? taken / all : 0;
    this.fill.style.width = `${(100 * share).toFixed(1)}%`;
    const isLow = free < warn;
    const left =
      lasts === null
        ? ""
        : lasts === 0
          ? " · too full to record"
          : ` · room for ${lasting(lasts)} of recording`;
    this.text.textContent = `${isLow ? "Disk nearly full: " : ""}${bytes(used)} in runs · ${bytes(free)} free${left}`;
    this.bar.ariaLabel = `runs use ${Math.round(100 * share)} % of the disk space they may use`;
    this.place.classList.toggle("warn", isLow);
    this.place.title =
      `${bytes(deleted)} more in the trash, ${bytes(replays)} in prepared replays. ` +
      `Warning below ${bytes(warn)} free, no recording below ${bytes(keep)}; the time is at the rate ` +
      `of ${recording ? "the present recording" : "the newest runs"}.`;
  }
}
