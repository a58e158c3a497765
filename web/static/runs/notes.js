// Notes of a run, saved automatically. When two write, the last one wins, both are told and every text is kept.

import { get, request } from "../core/api.js";
import { element, setIfChanged } from "../core/dom.js";
import { clock, moment } from "../core/format.js";

const PAUSE = 1500; // ms without typing after which it is saved

export class RunNotes {
  constructor(page) {
    this.page = page;
    this.run = null;
    this.drafts = new Map(); // run id → { text, seen }: typed and not yet saved
    this.saving = new Set(); // run ids; one request a run at a time, each run for itself
    this.newest = new Map(); // run id → { notes, notes_by }: our own last, which a list may not know yet
    this.text = element("textarea", {
      ariaLabel: "notes",
      rows: 4,
      maxLength: 10000,
      placeholder: page.isOperator ? "Notes (saved automatically)" : "No notes",
      readOnly: !page.isOperator,
    });
    this.status = element("p", { className: "said", role: "status" });
    this.earlier = element("ol", { className: "earlier" });
    this.history = element("details", {}, element("summary", {}, "Previous versions"), this.earlier);
    this.place = element(
      "section",
      { className: "notes" },
      element("h3", {}, "Notes"),
      this.text,
      this.status,
      this.history,
    );
    this.text.addEventListener("input", () => this.typed());
    this.text.addEventListener("change", () => this.save());
    this.text.addEventListener("keydown", (event) => {
      if (event.key === "Escape") {
        this.save();
        page.list.table.focus();
      }
    });
    this.history.addEventListener("toggle", () => {
      if (this.history.open) this.loadHistory();
    });
    window.addEventListener("pagehide", () => this.leave());
  }

  // run: null for none. A draft is never replaced by what others wrote.
  show(run) {
    this.place.hidden = !run;
    const isOther = run?.id !== this.run?.id;
    if (isOther) {
      if (this.run) this.save();
      this.history.open = false;
      this.say("");
    }
    this.run = run;
    if (!run) return;
    const newest = this.newest.get(run.id);
    if (newest?.notes_by.version > run.notes_by.version) Object.assign(run, newest);
    const draft = this.drafts.get(run.id),
      { version, author, stamp } = run.notes_by;
    const text = draft ? draft.text : run.notes;
    setIfChanged(this.text, "value", text);
    if (draft && version > draft.seen && author) this.foreign(run);
    else if (draft && isOther)
      this.wait(); // it could not be saved when it was left
    else if (!draft && !this.saving.has(run.id) && (isOther || newest?.notes_by.version !== version))
      this.said(author, stamp); // else: Saved
  }

  typed() {
    const { id, notes_by: by } = this.run,
      draft = this.drafts.get(id);
    this.drafts.set(id, { text: this.text.value, seen: draft ? draft.seen : by.version });
    this.wait();
  }

  wait() {
    this.say("Not saved yet");
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.save(), PAUSE);
  }

  // A draft goes to the run it was written for, whichever is shown by then.
  async save(run = this.run) {
    if (run?.id === this.run?.id) clearTimeout(this.timer);
    const draft = run && this.drafts.get(run.id);
    if (!draft || this.saving.has(run.id)) return;
    this.saving.add(run.id);
    try {
      const answer = await this.send(run.id, draft);
      this.newest.set(run.id, { notes: answer.notes, notes_by: answer.notes_by });
      Object.assign(this.run?.id === run.id ? this.run : run, this.newest.get(run.id));
      const newer = this.drafts.get(run.id);
      if (newer === draft) this.drafts.delete(run.id);
      else if (newer) this.drafts.set(run.id, { text: newer.text, seen: answer.notes_by.version });
      if (this.run?.id === run.id) this.saved(answer, newer === draft);
    } catch (error) {
      if (this.run?.id === run.id)
        this.say(`Not saved: ${error.message}. The text stays here; change it to try again.`, true);
      else this.page.say(`Notes of ${run.id} not saved: ${error.message}. The text is kept with that run.`);
    }
    this.saving.delete(run.id);
    const newer = this.drafts.get(run.id);
    if (newer && newer !== draft) this.save(run); // typed while that was under way
  }

  send(id, { text, seen }) {
    return request("PUT", `/api/runs/${encodeURIComponent(id)}/notes`, { notes: text, seen });
  }

  saved({ replaced, notes_by: by }, isAll) {
    if (!isAll) return;
    if (!replaced) {
      this.said(by.author, by.stamp, "Saved");
      return;
    }
    const { notes, author, stamp } = replaced;
    const written = `${author || "someone"} wrote${stamp ? ` at ${clock(stamp)}` : ""}`;
    this.say(
      element(
        "span",
        {},
        `Saved. It replaced what ${written}: “${notes.slice(0, 200)}” `,
        element("button", { className: "link", onclick: () => this.put(notes) }, "Restore that"),
      ),
      true,
    );
    if (this.history.open) this.loadHistory();
  }

  // Somebody else saved while this one types.
  foreign(run) {
    const { author, version } = run.notes_by;
    this.say(
      element(
        "span",
        {},
        `${author} changed these notes meanwhile: “${run.notes.slice(0, 200)}”. Yours will be the ` +
          "current ones when saved; both are kept. ",
        element(
          "button",
          {
            className: "link",
            onclick: () => {
              this.drafts.delete(run.id);
              clearTimeout(this.timer);
              this.text.value = run.notes;
              this.said(author, run.notes_by.stamp);
            },
          },
          "Take theirs",
        ),
      ),
      true,
    );
    const draft = this.drafts.get(run.id);
    this.drafts.set(run.id, { ...draft, seen: version });
  }

  put(text) {
    this.text.value = text;
    this.typed();
    this.save();
  }

  said(author, stamp, verb = "Written") {
    this.say(
      author ? `${verb} by ${author}${stamp ? `, ${moment(stamp)}` : ""}` : verb === "Saved" ? "Saved" : "",
    );
  }
  say(content, isWarning = false) {
    this.status.replaceChildren(content);
    this.status.classList.toggle("warn", isWarning);
  }

  async loadHistory() {
    const { id } = this.run;
    const texts = await get(`/api/runs/${encodeURIComponent(id)}/notes`).catch(() => []);
    if (id !== this.run?.id) return;
    const old = texts.slice(1);
    this.earlier.replaceChildren(
      ...(old.length
        ? old.map(({ notes, author, stamp }) =>
            element(
              "li",
              {},
              element(
                "span",
                { className: "dim" },
                `${author || "earlier"}${stamp ? `, ${moment(stamp)}` : ""}`,
              ),
              element("p", {}, notes || "(empty)"),
              ...(this.page.isOperator
                ? [element("button", { className: "link", onclick: () => this.put(notes) }, "Restore")]
                : []),
            ),
          )
        : [element("li", { className: "dim" }, "None.")]),
    );
  }

  // The page closes: what is typed goes along.
  leave() {
    for (const [id, { text, seen }] of this.drafts) {
      fetch(`/api/runs/${encodeURIComponent(id)}/notes`, {
        method: "PUT",
        keepalive: true,
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify({ notes: text, seen }),
      }).catch(() => undefined);
    }
  }
}
