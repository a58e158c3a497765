// The time line: behaviors and modes as stretches with their names, marks, events and parameter
// changes where they happened, and the bar that is dragged. A second run lies below; it is dragged
// against the first.

import { element } from "/static/core/dom.js";
import { words } from "/static/core/format.js";
import { stamp } from "./play_head.js";

const TINTS = ["teal", "violet", "y", "amber", "rose", "z"].map(
  (name) => `color-mix(in srgb, var(--${name}) 25%, var(--panel))`,
);
const MOST = 400; // stretches or ticks of a kind
const GROUND = new Set(["ground", "idle", "ready", "disarmed"]);

export class TimeLine extends EventTarget {
  constructor(place, clock, range) {
    super();
    this.clock = clock;
    this.range = range;
    this.place = place;
    this.tints = new Map();
    this.lanes = element("div", { className: "lanes" });
    this.head = element("i", { className: "playhead" });
    this.shown = element("i", { className: "shown" });
    this.bar = element("div", { className: "bar", tabIndex: 0, title: "drag to move the play-head" });
    for (const [name, value] of [
      ["role", "slider"],
      ["aria-label", "time of the replay"],
      ["aria-orientation", "horizontal"],
    ])
      this.bar.setAttribute(name, value);
    this.thumb = element("i", { className: "thumb" });
    this.bar.append(this.thumb);
    this.inner = element("div", { className: "inner" }, this.lanes, this.bar, this.shown, this.head);
    place.append(this.inner);
    this.scrub();
    clock.addEventListener("time", () => this.move());
    clock.addEventListener("change", () => this.fill());
    range.addEventListener("range", () => this.move());
  }

  setRuns(runs) {
    this.runs = runs;
    this.fill();
  }

  share(t) {
    const { start, end } = this.clock;
    return (100 * (t - start)) / Math.max(1e-9, end - start);
  }

  fill() {
    if (!this.runs || this.filled === this.key()) {
      this.move();
      return;
    }
    this.filled = this.key();
    this.lanes.replaceChildren(...this.runs.flatMap((run, k) => this.lane(run, k)));
    this.move();
  }

  key() {
    return [
      this.clock.start,
      this.clock.end,
      ...this.runs.flatMap((run) => [run.id, run.shift, run.duration]),
    ].join(" ");
  }

  lane(run, k) {
    const { spans, marks, events, changes } = run.description;
    const lane = (kind, ...children) =>
      element("div", { className: `lane ${kind}${k ? " second" : ""}` }, ...children);
    const stretches = lane(
      "behavior",
      ...spans.behavior.slice(0, MOST).map((one) => this.stretch(run, one, "behavior")),
    );
    const modes = lane("mode", ...spans.mode.slice(0, MOST).map((one) => this.stretch(run, one, "mode")));
    const ticks = lane(
      "ticks",
      ...events
        .slice(0, MOST)
        .map((one) => this.tick(run, one.t, `event${one.warn ? " warn" : ""}`, one.text)),
      ...changes
        .slice(0, MOST)
        .map((one) => this.tick(run, one.t, "change", `${one.name}: ${one.old} → ${one.new}, ${one.who}`)),
      ...marks
        .slice(0, MOST)
        .map((one) =>
          this.tick(
            run,
            one.t,
            "mark",
            `mark${one.who ? ` of ${one.who}` : ""}: ${one.text || "without words"}`,
            one.text || "mark",
          ),
        ),
    );
    if (k > 0) this.shiftable(stretches);
    return [stretches, modes, ticks];
  }

  stretch(run, { from, to, text }, kind) {
    const left = this.share(from - run.shift),
      width = this.share(to - run.shift) - left,
      label = words(text);
    if (!this.tints.has(text))
      this.tints.set(text, GROUND.has(text) ? "var(--raised)" : TINTS[this.tints.size % TINTS.length]);
    const made = element("span", { title: `${kind} ${label}, ${stamp(from, 1)} to ${stamp(to, 1)}` }, label);
    made.style.cssText = `left:${left}%;width:${width}%;background:${this.tints.get(text)}`;
    return made;
  }

  tick(run, t, kind, title, label = "") {
    const made = element("i", { className: kind, title: `${stamp(t, 1)}  ${title}` }, label);
    made.style.left = `${this.share(t - run.shift)}%`;
    return made;
  }

  // Drags the second run; `shift` is told with the seconds it moved to the right.
  shiftable(lane) {
    lane.title = "drag to move this run against the first";
    let from = null;
    lane.addEventListener("pointerdown", (event) => {
      lane.setPointerCapture(event.pointerId);
      from = event.clientX;
    });
    lane.addEventListener("pointermove", (event) => {
      if (from === null || event.clientX === from) return;
      const seconds = ((event.clientX - from) / this.inner.clientWidth) * (this.clock.end - this.clock.start);
      from = event.clientX;
      this.dispatchEvent(new CustomEvent("shift", { detail: seconds }));
    });
    for (const name of ["pointerup", "pointercancel"])
      lane.addEventListener(name, () => {
        from = null;
      });
  }

  scrub() {
    const { bar, clock } = this;
    const seek = (event) => {
      const box = bar.getBoundingClientRect(),
        share = (event.clientX - box.left) / box.width;
      clock.seek(clock.start + Math.min(1, Math.max(0, share)) * (clock.end - clock.start));
    };
    bar.addEventListener("pointerdown", (event) => {
      bar.setPointerCapture(event.pointerId);
      this.isScrubbing = true;
      clock.pause();
      seek(event);
    });
    bar.addEventListener("pointermove", (event) => {
      if (this.isScrubbing) seek(event);
    });
    for (const name of ["pointerup", "pointercancel"])
      bar.addEventListener(name, () => {
        this.isScrubbing = false;
      });
  }

  move() {
    const { clock, range, bar } = this;
    this.head.style.left = this.thumb.style.left = `${this.share(clock.t)}%`;
    const left = Math.max(0, this.share(range.start)),
      right = Math.min(100, this.share(range.end));
    this.shown.style.left = `${left}%`;
    this.shown.style.width = `${Math.max(0, right - left)}%`;
    this.shown.hidden = right - left > 99.5;
    bar.setAttribute("aria-valuemin", clock.start.toFixed(3));
    bar.setAttribute("aria-valuemax", clock.end.toFixed(3));
    bar.setAttribute("aria-valuenow", clock.t.toFixed(3));
    bar.setAttribute("aria-valuetext", stamp(clock.t));
  }
}
