// The page: opens the sockets and hands them to the parts.

import { get } from "./api.js";
import { Bar } from "./bar.js";
import { Beacons } from "./beacons.js";
import { Chart } from "./chart.js";
import { ExperimentSection } from "./experiment.js";
import { Fly } from "./fly.js";
import { Gains } from "./gains.js";
import { element } from "./format.js";
import { EventList } from "./log.js";
import { People } from "./people.js";
import { Runs } from "./runs.js";
import { Events, Telemetry } from "./sockets.js";
import { Sticks } from "./sticks.js";
import { StateTable } from "./table.js";
import { View } from "./view.js";

const $ = (id) => document.getElementById(id);

async function start() {
  const [session, description, behaviors] = await Promise.all([get("/api/session"), get("/api/signals"), get("/static/behaviors.json")]);
  const events = new Events();
  const telemetry = new Telemetry(description);
  const isOperator = session.role !== "viewer"; // admins may do all that operators may
  $("vehicle").textContent = session.vehicle;
  document.title = `${session.vehicle} · quadlab`;

  const fly = new Fly(events, behaviors, isOperator);
  new Bar(events, fly, isOperator);
  new EventList($("events"), events);
  new ExperimentSection($("experiment"), events, fly, isOperator);
  const gains = new Gains(events, isOperator);
  new Runs(events, isOperator);
  new View(events);
  new Sticks($("sticks"), events, isOperator);
  new StateTable($("table"), telemetry, description);
  for (const index of [0, 1]) new Chart($(`chart-${index}`), index, telemetry, description);
  new Beacons({ events, telemetry, description, gains, isOperator });

  tabs();
  new People(session, fly);
  connection(events);
}

function tabs() {
  const buttons = [...document.querySelectorAll("[role=tab]")];
  for (const button of buttons) {
    button.addEventListener("click", () => {
      for (const other of buttons) {
        other.setAttribute("aria-selected", String(other === button));
        $(`tab-${other.dataset.tab}`).hidden = other !== button;
      }
      document.dispatchEvent(new CustomEvent("tab", { detail: button.dataset.tab }));
    });
  }
}

// A strip across the top while quadlab web is away; everything grows old below it.
function connection(events) {
  const strip = $("offline");
  const show = async () => {
    if (events.connected) { strip.hidden = true; return; }
    strip.hidden = false;
    strip.textContent = "No connection to quadlab web; reconnecting. The vehicle does not depend on this page.";
    try { await get("/api/session"); } catch (error) {
      if (error.status === 401) strip.replaceChildren("Signed out. ", element("a", { href: "/login" }, "Sign in"), " to come back. The vehicle does not depend on this page.");
    }
  };
  events.addEventListener("close", () => setTimeout(show, 400));
  events.addEventListener("open", show);
}

start().catch((error) => {
  $("offline").hidden = false;
  $("offline").textContent = `The page could not start: ${error.message}`;
});
