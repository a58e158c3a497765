// The replay page: opens one run or two and hands them to the parts.

import { derivedSignals } from "/static/charts/derived.js";
import { get } from "/static/core/api.js";
import { $, element } from "/static/core/dom.js";
import { head } from "/static/core/page_header.js";
import { showPanels } from "/static/console/panels.js";
import { Alignment } from "./align.js";
import { ReplayChart } from "./chart.js";
import { ReplayPictures } from "./pictures.js";
import { PlayHead } from "./play_head.js";
import { TimeLine } from "./timeline.js";
import { ReplayPanel } from "./panel.js";
import { Range } from "./range.js";
import { Reading } from "./reading.js";
import { Run } from "./run.js";
import { ReplayScene } from "./scene.js";
import { ReplayTable } from "./table.js";
import { Transport } from "./transport.js";
import { pathname } from "/static/core/vehicle_path.js";

const main = document.querySelector("main");
// of an exported page's, else of the address
const ID = document.body.dataset.run ?? decodeURIComponent(pathname.split("/")[2]);
const WITH = new URLSearchParams(location.search).get("with");
const PLAYING_PERIOD = 80; // ms between two questions for values while it plays
const EVIDENCE = 10; // s, shown around a finding
const LINK_PERIOD = 300; // ms between two changes of the address

const AREAS = ["view", "side", "c0", "c1", "table", "play"]; // outlined while the run is read

function say(text, problem = false) {
  $("state").hidden = !text;
  $("state").textContent = text;
  $("state").classList.toggle("warn", problem);
}

async function start() {
  const session = await get("/api/session");
  head(session, "/runs", null, { emergency: !session.pages, strip: !session.pages });
  showPanels({ session });
  document.title = `${ID} · replay`;
  const options = { newer: new URLSearchParams(location.search).has("newer") };
  const runs = await read(options);
  const [lead, other] = runs,
    derived = await derivedSignals((texts) => lead.expressions(texts));
  lead.description.signals.push(...derived);
  for (const signal of derived) lead.signals.set(signal.name, signal);
  if (derived.length) await other?.learn(derived.map(({ name }) => name));
  say("");
  for (const section of main.querySelectorAll("section")) section.hidden = false;
  new Page(runs, await others(ID));
}

// The run and the one over it; how far it is, meanwhile.
async function read(options) {
  const reading = new Reading($("state"), main, AREAS),
    open = (id, more) => Run.open(id, (share) => reading.show(id, share), more);
  try {
    return [await open(ID, options), ...(WITH && WITH !== ID ? [await open(WITH)] : [])];
  } finally {
    reading.end();
  }
}

async function others(id) {
  const [runs, onboard] = await Promise.all([
    get("/api/runs").catch(() => []),
    get("/api/replay").catch(() => []),
  ]);
  return [...(Array.isArray(runs) ? runs : (runs.runs ?? [])), ...onboard]
    .map((run) => run.id)
    .filter((one) => one !== id);
}

class Page {
  constructor(runs, choices) {
    this.runs = runs;
    const clock = (this.clock = new PlayHead()),
      range = (this.range = new Range(clock));
    range.events = runs[0].events;
    this.scene = new ReplayScene($("view"), clock);
    this.pictures = new ReplayPictures($("view"), clock);
    this.charts = [0, 1].map((index) => new ReplayChart($(`chart-${index}`), index, clock, range));
    this.table = new ReplayTable($("table"));
    this.line = new TimeLine($("line"), clock, range);
    this.transport = new Transport($("transport"), clock, range, () => this.address);
    this.panel = new ReplayPanel($("side"), clock);
    this.alignment = new Alignment($("runs-shown"), runs, choices, (id) => {
      location.href = `${location.pathname}${id ? `?with=${encodeURIComponent(id)}` : ""}${location.hash}`;
    });
    this.growing(runs[0]);
    this.restore();
    this.alignment.addEventListener("shift", () => this.shifted());
    this.line.addEventListener("shift", ({ detail }) => this.alignment.move(detail));
    this.measure();
    this.table.setRuns(runs);
    this.panel.setRuns(runs);
    this.scene.setRuns(runs);
    this.pictures.setRuns(runs);
    this.line.setRuns(runs);
    this.transport.setRuns(runs);
    for (const chart of this.charts) {
      chart.addEventListener("drawn", () => this.told());
      chart.addEventListener("select", () => this.ask(true));
      chart.addEventListener("problem", ({ detail }) => say(detail, true));
      chart.setRuns(runs);
    }
    const shown = new URLSearchParams(location.hash.slice(1)).get("s");
    if (shown) this.charts[0].showOnly(shown.split(","));
    this.panel.addEventListener("finding", ({ detail }) => {
      clock.pause();
      clock.seek(detail.at);
      range.setWidth(EVIDENCE);
      this.charts[0].showOnly(detail.signals);
    });
    clock.addEventListener("time", () => this.moved());
    clock.addEventListener("change", () => this.link());
    range.addEventListener("range", () => this.link());
    range.follow();
    this.moved();
  }

