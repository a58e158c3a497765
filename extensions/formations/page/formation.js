// The formation on the page of the fleet: all vehicles in 3D with who sees whom, the rigidity eigenvalue, all of
// them up and down in order, and the sticks of the whole formation.

import { get, request } from "/static/core/api.js";
import { attempt, element, setText } from "/static/core/dom.js";
import { flightButton } from "/static/core/flight_button.js";
import { fixed } from "/static/core/format.js";
import { Socket } from "/static/core/sockets.js";
import { EigenvalueChart } from "./eigenvalue.js";
import { InOrder } from "./order.js";
import { FAIR, GOOD, Scene } from "./scene.js";
import { Steering } from "./steering.js";

const HEIGHTS = [1.6, 1]; // m, of the take-off, in turn: none hides others that stand in a line with it

export function show(place, { session, land, vehicles }) {
  new Formation(place, session, land, vehicles);
}

class Formation {
  /** @type {any} */
  scene;

  /** @type {any} */
  chart;

  /** @type {any} */
  lines;

  summary;

  told = "";

  constructor(place, session, land, vehicles) {
    this.place = place;
    this.names = session.vehicles;
    this.isOperator = session.role !== "viewer";
    this.options = { speed: 0, yaw_rate: 0, scale_rate: 0 };
    this.said = element("p", { className: "said", ariaLive: "polite" });
    this.order = new InOrder(this.names, vehicles, (line) => setText(this.said, line));
    this.land = land;
    get("/api/formation").then(
      (options) => this.begin(options),
      ({ message }) => place.append(element("p", { className: "note" }, message)),
    );
  }

  begin(options) {
    this.options = options;
    const heading = element("h2", {}, "Formation");
    if (this.names.length < options.least) {
      const line = `A formation has at least ${options.least} vehicles: quadlab up --vehicles ${options.least}.`;
      this.place.append(heading, element("p", { className: "note" }, line));
      return;
    }
    this.scene = new Scene(this.names);
    this.chart = new EigenvalueChart();
    this.summary = element("p", { className: "summary" });
    this.lines = element("ul", { className: "lines", ariaLabel: "what the vehicles tell" });
    const side = element("div", { className: "side" }, ...(this.isOperator ? this.controls() : []));
    side.append(this.summary, this.chart.place, this.lines);
    this.place.append(
      heading,
      element(
        "div",
        { className: "parts" },
        element("div", { className: "seen" }, this.scene.canvas, hint()),
        side,
      ),
    );
    this.socket = new Socket("/formation");
    this.socket.addEventListener("message", ({ data }) => this.show(JSON.parse(data)));
  }

  controls() {
    const button = (text, title, onclick) => flightButton(element("button", { title, onclick }, text));
    this.steering = new Steering(
      { press: (action) => action === "land" && this.land.press() },
      () => this.options,
    );
    return [
      element(
        "div",
        { className: "buttons" },
        button(
          "Take off in order",
          `arm and take off, one after the other, to ${HEIGHTS.join(" and ")} m in turn`,
          () => this.order.takeOff(HEIGHTS),
        ),
        button("Velocity", "all that fly obey the sticks of the formation", () =>
          this.order.all("velocity", "fly velocity"),
        ),
        button("Brake", "all that fly stop where they are", () => this.order.all("brake", "brake")),
        button("Land in order", "the last one first", () => this.order.land()),
      ),
      this.said,
      this.steering.place,
      this.settings(),
    ];
  }

  settings() {
    const why = element("p", { className: "bad", hidden: true }),
      fields = Object.entries({
        speed: ["full stick, m/s", 1, 0.05],
        yaw_rate: ["turn, rad/s", 1, 0.05],
        scale_rate: ["grow, 1/s", 0.3, 0.01],
      }).map(([name, [label, max, step]]) => {
        const input = element("input", { type: "number", min: 0, max, step, value: this.options[name] });
        return { name, input, place: element("label", {}, String(label), input) };
      });
    const desired = element("input", {
      value: this.options.desired,
      placeholder: "a pyramid; facing; or 1 2 0 0; 2 1 180 0; …",
      title: "observer, observed, azimuth and elevation in deg, as experiment.desired",
    });
    const apply = () =>
      attempt(why, async () => {
        const values = Object.fromEntries(fields.map(({ name, input }) => [name, Number(input.value)]));
        this.options = await request("PUT", "/api/formation", { ...values, desired: desired.value });
      });
    return element(
      "details",
      {},
      element("summary", {}, "Shape and speeds"),
      element("label", {}, "desired bearings", desired),
      ...fields.map(({ place }) => place),
      element("button", { onclick: apply }, "Apply"),
      why,
    );
  }

  show(now) {
    this.scene.show(now);
    this.chart.add(now.eigenvalue, now.bound);
    const errors = now.edges.map(([, , error]) => error),
      rms = Math.sqrt(errors.reduce((sum, error) => sum + error * error, 0) / Math.max(1, errors.length)),
      names = now.flying.map((k) => this.names[k]);
    const who = now.holder ? `, steered by ${now.holder}` : "";
    setText(
      this.summary,
      names.length
        ? `${names.join(", ")} in formation${who}; bearings ${fixed(rms, 1)}° off the desired ones`
        : "No vehicle flies velocity yet.",
    );
    if (now.lines.join() !== this.told) {
      this.told = now.lines.join();
      this.lines.replaceChildren(...now.lines.map((line) => element("li", {}, line)));
    }
  }
}

const hint = () =>
  element(
    "p",
    { className: "hint" },
    "A cone is from who sees to who is seen: ",
    element("b", { className: "good" }, `within ${GOOD}°`),
    " of the desired bearing, ",
    element("b", { className: "fair" }, `within ${FAIR}°`),
    ", ",
    element("b", { className: "poor" }, "farther off"),
    ". Drag to turn, wheel to zoom.",
  );
