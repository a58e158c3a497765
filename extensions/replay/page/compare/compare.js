// The page that compares runs: opens them, aligns them at an event, and hands them to charts and tables. Its
// address reproduces the view: /compare?run=A&run=B#at=take_off&s=state.position.z

import { derive, derivedSignals } from "/static/charts/derived.js";
import { ChartMenu, MOST } from "/static/charts/signal_menu.js";
import { get } from "/static/core/api.js";
import { $, element, setText } from "/static/core/dom.js";
import { head } from "/static/core/page_header.js";
import { showPanels } from "/static/console/panels.js";
import { icon } from "/static/icons/icons.js";
import { Run } from "../replay/run.js";
import { moment } from "/static/core/format.js";
import { state } from "/static/runs/labels.js";
import { CompareCharts } from "./charts.js";
import { look } from "./source.js";
import { metricsTable, parametersTable } from "./tables.js";

const MOST_RUNS = 12,
  MANY = 4; // runs; more than these are shown one a chart at first
const USUAL = ["state.position.x", "state.position.z", "error.distance"];
const EVENTS = ["take_off", "arming", "start"]; // the first that all runs have
const LINK_PERIOD = 300; // ms between two changes of the address

const ids = [...new Set(new URLSearchParams(location.search).getAll("run"))];

// One run's line: its letter, when it was, and what became of opening it.
function chip(id, k) {
  const { letter, stroke } = look(k),
    words = element("span", { className: "note" }, "waiting …"),
    bar = element("progress", { max: 1, hidden: true, ariaLabel: `share of ${id} that is read` });
  const drop = element(
    "a",
    {
      href: addressOf(ids.filter((other) => other !== id)),
      title: `compare without ${id}`,
      ariaLabel: `remove ${id}`,
    },
    icon("close"),
  );
  const mark = element("b", {}, letter),
    place = element(
      "li",
      {},
      mark,
      element("a", { href: `/replay/${encodeURIComponent(id)}`, title: "replay" }, id),
      words,
      bar,
      drop,
    );
  mark.style.setProperty("--line-style", stroke);
  $("compared").append(place);
  return {
    read(share) {
      setText(words, `reading, ${Math.round(100 * share)} %`);
      bar.value = share;
      bar.hidden = false;
    },
    say(text, isProblem = false) {
      words.textContent = text;
      bar.hidden = true;
      place.classList.toggle("warn", isProblem);
    },
  };
}

const addressOf = (runs) =>
  `/compare?${runs.map((id) => `run=${encodeURIComponent(id)}`).join("&")}${location.hash}`;

// The run, or null with the reason in its line.
async function open(id, k, entry, line) {
  try {
    if (entry?.recording) throw new Error("is still being recorded: compare it when it is closed");
    const run = Object.assign(await Run.open(id, (share) => line.read(share), { hasTrack: false }), {
      number: k,
    });
    if (run.description.is_growing) throw new Error("is still being recorded: compare it when it is closed");
    line.say(
      [
        run.begun === null ? "simulated time" : moment(entry ? 1e-9 * entry.start_ns : run.begun), // as the list has it
        entry?.operator,
        entry && state(entry)[1] ? state(entry)[0] : "",
      ]
        .filter(Boolean)
        .join(" · "),
    );
    return run;
  } catch (error) {
    line.say(error.message, true);
    return null;
  }
}

function say(text, isProblem = false) {
  $("state").textContent = text;
  $("state").hidden = !text;
  $("state").classList.toggle("warn", isProblem);
}

class Page {
  constructor(runs, derived) {
    this.runs = runs;
    const given = new URLSearchParams(location.hash.slice(1)),
      signals = new Map(runs.flatMap((run) => [...run.signals]));
    this.charts = new CompareCharts($("signals"), runs, (text) => say(text, true));
    const names = given
      .getAll("s")
      .filter((name) => signals.has(name))
      .slice(0, MOST);
    this.charts.names = names.length ? names : USUAL.filter((name) => signals.has(name));
    this.charts.isSplit = given.has("split") ? given.get("split") === "1" : runs.length > MANY;
    this.charts.hasDifference = given.get("difference") !== "0";
    this.tools(signals, derived);
    this.align(given.get("at"));
    const width = [given.get("from"), given.get("to")].map(Number);
    if (given.has("to") && width[0] < width[1]) this.charts.range.show(width[0], width[1]);
    this.charts.draw();
    this.charts.range.addEventListener("range", () => this.link());
    this.link();
  }

  // Events that all runs have, by kind; of each run the first such moment.
  get events() {
    const [first, ...others] = this.runs.map((run) => run.description.moments);
    return first.filter(
      ({ kind }, k) =>
        kind !== "mark" &&
        first.findIndex((one) => one.kind === kind) === k &&
        others.every((moments) => moments.some((one) => one.kind === kind)),
    );
  }

