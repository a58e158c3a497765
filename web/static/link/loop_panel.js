// The flight loop on board, on the Link tab: how late its ticks come, and what was lost since the
// vehicle's start. A count is worth a word only while it grows.

import { element, setIfChanged, setText } from "../core/dom.js";
import { fixed } from "../core/format.js";
import { boardLink, late } from "./board_link.js";

const TOPIC = "status";
const BINS = [
  ["< 50 µs", "below 50 µs"],
  ["< 100", "below 100 µs"],
  ["< 200", "below 200 µs"],
  ["< 500", "below 500 µs"],
  ["< 1 ms", "below 1 ms"],
  ["< 2", "below 2 ms"],
  ["< 5", "below 5 ms"],
  ["longer", "longer"],
];
const FRESH = 10; // s for which growth is told
const COUNTS = [
  ["overruns", "Overruns", "ticks that took longer than one period"],
  ["missed_frames", "Missed frames", "periods without a sample from the board"],
  ["damaged_frames", "Damaged frames", "pieces of data from the board that were not frames"],
];

/** @param {any} status */
function inWords(status) {
  const { tick_rate: rate, nominal_rate: nominal } = status;
  const [half, most, longest] = ["p50", "p99", "max"].map((name) => late(status[`lateness_${name}`]));
  return [
    `${fixed(rate, 0)}${nominal ? ` of ${fixed(nominal, 0)}` : ""} Hz`,
    `lateness p50 ${half}, p99 ${most}, longest ${longest}${nominal ? ` of a period of ${late(1 / nominal)}` : ""}`,
    `missed ${fixed(100 * status.missed_share, 1)} %`,
  ].join(" · ");
}

export class LoopPanel {
  constructor(place, { events, ages }) {
    this.events = events;
    this.ages = ages;
    this.line = output();
    this.bars = BINS.map(([label, name]) => {
      const bar = element("i"),
        count = element("span", { className: "count" });
      return {
        name,
        bar,
        count,
        place: element(
          "span",
          { className: "bin" },
          count,
          element("span", { className: "column" }, bar),
          element("span", { className: "name" }, label),
        ),
      };
    });
    this.histogram = element(
      "div",
      { className: "histogram", role: "img" },
      ...this.bars.map((one) => one.place),
    );
    this.histogram.dataset.topic = TOPIC;
    this.board = output();
    this.none = element("p", { hidden: true }, "This vehicle does not report the distribution of its ticks.");
    this.counts = COUNTS.map(([name, label, title]) => ({
      name,
      known: /** @type {any} */ (null),
      steps: /** @type {number[][]} */ ([]),
      value: output(),
      growth: element("span", { className: "growth" }),
      label,
      title,
    }));
    place.append(
      element("h2", {}, "Flight loop on board"),
      element("p", {}, this.line),
      element(
        "p",
        { className: "facts" },
        "Ticks since the vehicle's start by their lateness; heights are logarithmic.",
      ),
      this.histogram,
      this.none,
      element(
        "p",
        { className: "facts", title: "of the last second, between the vehicle's computer and its board" },
        "Board: ",
        this.board,
      ),
      ...this.counts.map(({ label, title, value, growth }) =>
        element(
          "div",
          { className: "loop-count", title },
          element("span", { className: "name" }, label),
          value,
          growth,
        ),
      ),
    );
  }

  draw() {
    const { status } = this.events.summary,
      bins = status?.lateness_histogram;
    setText(this.line, status ? inWords(status) : "no data yet");
    setText(this.board, status ? boardLink(status) : "no data yet");
    this.histogram.hidden = !bins;
    this.none.hidden = !status || Boolean(bins);
    if (bins) this.drawBins(bins);
    for (const one of this.counts) this.drawCount(one);
  }

  // Always, so that growth is known when the tab is opened. Fewer than before: it started anew.
  sample() {
    const { status } = this.events.summary,
      now = performance.now() / 1e3;
    for (const one of this.counts) {
      const value = status?.[one.name];
      if (!Number.isFinite(value)) continue;
      if (value < one.known) one.steps = [];
      else if (one.known !== null && value > one.known) one.steps.push([now, value - one.known]);
      while (one.steps.length && now - one.steps[0][0] > FRESH) one.steps.shift();
      one.known = value;
    }
  }

  drawBins(bins) {
    const most = Math.max(1, ...bins),
      label = this.bars.map(({ name }, i) => `${name}: ${bins[i]}`).join(", ");
    this.bars.forEach(({ bar, count }, i) => {
      // A single tick is seen, too.
      bar.style.height = bins[i] ? `${8 + (92 * Math.log10(bins[i])) / Math.max(1, Math.log10(most))}%` : "0";
      setText(count, short(bins[i]));
    });
    setIfChanged(this.histogram, "ariaLabel", label);
  }

  drawCount({ known, steps, value, growth }) {
    const grown = this.ages.isOld(TOPIC) ? 0 : steps.reduce((sum, [, step]) => sum + step, 0);
    setText(value, known === null ? "–" : `${known}`);
    setText(growth, grown ? `▲ ${grown} in the last ${FRESH} s` : "since the start");
    for (const place of [value, growth]) place.classList.toggle("warn", grown > 0);
  }
}

const short = (count) =>
  count < 1e4 ? `${count}` : count < 1e6 ? `${fixed(count / 1e3, 0)}k` : `${fixed(count / 1e6, 1)}M`;

function output() {
  const made = element("output");
  made.dataset.topic = TOPIC;
  return made;
}
