// Who commands: shown to everybody, asked for, given, taken.

import { request } from "../core/api.js";
import { element } from "../core/dom.js";

export class ControlStrip {
  // place: a span; session: of /api/session; fly: says what was refused.
  constructor(place, events, session, fly) {
    this.place = place;
    this.session = session;
    this.fly = fly;
    this.shown = "";
    events.on("summary", ({ control }) => {
      if (control !== undefined) this.draw(control);
    });
    events.addEventListener("close", () => this.draw(null));
  }

  get mayCommand() {
    return this.session.role !== "viewer";
  }

  draw(control) {
    const { holder = "", asking = "", answer_within: left = 0 } = control ?? {};
    const me = this.session.label,
      key = JSON.stringify([control === null, holder, asking]);
    if (this.shown !== key) {
      this.shown = key;
      this.build(control === null, holder, asking, me);
    }
    if (this.left) this.left.textContent = `${left} s`;
    document.body.classList.toggle("commands", this.mayCommand && (holder === me || holder === ""));
  }

  build(unknown, holder, asking, me) {
    const line = element("span", { className: "line" });
    this.left = null;
    const button = (label, action, title) =>
      element("button", { className: "small", title, onclick: () => this.do(action) }, label);
    if (unknown) line.append("control: not known");
    else if (!holder)
      line.append(this.mayCommand ? "Nobody in control. Your first command takes it" : "Nobody in control");
    else if (holder === me)
      line.append(
        element("b", {}, "you have control"),
        button("Give up", "release", "let anyone take control"),
      );
    else line.append(element("b", {}, `${holder} has control`));
    if (asking && holder === me) {
      this.left = element("span", { className: "left" });
      line.append(
        element("span", { className: "asks" }, `${asking} asks for it`),
        this.left,
        button("Give", "give", `let ${asking} command`),
        button("Keep", "keep", "keep control"),
      );
    } else if (asking && holder) {
      this.left = element("span", { className: "left" });
      line.append(
        element(
          "span",
          { className: "asks" },
          asking === me ? "asked; yours in at most" : `${asking} has asked`,
        ),
        ...(asking === me ? [this.left] : []),
      );
    } else if (holder && holder !== me && this.mayCommand) {
      line.append(
        button(
          "Ask",
          "ask",
          `ask ${holder} for control; you get it after 20 s without an answer or a command from ${holder}`,
        ),
      );
    }
    if (holder && holder !== me && this.session.role === "admin")
      line.append(button("Take", "take", "take control at once"));
    this.place.replaceChildren(line);
    this.place.classList.toggle("theirs", Boolean(holder) && holder !== me);
    this.place.classList.toggle("asked", Boolean(asking) && holder === me);
  }

  do(action) {
    this.fly.attempt(() => request("POST", "/api/control", { action }));
  }
}
