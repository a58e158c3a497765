// The Settings page: what this station has, who may use it, and whether all is as it should be.

import { get } from "../core/api.js";
import { begin, followConnection } from "../core/connection.js";
import { showPanels } from "../console/panels.js";
import { $, element } from "../core/dom.js";
import { head } from "../core/page_header.js";
import { Parameters } from "../gains/parameters.js";
import { BeaconSection } from "./beacons.js";
import { CheckSection } from "./checks.js";
import { TrackerSection } from "./tracker.js";
import { UserSection } from "./users.js";
import { VehicleSection } from "./vehicles.js";
import { VolumeSection } from "./volume.js";
import { Events } from "../core/sockets.js";

async function start() {
  const session = await get("/api/session");
  const events = new Events();
  const isOperator = session.role !== "viewer";
  head(session, "/setup", events);
  const parameters = new Parameters(events, isOperator);
  const vehicles = new VehicleSection($("vehicles"), session, events, parameters);
  new BeaconSection($("beacons"), events, isOperator);
  new VolumeSection($("volume"), events, parameters);
  new TrackerSection($("tracker"), events, parameters);
  const after = document.querySelector('#sections [href="#users"]');
  for (const { id, ariaLabel } of document.querySelectorAll("[data-panel]"))
    after?.before(element("a", { href: `#${id}` }, ariaLabel ?? id));
  showPanels({ events, isOperator, parameters });
  new UserSection($("users"), session);
  new CheckSection($("checks"), $("checks-summary"), isOperator, (checks) => vehicles.showChecks(checks));
  followConnection(events);
  // The sections have their heights now: go where the address points.
  if (location.hash) $(location.hash.slice(1))?.scrollIntoView();
}

begin(start);
