// The head of the pages beside the console: where one is, where one can go, and who one is.

import { addEmergency } from "./emergency.js";
import { element } from "./format.js";

const PAGES = [["/", "Fly"], ["/runs", "Runs"], ["/setup", "Set-up"]];

// session: of /api/session; here: the path of this page; events: of this page, if it has them.
export function head(session, here, events = null) {
  const links = PAGES.map(([path, label]) => element("a", { href: path, ...(path === here ? { ariaCurrent: "page" } : {}) }, label));
  const bar = element("header", { id: "head" },
    element("div", { className: "name" }, element("b", {}, "quadlab"), element("span", { id: "vehicle" }, session.vehicle)),
    element("nav", { ariaLabel: "pages" }, ...links),
    element("div", { id: "head-controls" }),
    element("span", { className: "who", title: session.role }, session.label));
  document.body.prepend(bar);
  addEmergency(document.getElementById("head-controls"), events, session);
  document.title = `${PAGES.find(([path]) => path === here)?.[1] ?? "quadlab"} · ${session.vehicle}`;
  return bar;
}
