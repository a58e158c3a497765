// The trash: what was deleted, by whom, and how long it can still be brought back.

import { get, request } from "../core/api.js";
import { element } from "../core/dom.js";
import { bytes, duration, moment } from "../core/format.js";
import { onHold } from "../core/hold_button.js";
import { lasting } from "./storage.js";
import { Panel } from "./panel.js";

const DAY = 86400; // s

export class Trash extends Panel {
  constructor(place, opener, page, isAdmin) {
    super(place, opener, page, "Trash", "run", "duration", "size", "deleted", "by", "removed for good", "");
    this.empty = element(
      "button",
      {
        className: "hold",
        disabled: !isAdmin,
        title: isAdmin
          ? "hold for 1 s: removes all of it for good"
          : "only admins empty the trash before its time",
      },
      "Empty trash",
    );
    onHold(this.empty, 1000, () => this.act("/api/trash/empty", {}));
    this.head.append(this.empty);
  }

  async refresh() {
    const [runs, { trash_days: days }] = await Promise.all([get("/api/trash"), get("/api/storage")]);
    this.opener.textContent = runs.length ? `Trash (${runs.length})` : "Trash";
    this.empty.hidden = !runs.length;
    this.note.textContent = runs.length
      ? `Runs are deleted permanently after ${Number(days.toFixed(2))} days here. The vehicle's own ` +
        "logs are not touched."
      : "The trash is empty.";
    this.fill(runs.map((run) => this.row(run, days)));
  }

  row(run, days) {
    const deleted = run.deleted_ns / 1e9,
      left = Math.max(0, deleted + days * DAY - Date.now() / 1e3);
    const back = element(
      "button",
      {
        disabled: !this.page.isOperator,
        ariaLabel: `restore ${run.id}`,
        onclick: () => this.act("/api/trash/restore", { runs: [run.id] }),
      },
      "Restore",
    );
    return element(
      "tr",
      {},
      ...[
        run.id,
        duration(run.duration),
        bytes(run.bytes),
        moment(deleted),
        run.requester || "–",
        `in ${lasting(left)}`,
      ].map((text) => element("td", {}, text)),
      element("td", {}, back),
    );
  }

  async act(path, body) {
    try {
      const { done, refused } = await request("POST", path, body);
      const verb = path.endsWith("empty") ? "Removed for good" : "Brought back";
      this.page.say(
        [`${verb}: ${done.length === 1 ? done[0] : `${done.length} runs`}.`, ...Object.values(refused)].join(
          " ",
        ),
      );
      await this.refresh();
    } catch (error) {
      this.page.say(error.message);
    }
  }
}
