// What happens, behind one bell on every page: newest on top, a line that comes again only counted, with the
// number of those that came since it was last open.

import { element, optionsOf, setIfChanged, setText } from "../core/dom.js";
import { clock, exact } from "../core/format.js";
import { icon } from "../icons/icons.js";

const MOST = 200;
const GAP = 6, EDGE = 12; // px
const SHOWN = [["", "all"], ["warn", "warnings and errors"], ["error", "errors"], ["change", "parameter changes"]];

export class EventCenter {
  // vehicle: whose events; before: the element that the bell is put before.
  constructor(events, vehicle, before) {
    this.key = `quadlab.events.seen.${vehicle}`;
    this.seen = Number(localStorage.getItem(this.key) ?? NaN); // s, stamp of the newest that was seen
    this.lines = []; // newest first
    this.number = element("b");
    this.newest = element("span", { className: "unseen", ariaLive: "polite" });
    this.list = element("ol", { id: "events", tabIndex: 0, ariaLabel: "events, newest first" });
    const choose = element("select", { ariaLabel: "events shown", onchange: ({ target }) => { this.list.dataset.shown = target.value; } },
      ...optionsOf(SHOWN));
    this.panel = element("section", { id: "event-center", popover: "auto", ariaLabel: "events" },
      element("header", {}, element("h1", {}, "Events"), choose), this.list);
    this.bell = element("button", { id: "bell", popovertarget: "event-center" }, icon("bell"), this.number);
    this.panel.addEventListener("beforetoggle", ({ newState }) => { if (newState === "open") this.place(); });
    this.panel.addEventListener("toggle", () => this.draw());
    addEventListener("resize", () => this.place());
    before.before(this.bell, this.newest);
    document.body.append(this.panel);
    events.on("hello", ({ events: lines }) => {
      this.lines = [];
      this.list.replaceChildren();
      for (const line of lines) this.add(line);
      if (Number.isNaN(this.seen)) this.see();
      this.draw();
    });
    events.on("event", (line) => {
      this.add(line);
      if (line.level === "warn" || line.level === "error") setText(this.newest, line.text);
      this.draw();
    });
    events.on("parameter", ({ name, value, requester, stamp }) => this.add({
      level: "change", text: `${name} = ${exact(value)}${requester ? `, ${requester}` : ""}`, stamp, name,
    }));
    this.draw();
  }

  place() {
    const { right } = this.bell.getBoundingClientRect(), { bottom } = this.bell.closest("header").getBoundingClientRect();
    this.panel.style.top = `${bottom + GAP}px`; // no control of the bar is covered
    this.panel.style.right = `clamp(${EDGE}px, ${innerWidth - right}px, 100vw - 440px - ${EDGE}px)`;
  }

  add({ level, text, stamp, name = "" }) {
    const [last] = this.lines; // a slider in motion is one line
    const same = name ? (last?.name === name ? last : null) : this.lines.find((one) => one.level === level && one.text === text);
    const line = same ?? { level, name, count: 0, time: element("time"), said: element("span"), times: element("b") };
    line.item ??= element("li", { className: level }, line.time, line.said, line.times);
    Object.assign(line, { text, stamp, count: line.count + 1 });
    this.lines = [line, ...this.lines.filter((one) => one !== line)];
    for (const old of this.lines.splice(MOST)) old.item.remove();
    setText(line.time, clock(stamp));
    setText(line.said, text);
    setText(line.times, line.count > 1 && !name ? `× ${line.count}` : "");
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
