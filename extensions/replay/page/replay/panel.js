// Beside the view: what happened, line by line, and the parameters as they were at the play-head.

import { element } from "/static/core/dom.js";
import { exact } from "/static/core/format.js";
import { stamp } from "./play_head.js";

const MOST = 2000; // lines

// Events: `finding` with one whose evidence is to be shown.
export class ReplayPanel extends EventTarget {
  constructor(place, clock) {
    super();
    this.clock = clock;
    const tab = (name, label) =>
      element(
        "button",
        { role: "tab", id: `tab-${name}-button`, ariaSelected: "false", onclick: () => this.open(name) },
        label,
      );
    this.tabs = {
      events: tab("events", "Events"),
      parameters: tab("parameters", "Parameters"),
      notes: tab("notes", "Log"),
    };
    const nav = element("nav", {}, ...Object.values(this.tabs));
    nav.setAttribute("role", "tablist");
    this.findings = element("ol", { className: "happened findings" });
    this.events = element("ol", { className: "happened" });
    this.search = element("input", {
      type: "search",
      placeholder: "Search parameter",
      ariaLabel: "search parameters",
      oninput: () => this.fillParameters(),
    });
    this.changed = element(
      "button",
      {
        ariaPressed: "false",
        title: "only parameters changed before the play-head",
        onclick: () => this.toggleChanged(),
      },
      "Changed",
    );
    this.values = element("table", { className: "values" });
    this.bodies = {
      events: element("div", { className: "tab" }, this.findings, this.events),
      parameters: element(
        "div",
        { className: "tab" },
        element("div", { className: "tools" }, this.search, this.changed),
        this.values,
      ),
      notes: element("div", { className: "tab" }),
    };
    place.append(nav, ...Object.values(this.bodies));
    this.open("events");
    clock.addEventListener("time", () => this.move());
  }

  open(name) {
    this.shown = name;
    for (const [key, button] of Object.entries(this.tabs)) {
      button.setAttribute("aria-selected", String(key === name));
      this.bodies[key].hidden = key !== name;
    }
    if (this.runs) this.fillParameters();
  }

  setRuns(runs) {
    this.runs = runs;
    this.lines = runs
      .flatMap((run, k) => lines(run).map((line) => ({ ...line, at: line.t - run.shift, isOther: k > 0 })))
      .sort((a, b) => a.at - b.at)
      .slice(0, MOST);
    this.rows = this.lines.map((line) =>
      element(
        "li",
        { className: `of-${line.kind}${line.isOther ? " second" : ""}` },
        element(
          "button",
          {
            className: "link",
            title: "go there",
            onclick: () => {
              this.clock.pause();
              this.clock.seek(line.at);
            },
          },
          stamp(line.at, 1),
        ),
        element("span", {}, line.text),
      ),
    );
    this.events.replaceChildren(
      ...(this.rows.length ? this.rows : [element("li", { className: "empty" }, "No events in this run.")]),
    );
    const findings = runs.flatMap((run, k) =>
      run.description.findings.map((one) => ({ ...one, at: one.from - run.shift, isOther: k > 0 })),
    );
    this.findings.replaceChildren(
      ...findings.map((one) =>
        element(
          "li",
          { className: one.isOther ? "second" : "" },
          element(
            "button",
            {
              className: "link",
              title: "show the evidence",
              onclick: () => this.dispatchEvent(new CustomEvent("finding", { detail: one })),
            },
            stamp(one.at, 1),
          ),
          element("span", {}, one.text),
        ),
      ),
    );
    this.bodies.notes.replaceChildren(...runs.map(facts));
    this.filled = undefined;
    this.move();
  }

  move() {
    if (!this.runs) return;
    const before = this.lines.filter((line) => line.at <= this.clock.t + 1e-6).length;
    if (before !== this.before) {
      this.rows[this.before - 1]?.classList.remove("now");
      const now = this.rows[before - 1];
      now?.classList.add("now");
      if (now && this.shown === "events") bringInto(this.bodies.events, now);
      this.before = before;
    }
    this.fillParameters();
  }

