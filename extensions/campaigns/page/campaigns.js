// Campaigns, below the experiments: which there are and how far they are; of one, its shares, the figures of a metric,
// and the rows, each with the command that flies it again.

import { get, request } from "/static/core/api.js";
import { attempt, element, optionsOf, setText } from "/static/core/dom.js";
import { here, isThere } from "/static/core/vehicle_path.js";
import { titleOf } from "/static/experiments/figures.js";
import { Comparison } from "./comparison.js";
import { drawEcdf, drawHeat, short, titled } from "./drawings.js";
import { drawEffects, drawIndices, drawParallel, drawScatter, drawSearch } from "./factors.js";

const LOOK = 3000; // ms between two looks at a campaign that runs
const ASK = 500; // ms between two questions whether a flight has ended

export function show(place) {
  new Campaigns(place);
}

class Campaigns {
  chosen = "";
  open = -1;
  looks = 0; // not answered yet
  reads = 0;
  shown = null; // name, index of the row whose command is shown, what was drawn last

  constructor(place) {
    this.reason = element("p", { className: "reason", hidden: true });
    this.list = element("ol", { className: "campaigns" });
    this.empty = element("p", { className: "empty", hidden: true });
    this.shares = element("dl", { className: "shares" });
    const choice = (label) => element("select", { ariaLabel: label, onchange: () => this.read() });
    this.metric = choice("metric");
    this.x = choice("factor across");
    this.y = choice("factor down");
    this.by = element("span", {}, "×");
    this.axes = element("div", { className: "axes" }, this.x, this.by, this.y);
    this.rows = element("ol", { className: "rows" });
    this.report = element("a", { target: "_blank" }, "Report with figures");
    this.told = element("pre", { tabIndex: 0 });
    this.comparison = new Comparison();
    this.distribution = new Section("Distribution", this.metric);
    this.search = new Section("Search");
    this.search.place.append(this.told);
    this.effects = new Section("Main effects");
    this.indices = new Section("Sobol’ indices");
    this.map = new Section("Medians", this.axes);
    this.scatter = new Section("Scatter matrix");
    this.parallel = new Section("Parallel coordinates");
    const { distribution, search, effects, indices, map, scatter, parallel } = this;
    const sections = [distribution, search, effects, indices, map, scatter, parallel];
    this.one = element(
      "div",
      { hidden: true },
      this.shares,
      this.report,
      this.comparison.place,
      ...sections.map((section) => section.place),
      element("h2", {}, "Flights"),
      this.rows,
    );
    const all = element(
      "details",
      {
        ontoggle: () => {
          if (all.open) this.look();
        },
      },
      element("summary", {}, "Campaigns"),
      this.list,
      this.empty,
      this.reason,
      this.one,
    );
    place.append(all);
    setInterval(() => {
      if (all.open && !document.hidden && !this.looks) this.look();
    }, LOOK);
  }

  // Reads the list, and the chosen campaign if it has grown.
  async look() {
    this.looks++;
    await attempt(this.reason, async () => {
      const { campaigns, folder } = await get("/api/campaigns");
      this.empty.hidden = campaigns.length > 0;
      setText(this.empty, `None yet. quadlab campaign run plan.toml --out ${folder}/NAME`);
      if (!campaigns.some(({ name }) => name === this.chosen)) this.chosen = campaigns[0]?.name ?? "";
      this.list.replaceChildren(...campaigns.map((one) => this.entry(one)));
      this.comparison.offer(this.chosen, campaigns);
      const now = campaigns.find(({ name }) => name === this.chosen);
      const state = now && `${now.name} ${now.rows}`;
      if (state && state !== this.state && (await this.read())) this.state = state;
    });
    this.looks--;
  }

  entry({ name, experiment, rows, flights, running, over, problem }) {
    const part = over ? 1 : flights ? rows / flights : 0;
    const state = running ? "flying" : !over && rows < flights ? "stopped" : "";
    const facts = problem || [experiment, `${rows} of ${flights}`, state].filter(Boolean).join(" · ");
    const bar = element("i");
    bar.style.width = `${100 * part}%`;
    const choose = () => {
      this.chosen = name;
      this.open = -1;
      this.look();
    };
    const said = [element("b", {}, name), element("span", {}, facts)];
    const button = element("button", { onclick: choose, title: facts }, ...said);
    button.setAttribute("aria-pressed", String(name === this.chosen));
    return element("li", {}, button, element("div", { className: "progress" }, bar));
  }

  // Returns whether it was answered. Only the newest answer is drawn, whatever order they come in.
  async read() {
    const turn = ++this.reads;
    return await attempt(this.reason, async () => {
      const query = new URLSearchParams({ metric: this.metric.value, x: this.x.value, y: this.y.value });
      const wanted = this.chosen,
        found = await get(`/api/campaigns/${encodeURIComponent(wanted)}?${query}`);
      if (wanted === this.chosen && turn === this.reads) this.draw(found);
    });
  }

