// The page of runs: recorded flights, what people say about them, and what can be done with them.

import { get, request } from "../core/api.js";
import { $, element } from "../core/dom.js";
import { onKey } from "../core/keys.js";
import { head } from "../core/page_header.js";
import { RunDetail } from "./detail.js";
import { RunList } from "./list.js";
import { Onboard } from "./onboard.js";
import { Gauge } from "./storage.js";
import { Trash } from "./trash.js";
import { query } from "./labels.js";
import { showPanels } from "../console/panels.js";
import { Events } from "../core/sockets.js";
import { here, isThere } from "../core/vehicle_path.js";

const TYPING_PAUSE = 200; // ms

class RunsPage {
  constructor(session, events) {
    this.isOperator = session.role !== "viewer";
    this.gauge = new Gauge($("gauge"));
    const wanted = () => query($("search").value, $("tag").value, $("of-vehicle").value);
    this.list = new RunList(
      $("list"),
      (offset, limit) => get(`/api/runs/search?${wanted()}&offset=${offset}&limit=${limit}`),
      () => (wanted().toString() ? "No runs match." : "No runs yet. Recording starts on arming."),
    );
    this.trash = new Trash($("trash"), $("open-trash"), this, session.role === "admin");
    this.onboard = new Onboard($("onboard"), $("open-onboard"), this, events);
    this.detail = new RunDetail($("detail"), this, events);
    this.list.addEventListener("choice", () => this.detail.show(this.list.current, this.list.chosen));
    this.list.addEventListener("loaded", () => this.loaded());
    this.list.addEventListener("open", () => {
      if (this.list.current && isThere("replay"))
        location.assign(here(`/replay/${encodeURIComponent(this.list.current.id)}`));
    });
    this.list.addEventListener("remove", () => this.remove());
    this.list.addEventListener("edit", ({ detail }) => this.detail.edit(detail));
    let typing = null;
    $("search").addEventListener("input", () => {
      clearTimeout(typing);
      typing = setTimeout(() => this.list.reset(), TYPING_PAUSE);
    });
    for (const id of ["tag", "of-vehicle"]) $(id).addEventListener("change", () => this.list.reset());
    $("of-vehicle").append(...session.vehicles.map((name) => element("option", { value: name }, name)));
    this.list.table.classList.toggle("several", session.vehicles.length > 1);
    $("of-vehicle").parentElement.hidden = session.vehicles.length < 2;
    onKey("/", "search runs", () => $("search").focus());
    this.follow(events);
    this.list.reset();
    this.changed();
  }

  // What others do, and what is being recorded.
  follow(events) {
    events.on("runs", () => this.changed(true));
    events.on("summary", ({ station }) => {
      if (!station || station.recording === this.recording) return;
      const isFirst = this.recording === undefined;
      this.recording = station.recording;
      if (!isFirst) setTimeout(() => this.changed(true), 500); // the catalogue is a little behind
    });
    events.on("summary", ({ transfers }) => this.transferred(transfers));
    events.addEventListener("open", () => this.changed(true));
  }

  // A run was compared or filled: its line says so.
  transferred(transfers) {
    if (!transfers) return;
    const phases = JSON.stringify(
      transfers.filter(({ kind }) => kind === "backfill").map(({ name, phase }) => [name, phase]),
    );
    if (this.phases !== undefined && phases !== this.phases) this.list.refresh();
    this.phases = phases;
  }

  // One of the panels that lie over the list.
  only(panel) {
    for (const other of [this.trash, this.onboard])
      if (other !== panel && !other.place.hidden) other.open(false);
    $("list").hidden = true;
  }

  // One round at a time, so that an old answer never follows a newer one.
  async changed(lists = false) {
    if (lists) this.list.refresh();
    if (this.asking) {
      this.askAgain = true;
      return;
    }
    this.asking = true;
    do {
      this.askAgain = false;
      try {
        const [tags] = await Promise.all([get("/api/tags"), this.gauge.refresh(), this.trash.refresh()]);
        this.showTags(tags);
      } catch (error) {
        this.say(error.message);
      }
    } while (this.askAgain);
    this.asking = false;
  }

  showTags(tags) {
    const chosen = $("tag").value,
      names = tags.map(({ tag }) => tag);
    this.tags = names;
    const options = tags.map(({ tag, runs }) => element("option", { value: tag }, `${tag} (${runs})`));
    $("tag").replaceChildren(element("option", { value: "" }, "all"), ...options);
    $("tag").value = names.includes(chosen) ? chosen : "";
    this.detail.suggest(names);
    if ($("tag").value !== chosen) this.list.reset();
  }

  loaded() {
    const { total, problem } = this.list;
    $("count").textContent = problem || `${total} ${total === 1 ? "run" : "runs"}`;
    this.detail.show(this.list.current, this.list.chosen);
  }

  // To the trash, with undo; the chosen ones, else the one under the cursor.
  async remove() {
    const runs = this.list.picked;
    if (!this.isOperator || !runs.length) return;
    await this.attempt(async () => {
      const { done, refused } = await request("POST", "/api/trash", { runs });
      const reasons = Object.values(refused);
      this.list.unchoose(done);
      const what = done.length === 1 ? `Deleted ${done[0]}` : `Deleted ${done.length} runs`;
      const kept = `kept in the trash for ${this.gauge.days} days`;
      const parts = [...(done.length ? [`${what}; ${kept}.`] : []), ...reasons];
      this.say(parts.join(" "), done.length ? () => this.restore(done) : null);
    });
  }

  async restore(runs) {
    await this.attempt(async () => {
      const { done, refused } = await request("POST", "/api/trash/restore", { runs });
      this.say(
        [
          `Brought back ${done.length === 1 ? done[0] : `${done.length} runs`}.`,
          ...Object.values(refused),
        ].join(" "),
      );
    });
  }

  async attempt(act) {
    try {
      await act();
    } catch (error) {
      this.say(error.message);
    }
    this.changed(true);
  }

  // undo: asked for by a button beside the text.
  /** @param {(() => unknown) | null} undo */
  say(text, undo = null) {
    const close = element(
      "button",
      {
        className: "link",
        ariaLabel: "dismiss",
        onclick: () => {
          $("notice").hidden = true;
        },
      },
      "Dismiss",
    );
    const button = undo ? [element("button", { onclick: undo }, "Undo")] : [];
    $("notice").replaceChildren(element("span", {}, text), ...button, close);
    $("notice").hidden = false;
  }
}

async function start() {
  const session = await get("/api/session");
  const events = new Events();
  head(session, "/runs", events);
  new RunsPage(session, events);
  showPanels({ events, session });
}

start().catch((error) => {
  $("notice").hidden = false;
  $("notice").textContent = `The page could not start: ${error.message}`;
});
