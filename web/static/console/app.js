// The page: opens the sockets and hands them to the parts.

import { followAddress } from "./url_state.js";
import { get } from "../core/api.js";
import { Ages } from "../core/ages.js";
import { StatusBar } from "./status_bar.js";
import { Beacons } from "../beacons/beacons.js";
import { Calibrate } from "../calibrate/calibrate.js";
import { EventCenter } from "../events/event_center.js";
import { Contact } from "../link/contact_lost.js";
import { ControlStrip } from "./control_strip.js";
import { Charts, liveExpressions } from "../charts/charts.js";
import { derivedSignals } from "../charts/derived.js";
import { addEmergency } from "../emergency/emergency.js";
import { ExperimentSection } from "../experiments/experiments.js";
import { FaultsPanel } from "../faults/panel.js";
import { Fly } from "../fly/fly.js";
import { Gains } from "../gains/gains.js";
import { Help } from "../core/help.js";
import { LinkPanel } from "../link/link.js";
import { Marks } from "./marks.js";
import { People } from "./people.js";
import { Preflight } from "../fly/preflight.js";
import { Channels } from "../link/channels.js";
import { Events, Telemetry } from "../core/sockets.js";
import { addSticks } from "../sticks/panel.js";
import { Simulation } from "./simulation_strip.js";
import { addEdges } from "./panes.js";
import { StateTable } from "./state_table.js";
import { showPanels } from "./panels.js";
import { tabs } from "./tabs.js";
import { addVehicleStrip } from "../core/vehicle_strip.js";
import { View } from "./scene_view.js";
import { DraftBar } from "../view/draft.js";
import { $, showNote } from "../core/dom.js";

async function start() {
  const [session, description, behaviors] = await Promise.all([
    get("/api/session"),
    get("/api/signals"),
    get("/api/behaviors"),
  ]);
  description.signals.push(...(await derivedSignals(liveExpressions)));
  const events = new Events();
  const emergency = addEmergency($("emergency"), events, session); // first, whatever fails below
  const telemetry = new Telemetry(description);
  const isOperator = session.role !== "viewer"; // admins may do all that operators may
  $("vehicle").textContent = session.vehicle;
  addVehicleStrip(session, $("bar"));
  new EventCenter(events, session.vehicle, $("disarm"));
  document.title = `${session.vehicle} · quadlab`;

  const fly = new Fly(events, behaviors, isOperator);
  new Preflight($("preflight"), $("arm"), events);
  const ages = new Ages(events, telemetry, description.stale);
  new Marks($("recorder"), document.querySelector("#view .overlay.bottom"), events, isOperator);
  const gains = new Gains(events, isOperator);
  new ExperimentSection($("experiment"), { events, fly, isOperator, ages, gains });
  const channels = new Channels({ events, telemetry, ages, gains });
  new StatusBar(events, fly, isOperator, { ages, channels, telemetry, gains, vehicle: session.vehicle });
  new View(events, channels, { fly, isOperator });
  new DraftBar($("draw"), { events, fly, label: session.label, isOperator });
  addSticks($("sticks"), { events, isOperator, fly, emergency, gains, label: session.label });
  new StateTable($("table"), { telemetry, description, ages, events });
  const charts = new Charts($("charts"), telemetry, description, events);
  const beacons = new Beacons({ events, gains, isOperator, ages });
  new Calibrate($("tab-calibrate"), { events, session, telemetry, gains, isOperator, ages });
  new LinkPanel($("tab-link"), { events, telemetry, gains, ages, channels });

  const shown = { gains, fly, ages, beacons, charts, history: charts.history };
  showPanels({ events, session, telemetry, description, isOperator, ...shown });

  const panel = new FaultsPanel($("faults"), { gains, isOperator });
  new Simulation($("simulation"), { events, gains, fly, isOperator, panel });

  tabs();
  addEdges({ side: $("side"), charts: $("charts"), view: $("view") });
  followAddress();
  new People(session);
  new ControlStrip($("control"), events, session, fly);
  new Contact($("contact"), { events, telemetry, channels, gains });
  new Help($("help"), isOperator); // last: it lists the keys of all
}

start().catch((error) => {
  $("answer").className = "bad";
  showNote($("answer"), `The page could not start: ${error.message}`);
});
