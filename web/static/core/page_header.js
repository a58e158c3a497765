// The head of the pages beside the console: where one is, where one can go, and who one is.

import { addEmergency } from "../emergency/emergency.js";
import { $, element } from "./dom.js";
import { EventCenter } from "../events/event_center.js";
import { Help } from "./help.js";
import { icon } from "../icons/icons.js";
import { Events } from "./sockets.js";
import { addVehicleStrip } from "./vehicle_strip.js";

const PAGES = [
  ["/", "Fly"],
  ["/runs", "Runs"],
  ["/setup", "Settings"],
];
const FLEET = ["/fleet", "Fleet"];

// session: of /api/session; here: the path of this page; events: of this page, if it has them.
// emergency: and events, of this page's vehicle; strip: of all vehicles.
/** @param {any} events */
export function head(session, here, events = null, { emergency = true, strip = true } = {}) {
  // an exported page leads nowhere
  const pages = session.pages ?? (session.vehicles.length > 1 ? [...PAGES, FLEET] : PAGES);
  const links = pages.map(([path, label]) =>
    element(
      "a",
      { href: path, ...(path === here ? { ariaCurrent: "page" } : {}) },
      icon(path.slice(1) || "fly"),
      label,
    ),
  );
  const help = element(
    "button",
    { id: "help", className: "link", title: "the keys of this page (?)", ariaExpanded: "false" },
    "Help",
  );
  const bar = element(
    "header",
    { id: "head" },
    element(
      "div",
      { className: "name" },
      element("b", {}, "quadlab"),
      element("span", { id: "vehicle" }, session.vehicle),
    ),
    element("nav", { ariaLabel: "pages" }, ...links),
    element("div", { id: "head-controls" }),
    element("span", { className: "who", title: session.role }, session.label),
    help,
  );
  document.body.prepend(bar);
  $("plain-emergency")?.remove(); // what works without scripts
  if (emergency) {
    events ??= new Events();
    addEmergency($("head-controls"), events, session);
    new EventCenter(events, session.vehicle, bar.querySelector(".who"));
  }
  if (strip) addVehicleStrip(session, bar.nextElementSibling);
  new Help(help, session.role !== "viewer", { place: bar, guides: false });
  document.title = `${PAGES.find(([path]) => path === here)?.[1] ?? "quadlab"} · ${session.vehicle}`;
  return bar;
}