  draw(found) {
    this.one.hidden = !found.list.length;
    if (this.one.hidden) return;
    this.fliesAgain = found.flies_again;
    this.shares.replaceChildren(
      ...Object.entries(found.verdicts).flatMap(([name, { count, share, low, high }]) => [
        element("dt", {}, name.replace("_", " ")),
        element(
          "dd",
          { title: "interval of the share, 95 % (Wilson)" },
          `${count}`,
          element("span", {}, `${percent(share)}  ${percent(low)} … ${percent(high)}`),
        ),
      ]),
    );
    this.metric.replaceChildren(...optionsOf(found.metrics.map(titled), found.metric));
    this.x.replaceChildren(...optionsOf(found.factors, found.x));
    this.y.replaceChildren(
      ...optionsOf(
        found.factors.filter((name) => name !== found.x),
        found.y,
      ),
    );
    this.report.setAttribute("href", here(`/api/campaigns/${encodeURIComponent(found.name)}/report`));
    this.y.hidden = this.by.hidden = !found.y;
    this.drawFigures(found);
    this.rows.replaceChildren(...found.list.map((row) => this.row(row)));
  }

  drawFigures({ metric, ecdf, heat, effects, sensitivity, points, search }) {
    const choose = (index) => this.chooseFlight(index);
    const varied = effects.filter(({ levels }) => levels.length > 1);
    this.distribution.show(ecdf?.values.length && drawEcdf(ecdf, titleOf(metric)));
    setText(this.told, search ? search.told.join("\n") : "");
    this.search.show(search && (drawSearch(search) ?? ""));
    this.effects.show(varied.length && drawEffects(varied, titleOf(metric)));
    this.indices.show(sensitivity.length && drawIndices(sensitivity, titleOf(metric)));
    this.map.show(heat && drawHeat(heat));
    this.scatter.show(points?.values.length > 1 && drawScatter(points, choose));
    this.parallel.show(points?.values.length > 1 && points.names.length > 2 && drawParallel(points, choose));
  }

  // Shows the row of a flight that was chosen in a figure, first in the list.
  async chooseFlight(index) {
    await attempt(this.reason, async () => {
      const path = `/api/campaigns/${encodeURIComponent(this.chosen)}/flights/${index}`;
      const row = await get(`${path}?${new URLSearchParams({ metric: this.metric.value })}`);
      this.open = index;
      this.rows.querySelector(`[data-index="${index}"]`)?.remove();
      const shown = this.row(row);
      this.rows.prepend(shown);
      shown.scrollIntoView({ block: "nearest" });
    });
  }

  // Flies a row again with its log, and opens the replay of the run that this makes.
  async flyAgain(index, button, said) {
    await attempt(said, async () => {
      const path = `/api/campaigns/${encodeURIComponent(this.chosen)}/flights/${index}`;
      button.disabled = true;
      try {
        for (;;) {
          const { state, reason, run } = await request("POST", path);
          if (state === "failed") throw new Error(reason);
          if (state === "ready") {
            location.assign(here(isThere("replay") ? `/replay/${encodeURIComponent(run)}` : "/runs"));
            return;
          }
          setText(button, state === "waiting" ? "Waiting …" : "Flying …");
          await new Promise((resolve) => setTimeout(resolve, ASK));
        }
      } finally {
        button.disabled = false;
        setText(button, "Fly again");
      }
    });
  }

  row({ index, verdict, reason, value, command }) {
    const words = command || "a compiled flight: it has no log";
    const said = element("p", { className: "reason", hidden: true });
    const fly = element(
      "button",
      { hidden: !this.fliesAgain, onclick: () => this.flyAgain(index, fly, said) },
      "Fly again",
    );
    const line = element(
      "div",
      { hidden: index !== this.open },
      element("pre", { tabIndex: 0 }, words),
      fly,
      said,
    );
    const toggle = () => {
      line.hidden = !line.hidden;
      this.open = line.hidden ? -1 : index;
      button.setAttribute("aria-expanded", String(!line.hidden));
    };
    const what = reason || verdict.replace("_", " ");
    const button = element(
      "button",
      { onclick: toggle, title: `${what}; the command that flies it again` },
      element("b", {}, String(index)),
      element("span", { className: verdict === "passed" ? "" : "amber" }, what),
      element("output", {}, value === null ? "" : short(value)),
    );
    button.setAttribute("aria-expanded", String(index === this.open));
    const made = element("li", {}, button, line);
    made.dataset.index = index;
    return made;
  }
}

// A figure below its title, and what it is chosen by; hidden where there is none.
class Section {
  constructor(title, ...choices) {
    this.drawing = element("div", { className: "drawing" });
    this.place = element("section", { hidden: true }, element("h2", {}, title), ...choices, this.drawing);
  }

  show(made) {
    this.place.hidden = !made && made !== "";
    this.drawing.replaceChildren(...(made ? [made] : []));
  }
}

const percent = (share) => `${(100 * share).toFixed(1)} %`;
