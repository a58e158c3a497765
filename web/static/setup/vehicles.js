// The vehicles this station knows, and what its control law believes of the connected one.

import { get } from "../core/api.js";
import { element, tableHead } from "../core/dom.js";
import { ago, exact, words } from "../core/format.js";

const PERIOD = 5000; // ms between two looks at the list
const MODEL = [
  ["mass", "Mass"],
  ["arm", "Arm"],
  ["inertia_xx", "Inertia about x"],
  ["inertia_yy", "Inertia about y"],
  ["inertia_zz", "Inertia about z"],
  ["torque_ratio", "Torque per thrust"],
  ["motor_time_constant", "Motor lag"],
  ["battery_nominal", "Battery, nominal"],
];
const ESTIMATE = [
  ["control.law", "Control law"],
  ["estimation.estimator", "Estimator"],
];

export class VehicleSection {
  constructor(place, session, events, parameters) {
    this.session = session;
    this.events = events;
    this.parameters = parameters;
    this.body = element("tbody");
    this.reached = element("dl", { className: "facts" });
    this.model = element("dl", { className: "facts" });
    place.append(
      element(
        "table",
        { className: "list" },
        tableHead("name", "link", "state", "runs", "last seen"),
        this.body,
      ),
      this.reached,
      element("h3", {}, `Model of ${session.vehicle} in the control law`),
      this.model,
      element(
        "p",
        { className: "hint" },
        "Edit on the ",
        element("a", { href: "/#tab=gains&search=model." }, "Gains tab"),
        ", under model, with bounds, history and undo.",
      ),
    );
    for (const type of ["read", "confirmed"]) parameters.addEventListener(type, () => this.showModel());
    this.showModel();
    this.refresh();
    this.timer = setInterval(() => this.refresh(), PERIOD);
  }

  async refresh() {
    try {
      const vehicles = await get("/api/setup/vehicles");
      this.body.replaceChildren(...vehicles.map((one) => this.row(one)));
    } catch (error) {
      this.body.replaceChildren(
        element("tr", {}, element("td", { colSpan: 5, className: "reason" }, error.message)),
      );
    }
  }

  row({ name, ours, link, runs, last_seen, address }) {
    const { status } = this.events.summary,
      isHere = ours && (link === "good" || link === "degraded");
    const state = !ours
      ? address
        ? `enrolled at ${address}`
        : "of earlier runs"
      : !isHere
        ? "not connected"
        : name !== this.session.vehicle
          ? "connected"
          : status
            ? `${words(status.mode)}${status.airborne ? ", in the air" : ""}`
            : "connected";
    return element(
      "tr",
      { className: isHere ? "" : "away" },
      element("td", {}, element("b", {}, name)),
      element("td", {}, ours ? link || "no contact" : "–"),
      element("td", {}, state),
      element("td", {}, String(runs)),
      element("td", {}, isHere ? "now" : ago(last_seen)),
    );
  }

  // What the start-up checks know of the vehicle: its address, its firmware and software.
  showChecks(checks) {
    const facts = [
      ["ports", "station", "Reached"],
      ["firmware", "vehicle", "Firmware"],
      ["version", "vehicle", "Software"],
    ]
      .map(([name, place, label]) => [label, checks.find((one) => one.name === name && one.place === place)])
      .filter(([, one]) => one);
    this.reached.replaceChildren(
      ...facts.flatMap(([label, { found }]) => [element("dt", {}, label), element("dd", {}, found)]),
    );
  }

  showModel() {
    const rows = [...MODEL.map(([name, label]) => [`model.${name}`, label]), ...ESTIMATE]
      .map(([name, label]) => [this.parameters.known.get(name), label])
      .filter(([known]) => known);
    const facts = rows.flatMap(([{ value, unit, default: initial, name }, label]) => [
      element("dt", {}, label),
      element(
        "dd",
        { title: `${name}, default ${exact(initial)}` },
        `${typeof value === "string" ? words(value) : exact(value)} ${unit}`.trim(),
        ...(value !== initial ? [element("small", {}, ` modified, was ${exact(initial)}`)] : []),
      ),
    ]);
    this.model.replaceChildren(
      ...(facts.length
        ? facts
        : [
            element(
              "dd",
              { className: "hint" },
              "The vehicle's parameters have not been read yet; they appear when it is connected.",
            ),
          ]),
    );
  }
}
