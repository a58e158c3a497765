// Trends, below the list of runs: a figure of reports, or of campaigns over logs, over time, for each vehicle, battery
// pack or tag. It is of the runs that the page's search finds.

import { get } from "/static/core/api.js";
import { $, attempt, element, optionsOf, setText, svg } from "/static/core/dom.js";
import { day } from "/static/core/format.js";
import { timeZone } from "/static/core/time_zone.js";
import { here, isThere } from "/static/core/vehicle_path.js";
import { titleOf } from "/static/experiments/figures.js";
import { query } from "/static/runs/labels.js";
import { short, titled } from "./drawings.js";

const WIDTH = 720,
  HEIGHT = 150,
  LEFT = 56,
  RIGHT = 8,
  TOP = 8,
  BOTTOM = 18;
const DAY = 86400; // s

export function show(place) {
  new Trends(place);
}

class Trends {
  reads = 0;

  constructor(place) {
    const choice = (label) => element("select", { ariaLabel: label, onchange: () => this.read() });
    this.metric = choice("figure");
    this.by = choice("grouped by");
    this.reason = element("p", { className: "reason", hidden: true });
    this.empty = element("p", { className: "empty", hidden: true });
    this.drawing = element("div", { className: "series" });
    this.all = element(
      "details",
      { ontoggle: () => this.read() },
      element("summary", {}, "Trends"),
      element("div", { className: "choices" }, this.metric, "by", this.by),
      this.reason,
      this.empty,
      this.drawing,
    );
    place.append(this.all);
    timeZone.addEventListener("change", () => this.read());
    for (const id of ["search", "tag", "of-vehicle"]) $(id)?.addEventListener("change", () => this.read());
  }

  async read() {
    if (!this.all.open) return;
    const turn = ++this.reads;
    await attempt(this.reason, async () => {
      const wanted = query($("search").value, $("tag").value, $("of-vehicle").value);
      if (this.metric.value) wanted.set("metric", this.metric.value);
      wanted.set("by", this.by.value || "all");
      const found = await get(`/api/trends?${wanted}`);
      if (turn === this.reads) this.show(found); // answers may come in another order
    });
  }

  show({ metrics, metric, by, groups, series }) {
    this.metric.replaceChildren(...optionsOf(metrics.map(titled), metric));
    this.by.replaceChildren(...optionsOf(groups, by));
    this.empty.hidden = series.length > 0;
    setText(
      this.empty,
      metrics.length ? `No run has a tag that begins with “${by}”.` : "No run has a report yet.",
    );
    const times = series.flatMap(({ points }) => points.map(({ time }) => time));
    const values = series.flatMap(({ points }) => points.map(({ value }) => value));
    /** @type {(all: number[]) => [number, number]} */
    const range = (all) => [Math.min(...all), Math.max(...all)];
    this.drawing.replaceChildren(
      ...series.map((one) =>
        element("figure", {}, caption(one), drawn(one, metric, range(times), range(values))),
      ),
    );
  }
}

function caption({ name, points, slope, interval }) {
  const count = `${points.length} ${points.length === 1 ? "run" : "runs"}`;
  if (slope === null) return element("figcaption", {}, element("b", {}, name), ` ${count}`);
  const isClear = interval[0] * interval[1] > 0; // the interval is on one side of none
  const change = `${short(slope, 3)} a day (95 %: ${interval.map((value) => short(value, 3)).join(" … ")})`;
  const mark = element("span", { className: isClear ? "amber" : "" }, change);
  return element("figcaption", {}, element("b", {}, name), ` ${count}, `, mark);
}

function drawn({ name, points }, metric, [first, last], [low, high]) {
  const span = high - low || Math.abs(high) || 1;
  const x = (time) => LEFT + ((time - first) / (last - first || 1)) * (WIDTH - LEFT - RIGHT);
  const y = (value) => TOP + (1 - (value - low) / span) * (HEIGHT - TOP - BOTTOM);
  const text = (at, place, words, anchor) => svg("text", { x: at, y: place, "text-anchor": anchor }, words);
  const grid = [low, high].flatMap((value) => [
    svg("line", { x1: LEFT, x2: WIDTH - RIGHT, y1: y(value), y2: y(value), class: "grid" }),
    text(LEFT - 5, y(value) + 4, short(value, 3), "end"),
  ]);
  const dots = points.map(({ run, time, value, number }) => {
    const title = svg("title", {}, `${run}: ${short(value)}; flight ${number} of ${name}`);
    const dot = svg("circle", { cx: x(time), cy: y(value), r: 3.5 }, title);
    return isThere("replay") ? svg("a", { href: here(`/replay/${encodeURIComponent(run)}`) }, dot) : dot;
  });
  const label = `${titleOf(metric)} of ${name}, ${points.length} runs in ${short((last - first) / DAY, 2)} days`;
  return svg(
    "svg",
    { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "trend", role: "img", "aria-label": label },
    ...grid,
    ...dots,
    text(LEFT, HEIGHT - 3, day(first), "start"),
    text(WIDTH - RIGHT, HEIGHT - 3, day(last), "end"),
  );
}
