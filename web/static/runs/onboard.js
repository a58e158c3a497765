// The vehicle's own logs: what it has, fetching one to this computer, and how far that is.

import { get, request } from "../core/api.js";
import { isThere } from "../core/vehicle_path.js";
import { element } from "../core/dom.js";
import { bytes, duration, moment } from "../core/format.js";
import { ENDED, Progress } from "./fill.js";
import { Panel } from "./panel.js";

export class Onboard extends Panel {
  constructor(place, opener, page, events) {
    super(
      place,
      opener,
      page,
      "Onboard logs",
      "log",
      "start",
      "duration",
      "size",
      "state",
      "on this computer",
      "",
    );
    this.rows = new Map(); // name → { log, cell, button, progress }
    this.transfers = events.summary.transfers ?? [];
    events.on("summary", ({ transfers }) => {
      if (transfers) this.follow(transfers);
    });
    events.addEventListener("open", () => this.refresh());
    this.note.role = "status";
    this.head.append(element("button", { onclick: () => this.refresh() }, "List again"));
  }

  open(wanted) {
    super.open(wanted);
    if (wanted) this.refresh();
  }

  async refresh() {
    if (this.place.hidden) return;
    try {
      const { vehicle, free_bytes: free, logs } = await get("/api/onboard");
      this.note.textContent = logs.length
        ? `Logs written on board ${vehicle}, with every tick; ${bytes(free)} free on board. Runs are ` +
          "completed from them automatically."
        : `${vehicle} has no logs; it writes one from arming to disarming.`;
      this.show(logs);
    } catch (error) {
      this.note.textContent = error.message;
      this.show([]);
    }
  }

  show(logs) {
    this.rows.clear();
    this.fill(logs.map((log) => this.row(log)));
    this.draw();
  }

  row(log) {
    const cell = element("td"),
      progress = new Progress(`fetching ${log.name}`);
    const button = element("button", {
      disabled: !this.page.isOperator,
      title: this.page.isOperator ? "" : "operators fetch logs",
      onclick: () => this.act(log.name),
    });
    this.rows.set(log.name, { log, cell, button, progress });
    const state = !log.closed
      ? log.start === null
        ? "torn"
        : "being written"
      : log.recovered
        ? "repaired"
        : "closed";
    const length = log.start === null || log.end === null ? "–" : duration(log.end - log.start);
    return element(
      "tr",
      {},
      ...[log.name, log.start === null ? "–" : moment(log.start), length, bytes(log.bytes), state].map(
        (text) => element("td", {}, text),
      ),
      cell,
      element("td", {}, button),
    );
  }

  // What is under way; the list is asked for again when something has ended.
  follow(transfers) {
    const ended = ({ kind, phase }) => kind === "download" && ENDED.includes(phase);
    const before = new Set(this.transfers.filter(ended).map(({ name }) => name));
    this.transfers = transfers;
    this.draw();
    if (transfers.some((one) => ended(one) && !before.has(one.name))) this.refresh();
  }

  draw() {
    for (const [name, { log, cell, button, progress }] of this.rows) {
      const transfer = this.transfers.find((one) => one.kind === "download" && one.name === name);
      const isUnderWay = Boolean(transfer) && !ENDED.includes(transfer.phase);
      if (transfer && (isUnderWay || transfer.problem)) {
        progress.show(transfer);
        if (cell.firstChild !== progress.place) cell.replaceChildren(progress.place);
      } else if (cell.dataset.here !== (log.here ?? "") || cell.firstChild === progress.place) {
        cell.replaceChildren(
          log.here && isThere("replay")
            ? element("a", { href: `/replay/${encodeURIComponent(log.here)}` }, "Replay")
            : "–",
        );
        cell.dataset.here = log.here ?? "";
      }
      const word = isUnderWay ? "Cancel" : "Download";
      if (button.textContent !== word) {
        button.textContent = word;
        button.ariaLabel = `${word} ${name}`;
      }
      button.hidden = !isUnderWay && Boolean(log.here);
    }
  }

  async act(name) {
    const word = this.rows.get(name).button.textContent === "Cancel" ? "cancel" : "download";
    try {
      await request("POST", `/api/onboard/${encodeURIComponent(name)}/${word}`);
    } catch (error) {
      this.page.say(error.message);
    }
  }
}
