// The start-up checks of station, vehicle, page and this browser, at their start and on demand.

import { get, request } from "../core/api.js";
import { badge, checkList, count } from "../core/check_list.js";
import { element } from "../core/dom.js";
import { clock } from "../core/format.js";

const AGAIN = 2000; // ms, while the station has not looked yet
const PLACES = [
  ["station", "Station"],
  ["vehicle", "Vehicle"],
  ["page", "Page"],
  ["browser", "This browser"],
];

export class CheckSection {
  // shown(checks): called with the results.
  constructor(place, summary, isOperator, shown) {
    this.shown = shown;
    this.summary = summary;
    this.again = element(
      "button",
      {
        disabled: !isOperator,
        title: isOperator
          ? "station, vehicle and page run their checks again; on the ground only"
          : "viewers cannot do this; ask an operator",
        onclick: () => this.run(() => request("POST", "/api/setup/checks", {})),
      },
      "Check again",
    );
    this.when = element("span", { className: "hint", role: "status" });
    this.lists = element("div", { className: "places" });
    place.append(element("div", { className: "acts" }, this.again, this.when), this.lists);
    this.isOperator = isOperator;
    this.run(() => get("/api/setup/checks"));
  }

  async run(ask) {
    this.again.disabled = true;
    this.when.textContent = "checking …";
    clearTimeout(this.timer);
    try {
      const { checked, checks } = await ask();
      this.show([...checks, ...browserChecks()]);
      this.when.textContent = checked
        ? `checked at ${clock(checked)}`
        : "the station has not run its checks yet";
      if (!checked) this.timer = setTimeout(() => this.run(() => get("/api/setup/checks")), AGAIN);
    } catch (error) {
      this.when.textContent = error.message;
    }
    this.again.disabled = !this.isOperator;
  }

  show(checks) {
    const worst =
      ["fail", "warn", "unknown", "ok"].find((state) => checks.some((one) => one.state === state)) ??
      "unknown";
    this.summary.replaceChildren(badge(worst));
    this.summary.title = count(checks);
    this.shown(checks);
    this.lists.replaceChildren(
      ...PLACES.map(([place, label]) => [label, checks.filter((one) => one.place === place)])
        .filter(([, own]) => own.length)
        .map(([label, own]) =>
          element(
            "section",
            { ariaLabel: label },
            element("h3", {}, label, element("small", {}, `: ${count(own)}`)),
            checkList(own),
          ),
        ),
    );
  }
}

// What this browser can do: sticks and the 3D view need it.
function browserChecks() {
  const check = (name, good, found, wanted, advice, bad = "fail") => ({
    place: "browser",
    name,
    state: good ? "ok" : bad,
    found,
    wanted,
    advice,
  });
  const secure = window.isSecureContext,
    pads = typeof navigator.getGamepads === "function",
    graphics = webgl();
  return [
    check(
      "secure context",
      secure,
      secure ? "yes" : "no",
      "yes",
      "open the page by https, or on the station's own computer",
    ),
    check(
      "gamepad",
      pads,
      pads ? "supported" : "not supported",
      "supported",
      "use another browser, or the keyboard",
      "warn",
    ),
    check(
      "3D graphics",
      Boolean(graphics),
      graphics || "no WebGL 2",
      "WebGL 2",
      "switch on the graphics acceleration in the browser's settings",
      "warn",
    ),
    check(
      "window",
      innerWidth >= 1024 && innerHeight >= 640,
      `${innerWidth} × ${innerHeight}`,
      "1024 × 700 or more to fly",
      "make the window larger to fly; it is large enough to watch",
      "warn",
    ),
  ];
}

// The name of the renderer, "" without.
function webgl() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return "";
  const name = gl.getParameter(gl.RENDERER);
  gl.getExtension("WEBGL_lose_context")?.loseContext(); // a page has few of them
  return String(name || "WebGL 2");
}
