// Commanding in the 3D view: a draft is opened here, moved by the pointer in the view, and told in one bar.
// Nothing is commanded before the bar's button is pressed.

import { command, request } from "../core/api.js";
import { element, hide, optionsOf, setIfChanged, setText } from "../core/dom.js";
import { flightButton } from "../core/flight_button.js";
import { onKey } from "../core/keys.js";
import { icon } from "../icons/icons.js";
import { CHECKING, noteOf, stepOf, titleOf } from "./draft_words.js";

const TOOLS = [
  ["target", "fly_to", "Target", "fly to a point: click the ground or drag it in the 3D view"],
  ["waypoints", "waypoints", "Way-points", "each click on the ground adds a point; drag them in the 3D view"],
  [
    "trajectory",
    "figure_eight",
    "Trajectory",
    "drag its start in the 3D view; laps and period are those on the Fly tab",
  ],
  ["volume", "volume", "Volume", "drag the faces of the flight volume in the 3D view"],
  ["keep_out", "keep_out", "Keep-out", "a box that no path comes near: drag its faces in the 3D view"],
];
const SHAPES = ["figure_eight", "circle"];

export class DraftBar {
  // fly: the Fly tab, whose answers it shares; label: of the session.
  constructor(place, { events, fly, label, isOperator }) {
    this.events = events;
    this.fly = fly;
    this.label = label;
    this.draft = null;
    this.shapes = fly.behaviors.filter(({ fixed }) => SHAPES.includes(fixed?.trajectory));
    this.shape = element(
      "select",
      { ariaLabel: "trajectory", onchange: () => this.open("trajectory", this.draft?.points) },
      ...optionsOf(this.shapes.map(({ fixed, label: name }) => [fixed.trajectory, name])),
    );
    this.box = element("select", {
      ariaLabel: "keep-out box",
      onchange: () => this.open("keep_out", undefined, { box: this.box.value }),
    });
    this.buttons = TOOLS.map(([kind, picture, words, title]) =>
      element("button", { title, onclick: () => this.open(kind) }, icon(picture), words),
    );
    this.tools = element("div", { className: "tools", hidden: !isOperator }, ...this.buttons);
    this.title = element("b");
    this.note = element("span", { role: "status" });
    this.go = flightButton(element("button", { className: "go", onclick: () => this.press() }));
    this.back = element(
      "button",
      {
        title: "take the last way-point away",
        onclick: () => this.open("waypoints", this.draft.points.slice(0, -1)),
      },
      "Undo point",
    );
    this.remove = flightButton(
      element(
        "button",
        {
          title: "remove this box from the keep-out boxes",
          onclick: () => this.send("Remove box", this.draft.removal),
        },
        "Remove",
      ),
    );
    this.cancel = element("button", { onclick: () => this.close() }, "Cancel");
    this.bar = element(
      "div",
      { id: "draft", hidden: true },
      element("div", { className: "words" }, this.title, this.shape, this.box, this.note),
      element("span", { className: "acts" }, this.back, this.go, this.remove, this.cancel),
    );
    place.append(this.tools, this.bar);
    const when = ({ target }) => this.mine && !target.closest?.("dialog, [popover]"); // which it closes first
    onKey("Escape", "leave the draft", () => this.close(), { when });
    this.isOperator = isOperator;
    events.on("hello", ({ draft }) => this.show(draft ?? null));
    events.on("draft", ({ draft }) => this.show(draft));
    events.on("summary", () => this.draw());
  }

  get mine() {
    return this.draft?.by === this.label;
  }
  get status() {
    return this.events.age("status") < 1 ? this.events.summary.status : null;
  }
  get shaped() {
    return this.shapes.find(
      ({ fixed }) => fixed.trajectory === (this.draft?.arguments.trajectory ?? this.shape.value),
    );
  }

  async open(kind, points, given = {}) {
    if (kind === "trajectory") {
      const { values, problem } = this.fly.valuesOf(
        this.shapes.find(({ fixed }) => fixed.trajectory === this.shape.value),
      );
      if (problem) {
        this.fly.refuse(problem);
        return;
      }
      given = values;
    }
    for (const tool of this.buttons) tool.disabled = true; // at once: it was heard
    try {
      // What is shown comes as events, in their order: the answer may be older.
      await request("PUT", "/api/draft", { kind, points, arguments: given });
    } catch (error) {
      this.fly.refuse(error.message);
    }
    for (const tool of this.buttons) tool.disabled = false;
  }

  close(isFlown = false) {
    hide(this.bar, true);
    request("DELETE", `/api/draft?flown=${isFlown}`).catch((error) => {
      this.fly.refuse(error.message);
      this.show(this.draft);
    });
  }

  async press() {
    const draft = this.draft,
      { behavior, values, label, why } = stepOf(draft, this.status);
    if (why) return;
    this.go.disabled = true;
    if (!behavior) {
      await this.send(label, values);
      return;
    }
    const act = () => command("start_behavior", { name: behavior, arguments: values });
    const isDone = await this.fly.attempt(
      act,
      titleOf(draft, this.shaped?.label),
      (status) => status.behavior?.toLowerCase() === behavior,
    );
    if (isDone && !(draft.kind === "trajectory" && behavior === "fly_to")) this.close(true);
  }

  async send(label, values) {
    if (await this.fly.attempt(() => request("PUT", "/api/parameters", { values }), label, null))
      this.close();
  }

  show(draft) {
    this.draft = draft;
    if (draft?.kind === "trajectory") this.shape.value = draft.arguments.trajectory;
    hide(this.bar, !draft);
    hide(this.tools, Boolean(draft && this.mine) || !this.isOperator);
    this.draw();
  }

  draw() {
    const { draft, mine } = this;
    if (!draft) return;
    const { label, why } = stepOf(draft, this.status);
    setText(this.title, titleOf(draft, this.shaped?.label));
    setText(
      this.note,
      mine
        ? `${noteOf(draft)}${why && !draft.refusal && why !== CHECKING ? ` · ${why}` : ""}`
        : `prepared by ${draft.by}`,
    );
    setIfChanged(this.note, "title", this.note.textContent);
    setIfChanged(this.bar, "className", draft.refusal ? "refused" : "");
    setText(this.go, label);
    setIfChanged(this.go, "disabled", Boolean(why));
    for (const own of [this.go, this.cancel]) hide(own, !mine);
    hide(this.shape, !mine || draft.kind !== "trajectory");
    hide(this.box, !mine || !draft.boxes?.length);
    hide(this.remove, !mine || !draft.removal);
    if (draft.boxes) {
      const name = draft.arguments.box,
        names = [...new Set([...draft.boxes, name])];
      if (this.box.title !== names.join(", ")) this.box.replaceChildren(...optionsOf(names));
      setIfChanged(this.box, "title", names.join(", "));
      this.box.value = name;
    }
    hide(this.back, !mine || draft.kind !== "waypoints" || draft.points.length < 2);
  }
}
