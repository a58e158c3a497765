// Event lines and parameter changes, newest on top.

import { element } from "../core/dom.js";
import { exact } from "../core/format.js";

const MOST = 200;

export class EventList {
  constructor(list, events) {
    this.list = list;
    events.on("hello", ({ events: lines }) => {
      this.list.replaceChildren();
      for (const line of lines) this.add(line);
    });
    events.on("event", (line) => this.add(line));
    events.on("parameter", ({ name, value, requester, stamp }) => this.add({
      level: "change", text: `${name} = ${exact(value)}${requester ? `, ${requester}` : ""}`, stamp, key: name,
    }));
  }

  add({ level, text, stamp, key = null }) {
    const newest = this.list.firstElementChild;
    if (key !== null && newest?.dataset.key === key) newest.remove(); // a slider in motion
    const time = new Date(stamp * 1e3).toTimeString().slice(0, 8);
    const line = element("li", { className: level }, element("time", {}, time), element("span", {}, text));
    if (key !== null) line.dataset.key = key;
    this.list.prepend(line);
    while (this.list.children.length > MOST) this.list.lastElementChild.remove();
  }
}
