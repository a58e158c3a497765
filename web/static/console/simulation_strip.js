// Beside the notices, where the vehicle is simulated: a badge that it is, and behind it what a person would
// else do at the vehicle with the motors off (a full battery put in, the vehicle put back at its start), and
// the panel of wind and faults.

import { command } from "../core/api.js";
import { element, setIfChanged } from "../core/dom.js";
import { onHold } from "../core/hold_button.js";

const SIGN = "simulator.battery_charge"; // a real vehicle has no parameters of a simulator
const HOLD = 800; // ms
const ON = "only with the motors off: land and disarm first";

export class Simulation {
  // panel: of wind and faults.
  constructor(place, { events, gains, fly, isOperator, panel }) {
    this.place = place;
    this.panel = panel;
    this.events = events;
    this.gains = gains;
    this.isOperator = isOperator;
    const ask = (action, label) => fly.attempt(() => command("simulation", { action }), label);
    this.swap = element(
      "button",
      { id: "swap-battery", onclick: () => ask("swap_battery", "swap battery") },
      "Swap battery",
    );
    this.reset = element("button", { id: "reset-vehicle", className: "hold" }, "Reset vehicle");
    onHold(this.reset, HOLD, () => ask("reset", "reset vehicle"));
    const faults = element(
      "button",
      { id: "open-faults", title: "wind, load and faults with schedules", onclick: () => this.showFaults() },
      "Wind and faults",
    );
    place.append(
      element(
        "summary",
        { className: "badge", title: "this vehicle is simulated: nothing real moves" },
        "SIMULATION",
      ),
      element("div", {}, this.swap, this.reset, faults),
    );
    document.addEventListener("click", ({ target }) => {
      if (!place.contains(target)) place.open = false;
    });
    setInterval(() => this.draw(), 200);
  }

  showFaults() {
    this.place.open = false;
    this.panel.open();
  }

  draw() {
    const isSimulated = this.gains.value(SIGN) !== undefined,
      isOn = Boolean(this.events.summary.status?.armed);
    if (this.place.hidden === isSimulated) this.place.hidden = !isSimulated;
    if (!isSimulated) {
      if (!this.panel.place.hidden) this.panel.close();
      return;
    }
    const may = this.isOperator && !isOn,
      why = this.isOperator ? ON : "viewers cannot do this; ask an operator";
    put(this.swap, may, "install a full battery", why);
    put(
      this.reset,
      may,
      "hold for 0.8 s: returns the vehicle to its start position with a full battery",
      why,
    );
  }
}

function put(button, may, does, why) {
  const title = may ? does : why;
  if (button.disabled === may) button.disabled = !may;
  setIfChanged(button, "title", title);
}
