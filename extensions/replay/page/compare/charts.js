// The charts of the compared runs: of each signal one with all runs, or one a run; and the difference to the first.

import { Chart } from "/static/charts/chart.js";
import { pointingByKeys } from "/static/charts/pointer.js";
import { viewMenu } from "/static/charts/view_menu.js";
import { element } from "/static/core/dom.js";
import { PlayHead, stamp } from "../replay/play_head.js";
import { Range } from "../replay/range.js";
import { ComparedSignals, look } from "./source.js";

const SAMPLES = 1500; // of a difference
const LEAST = 700; // points of a chart: a new one has no width yet

// Seconds about the event at which the runs are aligned, which is 0.
export class EventRange extends Range {
  get head() {
    return /** @type {any} */ (null);
  }
  label(t) {
    const digits = this.end - this.start < 0.6 ? 2 : this.end - this.start < 6 ? 1 : 0;
    return Math.abs(t) < 60 ? `${t.toFixed(digits).replace("-", "−")} s` : stamp(t, digits);
  }
  choose() {}
}

// One of several with a common scale.
class GroupedChart extends Chart {
  group = /** @type {GroupedChart[]} */ ([]);

  rangeOf(unit) {
    const ends = (this.group?.length ? this.group : [this])
      .flatMap((one) => one.extentOf(unit))
      .filter((end) => end !== null);
    return ends.length
      ? this.range(unit, Math.min(...ends), Math.max(...ends))
      : this.range(unit, null, null);
  }
}

export class CompareCharts {
  isSplit = false;
  hasDifference = true;
  names = /** @type {string[]} */ ([]);

  constructor(place, runs, say) {
    this.place = place;
    this.runs = runs;
    this.say = say;
    this.clock = new PlayHead();
    this.range = new EventRange(this.clock);
    this.charts = [];
    this.range.addEventListener("range", () => {
      for (const chart of this.charts) this.show(chart);
    });
  }

  // From the earliest beginning to the latest end, about the event.
  measure() {
    const { clock, runs } = this;
    clock.t = 0;
    clock.setRange(
      Math.min(...runs.map((run) => -run.shift)),
      Math.max(...runs.map((run) => run.duration - run.shift)),
    );
    this.range.follow();
  }

  // Runs lie otherwise against each other.
  shifted() {
    this.measure();
    for (const chart of this.charts) {
      chart.source.clear();
      chart.refresh();
      this.show(chart);
    }
  }

  draw() {
    for (const chart of this.charts) chart.close();
    this.charts = [];
    this.place.replaceChildren(...this.names.map((name) => this.block(name)));
  }

  block(name) {
    const { runs } = this,
      having = runs.filter((run) => run.signals.has(name)),
      lacking = runs.filter((run) => !run.signals.has(name));
    const { group, label, unit } = having[0].signals.get(name),
      places = element("div", { className: this.isSplit ? "multiples" : "both" });
    const add = (shown, isDifference, title) => {
      const place = element(
        "section",
        { className: "chart", ariaLabel: `${title}: ${group} ${label}` },
        ...(this.isSplit ? [] : [element("h3", {}, title)]),
      );
      places.append(place);
      const source = new ComparedSignals(
        this.clock,
        this.range,
        () => (isDifference ? SAMPLES : Math.min(2000, Math.max(LEAST, place.clientWidth))),
        isDifference ? [having[0], ...shown] : shown,
        shown,
        isDifference,
      );
      const chart = new GroupedChart(place, { axis: this.range, source });
      chart.tools.append(
        viewMenu(
          chart,
          "time",
          () => {},
          () => {},
          [],
        ),
      );
      pointingByKeys(chart);
      chart.select([name]);
      source.addEventListener("window", () => {
        for (const one of [chart, ...chart.group]) {
          one.refresh();
          one.draw();
        }
        this.show(chart);
      });
      source.addEventListener("problem", ({ detail }) => {
        if (detail) this.say(detail);
      });
      this.charts.push(chart);
      this.show(chart);
      return chart;
    };
    const others = having.slice(1),
      first = look(having[0].number).letter;
    if (this.isSplit) {
      const made = having.map((run) => add([run], false, look(run.number).letter));
      for (const chart of made) chart.group = made;
    } else add(having, false, "Values");
    if (this.hasDifference && others.length) {
      const made = (this.isSplit ? others.map((run) => [run]) : [others]).map((shown) =>
        add(
          shown,
          true,
          this.isSplit ? `${look(shown[0].number).letter} − ${first}` : `Difference to ${first}`,
        ),
      );
      for (const chart of made) chart.group = made;
    }
    return element(
      "article",
      {},
      element("h2", {}, `${group === label ? "" : `${group} `}${label}`, element("span", {}, unit)),
      ...lacking.map((run) =>
        element(
          "p",
          { className: "problem" },
          `${look(run.number).letter} has no signal ${name}: its log lacks ${name.split(/[./]/)[0]}`,
        ),
      ),
      places,
    );
  }

  show(chart) {
    chart.draw();
    if (!chart.source.settled) chart.source.fetch();
  }
}
