// The fleet page: the state of every vehicle, where it is, and one control to bring all down.

import { get } from "../core/api.js";
import { begin, followConnection } from "../core/connection.js";
import { $ } from "../core/dom.js";
import { showPanels } from "../console/panels.js";
import { LandAll } from "./land.js";
import { FleetPlot } from "./plot.js";
import { FleetTable } from "./table.js";
import { head } from "../core/page_header.js";
import { Socket } from "../core/sockets.js";

async function start() {
  const session = await get("/api/session");
  head(session, "/fleet", null, { emergency: false, strip: false });
  $("vehicle").textContent = `${session.vehicles.length} vehicle${session.vehicles.length > 1 ? "s" : ""}`;
  document.title = "Fleet · quadlab";
  const land = new LandAll($("head-controls"), session.role !== "viewer");
  const table = new FleetTable($("table"), session.vehicles),
    plot = new FleetPlot($("plot"), session.vehicles);
  const socket = new Socket("/ws/fleet?plot=1");
  let vehicles = [],
    received = -Infinity;
  socket.addEventListener("message", ({ data }) => {
    const message = JSON.parse(data);
    if (message.vehicles) {
      vehicles = message.vehicles;
      received = performance.now();
      table.show(vehicles);
      land.show(vehicles);
    }
    plot.add(message.positions);
  });
  table.addEventListener("point", ({ detail }) => plot.mark(detail));
  setInterval(() => {
    // what was heard grows old while nothing comes
    const silence = (performance.now() - received) / 1e3;
    if (silence > 0.8)
      table.show(vehicles.map((one) => ({ ...one, age: one.age === null ? null : one.age + silence })));
  }, 500);
  showPanels({ session, land, vehicles: () => vehicles });
  followConnection(socket, "; Emergency land all still tries");
}

begin(start);