  toggleChanged() {
    this.changed.setAttribute("aria-pressed", String(this.changed.getAttribute("aria-pressed") !== "true"));
    this.fillParameters();
  }

  // Only when another change has come in force, or something else is looked for.
  fillParameters() {
    if (this.shown !== "parameters") return;
    const { parameters, changes } = this.runs[0].description,
      t = this.clock.t + 1e-6,
      past = changes.filter((one) => one.t <= t);
    const only = this.changed.getAttribute("aria-pressed") === "true",
      key = `${past.length} ${only} ${this.search.value}`;
    if (key === this.filled) return;
    this.filled = key;
    const last = new Map(past.map((one) => [one.name, one])),
      words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const names = [...new Set([...Object.keys(parameters), ...last.keys()])].filter(
      (name) => (!only || last.has(name)) && words.every((word) => name.toLowerCase().includes(word)),
    );
    this.values.replaceChildren(
      element(
        "tbody",
        {},
        ...names.map((name) => {
          const change = last.get(name),
            value = change ? change.new : parameters[name];
          const note = change
            ? `was ${exact(change.old)}, ${stamp(change.t, 1)}${change.who ? ` by ${change.who}` : ""}`
            : "";
          return element(
            "tr",
            { className: change ? "changed" : "", title: note },
            element("td", {}, name, ...(note ? [element("small", {}, note)] : [])),
            element("td", {}, exact(value)),
          );
        }),
      ),
    );
    if (!names.length)
      this.values.replaceChildren(
        element(
          "caption",
          { className: "empty" },
          only ? "No changes up to here." : "No parameter with this name in the log.",
        ),
      );
  }
}

function lines({ description: { events, marks, changes, spans } }) {
  return [
    ...events.map(({ t, text, warn }) => ({
      t,
      text: warn ? `⚠ ${text}` : text,
      kind: warn ? "warn" : "event",
    })),
    ...marks.map(({ t, text, who }) => ({
      t,
      text: `▼ ${text || "mark"}${who ? ` (${who})` : ""}`,
      kind: "mark",
    })),
    ...changes.map(({ t, name, old, new: value, who }) => ({
      t,
      text: `${name}: ${exact(old)} → ${exact(value)}${who ? `, ${who}` : ""}`,
      kind: "change",
    })),
    ...spans.behavior.map(({ from, text }) => ({
      t: from,
      text: `behavior ${text.replaceAll("_", " ")}`,
      kind: "behavior",
    })),
  ];
}

// What the log holds, and what is missing of it.
function facts(run) {
  const { topics, problems, tear, damaged_chunks: damaged, duration } = run.description;
  const row = (name, value, title = "") =>
    element("tr", { title }, element("td", {}, name), element("td", {}, value));
  return element(
    "section",
    {},
    element("h2", {}, run.id),
    ...(tear
      ? [element("p", { className: "warn" }, `Cut off: it ${tear}. The complete part is shown.`)]
      : []),
    ...(damaged ? [element("p", { className: "warn" }, `${damaged} damaged parts are left out.`)] : []),
    ...Object.entries(problems).map(([topic, why]) =>
      element("p", { className: "warn" }, `${topic}: ${why}`),
    ),
    element(
      "table",
      { className: "values" },
      element(
        "tbody",
        {},
        ...Object.entries(topics).map(([name, { type, count }]) =>
          row(
            name,
            `${(count / Math.max(duration, 1e-9)).toFixed(count > duration ? 0 : 2)} Hz`,
            `${type}, ${count} messages`,
          ),
        ),
      ),
    ),
  );
}

// Scrolls the list alone: on a phone the page itself stays where it is.
/** @param {HTMLElement} list @param {HTMLElement} line */
function bringInto(list, line) {
  const frame = list.getBoundingClientRect(),
    box = line.getBoundingClientRect();
  list.scrollTop += Math.max(0, box.bottom - frame.bottom) - Math.max(0, frame.top - box.top);
}
