// Buttons and keys that move the play-head, and the times it stands at.

import { copied, element, setIfChanged, setText } from "/static/core/dom.js";
import { clock as clockOf } from "/static/core/format.js";
import { icon } from "/static/icons/icons.js";
import { onKey } from "/static/core/keys.js";
import { SPEEDS, stamp } from "./play_head.js";
import { WIDTHS } from "./range.js";

export const FRAME = 1 / 50; // s, of the track
const NAMES = { 0.125: "⅛", 0.25: "¼", 0.5: "½" };
const COPIED = 2000; // ms for which a copy is confirmed

export class Transport {
  // address(): of this page at the present moment, or its end.
  constructor(place, clock, range, address) {
    this.address = address;
    this.clock = clock;
    this.range = range;
    this.back = element("button", {
      ariaLabel: "play backwards",
      title: "play backwards",
      onclick: () => this.press(-1),
    });
    this.forth = element("button", {
      ariaLabel: "play",
      title: "play or pause (Space)",
      onclick: () => this.press(1),
    });
    this.speed = element(
      "select",
      {
        ariaLabel: "speed",
        title: "speed ([ and ])",
        onchange: () => clock.setSpeed(Number(this.speed.value)),
      },
      ...SPEEDS.map((speed) => element("option", { value: speed }, `${NAMES[speed] ?? speed} ×`)),
    );
    this.width = element(
      "select",
      {
        ariaLabel: "time shown in the charts",
        onchange: () => range.setWidth(this.width.value ? Number(this.width.value) : null),
      },
      ...WIDTHS.map(([label, seconds]) => element("option", { value: seconds ?? "" }, label)),
      element("option", { value: "zoom", hidden: true }, "zoomed"),
    );
    /** @type {(label: string, title: string) => [HTMLElement, HTMLElement]} */
    const time = (label, title) => {
      const output = element("output");
      return [element("div", { className: "cell", title }, element("label", {}, label), output), output];
    };
    const [own, run] = time("run", "since the recording began"),
      [since, flight] = time("flight", "since the last take-off"),
      [clockCell, wall] = time("clock", "time of day by the stamps; simulated time in a simulation");
    this.run = run;
    this.flight = flight;
    this.wall = wall;
    const step = (label, title, act) => element("button", { ariaLabel: title, title, onclick: act }, label);
    place.append(
      element(
        "div",
        { className: "buttons" },
        step(icon("start"), "to the beginning (Home)", () => this.seek(clock.start)),
        step("−1 s", "back 1 s (Shift and ←)", () => clock.step(-1)),
        step(icon("earlier"), "back one frame (←)", () => clock.step(-FRAME)),
        this.back,
        this.forth,
        step(icon("later"), "forward one frame (→)", () => clock.step(FRAME)),
        step("+1 s", "forward 1 s (Shift and →)", () => clock.step(1)),
        step(icon("end"), "to the end (End)", () => this.seek(clock.end)),
        this.speed,
      ),
      element("div", { className: "times" }, own, since, clockCell),
      element("label", { className: "shows" }, "charts show ", this.width),
      element(
        "button",
        {
          className: "copy",
          title: "an address that opens this replay at this moment",
          onclick: ({ currentTarget }) => this.copy(currentTarget),
        },
        "Copy link",
      ),
    );
    this.keys();
    clock.addEventListener("time", () => this.show());
    clock.addEventListener("change", () => this.show());
    range.addEventListener("range", () => this.showWidth());
  }

  setRuns(runs) {
    this.runs = runs;
    this.show();
    this.showWidth();
  }

  press(direction) {
    const { clock } = this;
    if (clock.playing && clock.direction === direction) clock.pause();
    else clock.play(direction);
  }

  // Where a browser gives no clipboard, the address bar has it.
  async copy(button) {
    const { href } = new URL(this.address(), location.href);
    history.replaceState(null, "", href);
    setText(button, (await copied(href)) ? "Copied" : "See address bar");
    setTimeout(() => setText(button, "Copy link"), COPIED);
  }

  seek(t) {
    this.clock.pause();
    this.clock.seek(t);
  }

  keys() {
    const { clock } = this,
      step = (sign) => (event) => clock.step(sign * (event.shiftKey ? 1 : FRAME));
    onKey(" ", "play or pause", () => clock.toggle());
    onKey("ArrowLeft", "back one frame, with Shift 1 s", step(-1));
    onKey("ArrowRight", "forward one frame, with Shift 1 s", step(1));
    onKey("Home", "to the beginning", () => this.seek(clock.start));
    onKey("End", "to the end", () => this.seek(clock.end));
    onKey("[", "play slower", () => clock.faster(-1));
    onKey("]", "play faster", () => clock.faster(1));
    onKey("r", "reverse the direction of playback", () => clock.play(-clock.direction));
    // Held arrows run on; onKey acts on the first press only.
    document.addEventListener("keydown", (event) => {
      const sign = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (sign && event.repeat && !event.target?.closest?.("input, select, textarea")) step(sign)(event);
    });
  }

  show() {
    const { clock, runs } = this;
    if (!runs) return;
    const { begun, description } = runs[0],
      since = description.airborne.filter((t) => t <= clock.t).at(-1);
    setText(this.run, stamp(clock.t));
    setText(this.flight, since === undefined ? "–" : stamp(clock.t - since));
    setText(this.wall, begun === null ? "–" : clockOf(begun + clock.t, 3));
    const ways = /** @type {[HTMLElement, number, string][]} */ ([
      [this.forth, 1, "play"],
      [this.back, -1, "backwards"],
    ]);
    for (const [button, direction, name] of ways) {
      const playing = clock.playing && clock.direction === direction;
      if (button.ariaPressed === String(playing)) continue;
      button.replaceChildren(icon(playing ? "pause" : name));
      button.ariaPressed = String(playing);
    }
    setIfChanged(this.speed, "value", String(clock.speed));
  }

  showWidth() {
    const value = this.range.isZoomed ? "zoom" : String(this.range.width ?? "");
    setIfChanged(this.width, "value", value);
  }
}
