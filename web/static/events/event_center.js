// What happens, behind one bell on every page: newest on top, a line that comes again only counted, with the
// number of those that came since it was last open.

import { element, optionsOf, setIfChanged, setText } from "../core/dom.js";
import { clock, exact } from "../core/format.js";
import { timeZone } from "../core/time_zone.js";
import { icon } from "../icons/icons.js";

const MOST = 500;
const GAP = 6,
  EDGE = 12; // px
const GESTURE = 5; // s between two values of one motion
const SHOWN = [
  ["", "all"],
  ["warn", "warnings and errors"],
  ["error", "errors"],
  ["change", "parameter changes"],
  ["act", "people"],
];

export class EventCenter {
  // vehicle: whose events; before: the element that the bell is put before.
  constructor(events, vehicle, before) {
    this.key = `quadlab.events.seen.${vehicle}`;
    this.seen = Number(localStorage.getItem(this.key) ?? NaN); // s, stamp of the newest that was seen
    this.lines = []; // newest first
    this.number = element("b");
    this.newest = element("span", { className: "unseen", ariaLive: "polite" });
    this.list = element("ol", { id: "events", tabIndex: 0, ariaLabel: "events, newest first" });
    const choose = element(
      "select",
      {
        ariaLabel: "events shown",
        onchange: ({ target }) => {
          this.list.dataset.shown = target.value;
        },
      },
      ...optionsOf(SHOWN),
    );
    this.panel = element(
      "section",
      { id: "event-center", popover: "auto", ariaLabel: "events" },
      element("header", {}, element("h1", {}, "Events"), choose),
      this.list,
    );
    this.bell = element("button", { id: "bell", popovertarget: "event-center" }, icon("bell"), this.number);
    this.panel.addEventListener("beforetoggle", ({ newState }) => {
      if (newState === "open") this.place();
    });
    this.panel.addEventListener("toggle", () => this.draw());
    addEventListener("resize", () => this.place());
    timeZone.addEventListener("change", () => {
      for (const line of this.lines) setText(line.time, clock(line.stamp));
    });
    before.before(this.bell, this.newest);
    document.body.append(this.panel);
    events.on("hello", ({ events: lines }) => {
      this.lines = [];
      this.list.replaceChildren();
      for (const line of lines)
        this.add(line.type === "parameter" ? { ...line, level: "change", text: "" } : line);
      if (Number.isNaN(this.seen)) this.see();
      this.draw();
    });
    events.on("event", (line) => {
      this.add(line);
      if (line.level === "warn" || line.level === "error") setText(this.newest, line.text);
      this.draw();
    });
    events.on("parameter", (change) => this.add({ ...change, level: "change", text: "" }));
    this.draw();
  }

  place() {
    const { right } = this.bell.getBoundingClientRect(),
      { bottom } = this.bell.closest("header").getBoundingClientRect();
    this.panel.style.top = `${bottom + GAP}px`; // no control of the bar is covered
    this.panel.style.right = `clamp(${EDGE}px, ${innerWidth - right}px, 100vw - 440px - ${EDGE}px)`;
  }

  add({ level, text, stamp, act = false, name = "", old = undefined, value = undefined, requester = "" }) {
    const [last] = this.lines; // a slider in motion is one line
    const same = name
      ? last?.name === name && last.who === requester && stamp - last.stamp < GESTURE
        ? last
        : null
      : this.lines.find((one) => one.level === level && one.text === text);
    const line = same ?? {
      level,
      name,
      who: requester,
      count: 0,
      values: [exact(old)],
      time: element("time"),
      said: element("span"),
      times: element("b"),
    };
    line.item ??= element(
      "li",
      { className: `${level}${act || (requester && requester !== "vehicle") ? " act" : ""}` },
      line.time,
      line.said,
      line.times,
    );
    if (name) {
      line.values.push(exact(value));
      const count = line.count ? ` (${line.count + 1} values)` : "";
      text = `${name} ${line.values[0]} → ${line.values.at(-1)}${count}${requester ? `, ${requester}` : ""}`;
      line.item.title = line.values.join(" → ");
    }
    Object.assign(line, { text, stamp, count: line.count + 1 });
    this.lines = [line, ...this.lines.filter((one) => one !== line)];
    for (const gone of this.lines.splice(MOST)) gone.item.remove();
    setText(line.time, clock(stamp));
    setText(line.said, text);
    setText(line.times, line.count > 1 && !name ? `(${line.count} times)` : "");
    this.list.prepend(line.item);
  }

  // All there are.
  see() {
    this.seen = Math.max(0, ...this.lines.map(({ stamp }) => stamp));
    localStorage.setItem(this.key, String(this.seen));
  }

  draw() {
    if (this.panel.matches(":popover-open")) this.see();
    const unread = this.lines.filter(({ name, stamp }) => !name && stamp > this.seen);
    const tone = ["error", "warn"].find((level) => unread.some((line) => line.level === level)) ?? "";
    setText(this.number, unread.length ? Math.min(unread.length, 99) : "");
    setIfChanged(this.bell.dataset, "tone", tone);
    const says = `events${unread.length ? `, ${unread.length} unread` : ""}`;
    setIfChanged(this.bell, "ariaLabel", says);
    setIfChanged(this.bell, "title", says);
  }
}
