// The 3D view: viser in an iframe, flags over it, its camera and layers.

import { request } from "../core/api.js";
import { $, element, hide } from "../core/dom.js";
import { seconds, words } from "../core/format.js";
import { listenInside } from "../core/keys.js";
import { themeFrame } from "../core/theme.js";
import { here } from "../core/vehicle_path.js";
import { isAlone, landing } from "../core/control_authority.js";
import { Quality } from "../view/quality.js";
import { ViewTools } from "../view/tools.js";

const LOST = 0.8; // s

export class View {
  // fly: says what was refused.
  constructor(events, channels, { fly, isOperator }) {
    this.channels = channels;
    this.name = crypto.randomUUID?.() ?? String(Math.random());
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = `${scheme}://${location.host}${here("/viser")}?view=${this.name}`;
    const byHand = new URLSearchParams(location.search).has("fixedDpr") ? "&fixedDpr=0.5&plain" : "";
    listenInside($("scene"));
    themeFrame($("scene"));
    const full = element("input", { type: "checkbox", onchange: () => this.quality.choose(full.checked) });
    this.quality = new Quality(
      $("scene"),
      `${here("/viser/")}?websocket=${encodeURIComponent(socket)}${byHand}`,
      $("quality"),
      (shadows) => this.ask({ shadows }),
    );
    const tools = new ViewTools(document.querySelector("#view .overlay.bottom"), {
      camera: "free",
      isEnabled: isOperator,
      note: "Layers are shared by all pages; grid 0.5 m",
      more: [
        element(
          "label",
          { title: "shadows and all pixels, however slow it is; in this browser only" },
          full,
          "Full quality",
        ),
      ],
      onCamera: (camera) => this.look(camera),
      onView: (change) =>
        request("PUT", "/api/view", change).catch((error) => {
          tools.show(this.shows);
          fly.refuse(error.message);
        }),
    });
    this.camera = tools.camera;
    events.addEventListener("open", () => this.look(this.camera.value));
    const show = ({ view }) => {
      this.shows = view;
      tools.show(view);
    };
    events.on("hello", show);
    events.on("view", show);
    events.on("summary", ({ age }) => {
      if (age) hide($("truth-key"), !(age.truth !== null && age.truth < 1) || !this.shows?.truth);
      hide($("planned-key"), !events.summary.planned); // a message has only what changed
      this.flags(events);
    });
    channels.addEventListener("change", () => this.flags(events));
    setInterval(() => this.flags(events), 500); // also while nothing arrives
  }

  look(camera) {
    return this.ask({ camera });
  }

  async ask(change) {
    try {
      await request("POST", "/api/view/camera", { view: this.name, ...change });
    } catch {
      /* the strip on top says that web is away; asked again when it is back */
    }
  }

  flags(events) {
    const { status, station, link } = events.summary,
      age = events.age("state");
    const isSilent =
      this.channels.isSilent || age > 0.5 || (events.age("link_status") < 1.5 && link.state !== "good");
    const silence = Number.isFinite(age) ? `no telemetry for ${seconds(age)}` : "no telemetry yet";
    // Silence that lasts is a lost contact, which static/link/contact_lost.js tells.
    const texts = isSilent ? (age < LOST ? [silence] : []) : (status?.flags ?? []).map(words);
    if (events.age("station_status") < 1.5) texts.push(...(station?.alarms ?? []));
    const who = events.age("status") < 1 ? landing(status) : "",
      key = [who, ...texts].join("|");
    if (key === this.shown) return;
    this.shown = key;
    const chips = texts.map((text) => element("span", {}, text));
    if (who) chips.unshift(element("span", { className: isAlone(status) ? "alone" : "" }, who));
    $("flags").replaceChildren(...chips);
  }
}
