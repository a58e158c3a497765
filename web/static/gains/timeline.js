// The history of parameter changes: who, when, old and new value, in which flight; each can be restored.

import { get } from "../core/api.js";
import { attempt, element, showNote } from "../core/dom.js";
import { exact, timeOf } from "../core/format.js";

const GESTURE = 5; // s between two values of one motion, as the vehicle has it
const REFRESH = 500; // ms between two looks while something changes
const MOST = 1000; // rows asked for

export class TimeLine {
  // name: of one parameter, "" for all.
  constructor(gains, place, { name = "", limit = 200 } = {}) {
    this.gains = gains;
    this.place = place;
    this.name = name;
    this.limit = limit;
    this.reason = element("div", { className: "reason", hidden: true, role: "status" });
    this.list = element("ol", { className: "timeline" });
    this.more = element(
      "button",
      {
        className: "link",
        hidden: true,
        onclick: () => {
          this.limit = Math.min(MOST, this.limit * 2);
          this.read();
        },
      },
      "Older",
    );
    this.place.append(this.reason, this.list, this.more);
    this.onConfirmed = ({ detail }) => this.confirmed(detail.name);
  }

  start() {
    this.gains.addEventListener("confirmed", this.onConfirmed);
    this.read();
  }

  stop() {
    this.gains.removeEventListener("confirmed", this.onConfirmed);
    clearTimeout(this.timer);
    this.timer = null;
  }

  confirmed(name) {
    if (!this.list.isConnected) {
      this.stop();
      return;
    }
    if ((this.name && name !== this.name) || this.timer) return;
    this.timer = setTimeout(() => {
      this.timer = null;
      this.read();
    }, REFRESH);
  }

  async read() {
    const query = new URLSearchParams({
      limit: String(this.limit),
      ...(this.name ? { name: this.name } : {}),
    });
    let read;
    try {
      read = await get(`/api/parameters/history?${query}`);
    } catch (error) {
      showNote(this.reason, error.message);
      return;
    }
    this.more.hidden = read.changes.length < this.limit || this.limit >= MOST;
    const entries = gestures(read.changes, this.gains.acts);
    this.list.replaceChildren(...entries.map((entry) => this.entry(entry)));
    if (entries.length === 0)
      this.list.append(
        element("li", { className: "empty" }, this.name ? "Never changed." : "Nothing has been changed yet."),
      );
  }

  entry(entry) {
    const changes = [...entry.changes],
      isOne = changes.length === 1;
    const title = isOne
      ? this.line(...changes[0])
      : element(
          "details",
          {},
          element("summary", {}, `${changes.length} values at once`),
          ...changes.map((change) => this.line(...change)),
        );
    const where = entry.flight ? element("span", { title: entry.flight }, "in flight") : "on the ground";
    const isBack = changes.every(([name, { old }]) => this.gains.value(name) === old);
    const back = element(
      "button",
      {
        disabled: !this.gains.isOperator || isBack,
        onclick: () => this.putBack(changes),
        title: isBack
          ? "already restored"
          : changes.map(([name, { old }]) => `${name} = ${exact(old)}`).join("\n"),
        ariaLabel: isOne
          ? `restore ${changes[0][0]} to ${exact(changes[0][1].old)}`
          : `restore ${changes.length} values`,
      },
      "Restore",
    );
    return element(
      "li",
      {},
      title,
      back,
      element(
        "div",
        { className: "facts" },
        `${timeOf(entry.stamp)} · ${entry.who} · `,
        where,
        entry.count > changes.length ? ` · ${entry.count} values` : "",
      ),
    );
  }

  line(name, { old, value }) {
    const label = this.name ? [] : [element("span", { className: "name" }, name), " "];
    return element(
      "div",
      { className: "change" },
      ...label,
      element("span", { className: "values" }, `${exact(old)} → ${exact(value)}`),
    );
  }

  async putBack(changes) {
    await attempt(this.reason, () =>
      this.gains.set(Object.fromEntries(changes.map(([name, { old }]) => [name, old])), true),
    );
    this.read();
  }
}

// Who keeps it; each counts revisions of its own.
const authorityOf = (name) => /^(station|simulator)\./.exec(name)?.[1] ?? "vehicle";

// Rows, newest first, as motions of one hand: those of a press on this page's slider, the same parameter
// again within five seconds, or several that were changed at once.
export function gestures(rows, acts = []) {
  const found = [];
  for (const row of rows) {
    const last = found.at(-1),
      known = last?.changes.get(row.name);
    const isSame = last && last.who === row.who && last.flight === row.flight;
    const act = acts.find(
      ({ name, from, to }) => name === row.name && row.revision > from && row.revision <= to,
    );
    const isAtOnce = last?.revision === row.revision && last?.authority === authorityOf(row.name) && !known;
    if (isSame && (isAtOnce || (known && last.act === act && (act || last.first - row.stamp < GESTURE)))) {
      if (known) known.old = row.old;
      else last.changes.set(row.name, { old: row.old, value: row.new });
      Object.assign(last, { first: row.stamp, revision: row.revision, count: last.count + 1 });
    } else {
      found.push({
        who: row.who,
        flight: row.flight,
        stamp: row.stamp,
        first: row.stamp,
        revision: row.revision,
        count: 1,
        act,
        authority: authorityOf(row.name),
        changes: new Map([[row.name, { old: row.old, value: row.new }]]),
      });
    }
  }
  return found;
}