  align(wanted) {
    const { events } = this,
      kinds = events.map(({ kind }) => kind);
    this.at = kinds.includes(wanted) ? wanted : EVENTS.find((kind) => kinds.includes(kind));
    for (const run of this.runs) run.shift = run.description.moments.find(({ kind }) => kind === this.at).t;
    this.event.value = this.at;
    this.charts.shifted();
  }

  tools(signals, derived) {
    const { charts, runs } = this;
    this.event = element(
      "select",
      {
        ariaLabel: "event at which the runs are aligned",
        onchange: () => {
          this.align(this.event.value);
          this.link();
        },
      },
      ...this.events.map(({ kind, label }) => element("option", { value: kind }, label)),
    );
    const toggle = (label, title, name) =>
      element(
        "button",
        {
          title,
          ariaPressed: String(charts[name]),
          onclick: ({ currentTarget }) => {
            charts[name] = !charts[name];
            currentTarget.ariaPressed = String(charts[name]);
            charts.draw();
            this.link();
          },
        },
        label,
      );
    const all = [
      ...[...signals.values()].filter(({ name }) => !derived.includes(name)),
      ...derived.map((name) => signals.get(name)),
    ];
    const menu = new ChartMenu(
      { signals: all, named: all.filter(({ known }) => known).length },
      async (text) => {
        const signal = await derive(text, (texts) => runs[0].expressions(texts));
        await Promise.all(runs.map((run) => run.learn([signal.name])));
        return signal;
      },
    );
    const page = this,
      place = element("div", { className: "picker" });
    place.ariaLabel = "the charts";
    // What the menu takes for a chart: the page's list of signals.
    const picked = {
      place,
      units: [],
      scales: {},
      limits: {},
      get names() {
        return charts.names;
      },
      select(names) {
        charts.names = names;
        charts.draw();
        page.link();
      },
    };
    const choose = element(
      "button",
      {
        ariaExpanded: "false",
        title: "choose signals",
        onclick: () => menu.toggle(picked, choose, () => {}),
      },
      "Signals",
    );
    place.append(choose);
    $("tools").append(
      element("label", {}, "aligned at", this.event),
      place,
      toggle("Difference", "each run minus the first one", "hasDifference"),
      toggle("One chart per run", "small charts with one scale", "isSplit"),
      element(
        "button",
        { title: "show the whole time (double-click a chart)", onclick: () => charts.range.reset() },
        "Whole time",
      ),
    );
  }

  // The view in the address, so that it can be passed on.
  link() {
    if (this.linking) return;
    this.linking = setTimeout(() => {
      this.linking = 0;
      const { names, isSplit, hasDifference, range } = this.charts,
        words = new URLSearchParams({
          at: this.at,
          split: isSplit ? "1" : "0",
          difference: hasDifference ? "1" : "0",
        });
      for (const name of names) words.append("s", name);
      if (range.isZoomed)
        for (const [word, time] of /** @type {[string, number][]} */ ([
          ["from", range.start],
          ["to", range.end],
        ]))
          words.set(word, time.toFixed(3));
      history.replaceState(null, "", `${location.search}#${words}`);
    }, LINK_PERIOD);
  }
}

async function start() {
  const session = await get("/api/session");
  head(session, "/runs");
  showPanels({ session });
  document.title = `Compare ${ids.length} runs`;
  if (ids.length < 2) {
    say("Select two or more runs on the Runs page, then press Compare.");
    return;
  }
  if (ids.length > MOST_RUNS)
    say(`${MOST_RUNS} of ${ids.length} runs are shown: compare fewer at a time.`, true);
  const about = new Map((await get("/api/runs?limit=1000").catch(() => [])).map((run) => [run.id, run]));
  const lines = ids.slice(0, MOST_RUNS).map(chip),
    runs = [];
  for (const [k, line] of lines.entries()) {
    // the server prepares one at a time
    const run = await open(ids[k], k, about.get(ids[k]), line);
    if (run) runs.push(run);
  }
  if (runs.length < 2) {
    say(
      runs.length ? "Only one of these runs can be compared." : "None of these runs can be compared.",
      true,
    );
    return;
  }
  const words = new URLSearchParams(location.hash.slice(1)).getAll("s");
  const derived = (await derivedSignals((texts) => runs[0].expressions(texts), words)).map(
    ({ name }) => name,
  );
  if (derived.length) await Promise.all(runs.map((run) => run.learn(derived)));
  for (const section of document.querySelectorAll("main > section"))
    /** @type {HTMLElement} */ (section).hidden = false;
  new Page(runs, derived);
  $("parameters").append(...parametersTable(runs));
  const reports = await Promise.all(
    runs.map((run) =>
      about.get(run.id)?.report
        ? get(`/api/runs/${encodeURIComponent(run.id)}/report`).catch(() => null)
        : null,
    ),
  );
  $("metrics").append(...metricsTable(runs, reports));
}

start().catch((error) => say(error.message, true));