  // From the first run's beginning or the second's to the end of both.
  measure() {
    const { clock, runs } = this;
    clock.setRange(
      Math.min(0, ...runs.map((run) => -run.shift)),
      Math.max(...runs.map((run) => run.duration - run.shift)),
    );
    this.range.follow();
  }

  shifted() {
    this.again = true; // of the second run there are other values now, also while some are on their way
    delete main.dataset.shown;
    this.measure();
    this.panel.setRuns(this.runs);
    this.line.fill();
    for (const chart of this.charts) chart.shifted();
    this.moved();
    this.link();
  }

  moved() {
    if (!this.frame)
      this.frame = requestAnimationFrame(() => {
        this.frame = 0;
        this.scene.draw();
        this.drawn = this.clock.t;
        this.told();
      });
    this.ask();
    this.link();
  }

  // Values at the play-head: one question at a time, the newest instant next.
  async ask(again = false) {
    this.again ||= again;
    if (this.asking || (this.valuesAt === this.clock.t && !this.again)) return;
    this.asking = true;
    this.again = false;
    const t = this.clock.t,
      names = [...new Set([...this.table.names, ...this.charts.flatMap((chart) => chart.names)])];
    try {
      const values = new Map(
        await Promise.all(
          this.runs.map(async (run) => [
            run,
            run.known(names).length ? await run.at(names, t + run.shift) : {},
          ]),
        ),
      );
      this.table.put(values, t);
      for (const chart of this.charts) chart.put(values);
      this.valuesAt = t;
      if ($("state").classList.contains("warn")) say("");
    } catch (error) {
      say(error.message, true);
      await new Promise((resolve) => setTimeout(resolve, 1000));
    }
    if (this.clock.playing) await new Promise((resolve) => setTimeout(resolve, PLAYING_PERIOD));
    this.asking = false;
    this.told();
    this.ask();
  }

  // Everything shows this instant: written where a test or a script can see it.
  told() {
    const { clock, charts } = this;
    if (
      clock.playing ||
      this.again ||
      this.drawn !== clock.t ||
      this.valuesAt !== clock.t ||
      !charts.every((chart) => chart.settled)
    )
      return;
    main.dataset.shown = clock.t.toFixed(3);
  }

  // The moment in the address, so that it can be passed on.
  link() {
    if (this.linking) return;
    this.linking = setTimeout(() => {
      this.linking = 0;
      history.replaceState(null, "", this.address);
    }, LINK_PERIOD);
  }

  get address() {
    const words = new URLSearchParams({ t: this.clock.t.toFixed(3) });
    if (this.range.width) words.set("w", String(this.range.width));
    if (this.alignment.labels) {
      const [first, second] = this.alignment.labels;
      words.set("a", first);
      words.set("b", second);
      if (this.alignment.hand) words.set("by", this.alignment.hand.toFixed(2));
    }
    return `#${words}`;
  }

  restore() {
    const words = new URLSearchParams(location.hash.slice(1)),
      width = Number(words.get("w"));
    const t = Number(words.get("t") ?? new URLSearchParams(location.search).get("at"));
    if (words.has("a")) this.alignment.restore(words.get("a"), words.get("b"), Number(words.get("by")) || 0);
    this.measure();
    if (width > 0) this.range.setWidth(width);
    if (Number.isFinite(t)) this.clock.seek(t);
  }

  growing(run) {
    const { is_growing: growing, is_current: current } = run.description;
    if (!growing && current) return;
    const url = new URL(location.href);
    url.searchParams.set("newer", "");
    $("runs-shown").append(
      element("span", { className: "warn" }, "● still being recorded; shown up to when it was opened"),
      element("a", { href: url.href }, "Show the rest"),
    );
  }
}

start().catch((error) => say(error.message, true));
