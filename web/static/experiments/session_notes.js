// Notes of the run that is recorded now, or was last: what is typed during a flight stays with its run.

import { get } from "../core/api.js";
import { element, setText } from "../core/dom.js";
import { RunNotes } from "../runs/notes.js";

const RETRY = 2000; // ms, while the catalogue does not know a new run yet

export class SessionNotes {
  id = ""; // of the run shown
  again = 0;

  constructor(events, isOperator) {
    this.notes = new RunNotes({
      isOperator,
      list: { table: { focus: () => this.notes.text.blur() } },
      say: (/** @type {string} */ text) => this.notes.say(text, true),
    });
    this.of = element("span", { className: "dim" });
    this.place = this.notes.place;
    this.place.querySelector("h3")?.replaceWith(element("h2", {}, "Notes ", this.of));
    this.notes.show(null);
    events.on("summary", ({ station }) => {
      if (station?.recording && station.run_id !== this.id) this.read(station.run_id);
    });
    events.on("runs", ({ runs }) => {
      if (runs.includes(this.id)) this.read(this.id);
    });
  }

  // The newest run, where none is recorded.
  open() {
    if (!this.id) this.read("");
  }

  // id: of a run, "" for the newest one.
  async read(id) {
    if (id !== this.id && performance.now() < this.again) return;
    this.again = performance.now() + RETRY;
    const [run] = await get(`/api/runs?limit=1&search=${encodeURIComponent(id)}`).catch(() => []);
    if (!run) return;
    this.id = run.id;
    setText(this.of, run.recording ? `of the recording ${run.id}` : `of ${run.title || run.id}`);
    this.notes.show(run);
  }
}
