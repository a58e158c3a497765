// Estimators compared at the station, on the Beacons tab: their errors as a table and a chart. Of the
// chosen one, the tab shows the residuals. While the tab is hidden there is no socket and no signal.

import { convergenceOf } from "/static/beacons/convergence.js";
import { element } from "/static/core/dom.js";
import { Socket } from "/static/core/sockets.js";
import { ErrorChart } from "./chart.js";
import { COMPARED, Errors } from "./errors.js";

const SHADOW = "estimation.shadow";

export function show(place, parts) {
  new Comparison(place, parts);
}

class Comparison {
  socket;
  newest;

  constructor(place, { beacons, events, gains, isOperator, ages, history, description }) {
    const errors = element("section", { id: "beacons-errors" });
    const chart = element("section", { id: "beacons-chart", className: "chart" });
    place.append(errors, chart);
    this.beacons = beacons;
    this.events = events;
    this.gains = gains;
    this.ages = ages;
    this.errors = new Errors(errors, { gains, isOperator, choose: (name) => beacons.choose(name) });
    this.chart = new ErrorChart(chart, history, description);
    beacons.addEventListener("open", () => this.open());
    beacons.addEventListener("close", () => this.close());
    beacons.addEventListener("draw", () => this.draw());
    gains.addEventListener("read", () => beacons.isOpen && this.errors.parameters());
    events.on("parameter", ({ name }) => {
      if (name === COMPARED && beacons.isOpen) this.errors.parameters();
    });
    if (beacons.isOpen) this.open();
  }

  open() {
    this.socket = new Socket("/comparison");
    this.socket.addEventListener("message", ({ data }) => {
      this.newest = JSON.parse(data);
      this.beacons.draw();
    });
    this.errors.parameters();
  }

  close() {
    this.socket.close();
    this.names = "";
    this.chart.compare([]);
  }

  draw() {
    if (!this.newest) return;
    const { estimators, sigma } = this.newest,
      names = estimators.map(({ name }) => name);
    if (names.join() !== this.names) {
      this.names = names.join();
      this.chart.compare(names);
      this.beacons.view.estimates(names);
    }
    const chosen = names.includes(this.beacons.chosen) ? this.beacons.chosen : "vehicle";
    this.errors.show(this.newest, chosen);
    const { status } = this.events.summary;
    this.errors.showShadow(this.gains.value(SHADOW), convergenceOf(status), status?.shadow_distance);
    const one = estimators.find(({ name }) => name === chosen);
    this.beacons.residuals.show(one, sigma, this.ages.isOld("comparison"));
  }
}
