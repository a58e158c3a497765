// Event marks: `m`, or the button beside Record, marks this moment in the log; what it was can be typed afterwards.

import { get, request } from "../core/api.js";
import { element, showNote } from "../core/dom.js";
import { duration, fixed } from "../core/format.js";
import { onKey } from "../core/keys.js";

const SHOWN = 8; // the newest of this recording
const FADE = 4000; // ms
const OLDEST = 9; // s a press may wait for the network

const newId = () =>
  `m-${crypto.getRandomValues(new Uint32Array(3)).reduce((text, n) => text + n.toString(36).padStart(7, "0"), "")}`;

export class Marks {
  // place: the row of the recorder; note: where the answer to a key press stands in sight of every tab.
  constructor(place, note, events, isOperator) {
    this.events = events;
    this.isOperator = isOperator;
    this.button = element(
      "button",
      {
        id: "mark",
        disabled: true,
        title: isOperator ? "mark this moment in the log (m)" : "viewers cannot mark; operators can",
        onclick: (event) => this.press(event),
      },
      "Mark",
    );
    this.list = element("ol", { id: "marks", hidden: true, ariaLabel: "marks of this recording" });
    this.note = element("span", { id: "mark-note", role: "status", hidden: true });
    this.lines = new Map(); // mark id → its line
    place.append(this.button);
    place.after(this.list);
    note.append(this.note);
    if (isOperator) onKey("m", "mark this moment in the log", (event) => this.press(event));
    events.on("mark", (mark) => this.show(mark));
    events.on("summary", ({ station }) => {
      if (station) this.follow(station);
    });
  }

  follow({ recording, run_id: run, recording_duration: since }) {
    this.button.disabled = !this.isOperator || !recording;
    if (!recording || run === this.run) return;
    this.run = run;
    this.lines.clear();
    this.list.replaceChildren();
    this.list.hidden = true;
    if (since > 1) this.load(run); // else it has none, and the catalogue may not know it yet
  }

  // Those made before this page was opened.
  async load(run) {
    const marks = await get(`/api/runs/${encodeURIComponent(run)}/marks`).catch(() => []);
    for (const mark of marks) this.show(mark);
  }

  // The time of the press is that of the event, however late its handler runs.
  async press(event) {
    const id = newId(),
      since = event.timeStamp;
    try {
      const { time } = await request("POST", "/api/marks", {
        id,
        ago: Math.min(OLDEST, Math.max(0, (performance.now() - since) / 1e3)),
      });
      this.tell(`Marked ${this.clock(time)}`);
    } catch (error) {
      this.tell(`Not marked: ${error.message}`, true);
    }
  }

  clock(time) {
    return `${duration(time)}.${fixed(time % 1, 1).slice(2, 3)}`;
  }

  tell(text, isWarning = false) {
    showNote(this.note, text);
    this.note.classList.toggle("warn", isWarning);
    clearTimeout(this.fading);
    this.fading = setTimeout(
      () => {
        this.note.hidden = true;
      },
      isWarning ? 2 * FADE : FADE,
    );
  }

  // A new mark or a new text, whoever's.
  show({ id, run_id: run, time, text, requester }) {
    if (this.run !== undefined && run !== this.run) return;
    const known = this.lines.get(id);
    if (known) {
      if (known !== document.activeElement) known.value = text;
      return;
    }
    const input = element("input", {
      value: text,
      placeholder: "describe this mark",
      maxLength: 500,
      disabled: !this.isOperator,
      ariaLabel: `text of the mark at ${this.clock(time)}`,
    });
    input.addEventListener("change", () => this.name(id, input));
    input.addEventListener("keydown", ({ key }) => {
      if (key === "Enter" || key === "Escape") input.blur();
    });
    this.lines.set(id, input);
    this.list.prepend(element("li", { title: requester }, element("time", {}, this.clock(time)), input));
    this.list.hidden = false;
    while (this.list.children.length > SHOWN) {
      const oldest = this.list.lastElementChild?.querySelector("input");
      for (const [key, one] of this.lines) if (one === oldest) this.lines.delete(key);
      oldest.parentElement.remove();
    }
  }

  async name(id, input) {
    try {
      await request("POST", "/api/marks", { id, text: input.value });
      this.tell("Mark saved");
    } catch (error) {
      this.tell(`Mark not saved: ${error.message}`, true);
    }
  }
}
