// All vehicles in one line, each with its state, to go to its page; away when there is one only.

import { element, setIfChanged, setText } from "./dom.js";
import { fixed } from "./format.js";
import { onKey } from "./keys.js";
import { Socket } from "./sockets.js";
import { sameFor } from "./vehicle_path.js";

const OLD = 1; // s: longer ago, and contact with the vehicle is lost
const LOST = 1000; // ms without web's message

// {word, tone: "", flying, warn or off} of one of /ws/fleet's `vehicles`.
export function stateOf(vehicle) {
  if (vehicle.age === null) return { word: "no data yet", tone: "off" };
  if (vehicle.age > OLD || vehicle.link?.state === "lost") return { word: "no contact", tone: "warn" };
  const mode = vehicle.mode?.toLowerCase() ?? "";
  if (/cut|emergency/.test(mode)) return { word: mode.replaceAll("_", " "), tone: "warn" };
  if (vehicle.airborne) return { word: "flying", tone: "flying" };
  return vehicle.armed ? { word: "armed", tone: "flying" } : { word: "motors off", tone: "" };
}

const SIGNS = { flying: "▲", warn: "⚠", off: "○", "": "●" };

// session: of /api/session; before: the element it is put before, in its parent.
export function addVehicleStrip(session, before) {
  if (session.vehicles.length < 2) return null;
  return new VehicleStrip(session, before);
}

class VehicleStrip {
  constructor(session, before) {
    this.received = -Infinity;
    this.chips = new Map(session.vehicles.map((name) => [name, this.chip(name, name === session.vehicle)]));
    this.place = element(
      "nav",
      { id: "vehicle-strip", ariaLabel: "vehicles" },
      element("a", { href: "/fleet", title: "all vehicles on one page" }, "Fleet"),
      ...[...this.chips.values()].map(({ link }) => link),
    );
    before.before(this.place);
    onKey("v", "choose the next vehicle, Enter opens it", () => this.next());
    this.socket = new Socket("/ws/fleet");
    this.socket.addEventListener("message", ({ data }) => {
      const { vehicles } = JSON.parse(data);
      if (!vehicles) return;
      this.received = performance.now();
      for (const vehicle of vehicles) this.show(vehicle);
    });
    setInterval(() => this.place.classList.toggle("stale", performance.now() - this.received > LOST), 500);
  }

  chip(name, isHere) {
    const sign = element("i", { ariaHidden: "true" }),
      word = element("span"),
      more = element("small");
    const link = element(
      "a",
      { className: "vehicle", href: sameFor(name), ...(isHere ? { ariaCurrent: "page" } : {}) },
      sign,
      element("b", {}, name),
      word,
      more,
    );
    link.addEventListener("click", () => {
      link.href = sameFor(name, tab() || location.hash);
    });
    return { link, sign, word, more };
  }

  show(vehicle) {
    const chip = this.chips.get(vehicle.name);
    if (!chip) return;
    const { word, tone } = stateOf(vehicle),
      alarms = vehicle.alarms.length;
    setText(chip.sign, SIGNS[tone]);
    setText(chip.word, word);
    setText(
      chip.more,
      [
        vehicle.battery === null ? "" : `${fixed(vehicle.battery, 1)} V`,
        alarms ? `${alarms} alarm${alarms > 1 ? "s" : ""}` : "",
      ]
        .filter(Boolean)
        .join(" · "),
    );
    setIfChanged(chip.link.dataset, "tone", tone);
    const title = [vehicle.link ? `link ${vehicle.link.state}` : "no link yet", ...vehicle.alarms].join("\n");
    setIfChanged(chip.link, "title", title);
  }

  next() {
    const links = [...this.chips.values()].map(({ link }) => link);
    const now = links.findIndex((link) => link === document.activeElement);
    const from = now < 0 ? links.findIndex((link) => link.getAttribute("aria-current")) : now;
    links[(from + 1) % links.length].focus();
  }
}

// The tab that is open here, so that it is open there, too.
function tab() {
  const open = document.querySelector("#side [role=tab][aria-selected=true]")?.dataset.tab;
  return open ? `#tab=${open}` : "";
}
