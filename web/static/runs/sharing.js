// A run in other programs: links for Foxglove and Lichtblick.

import { element } from "../core/dom.js";
import { viewerButtons } from "../core/viewers.js";

export class RunSharing {
  constructor() {
    this.run = null;
    const viewers = viewerButtons(
      () => `/api/runs/${encodeURIComponent(this.run.id)}/link`,
      (...content) => this.say(...content),
    );
    this.buttons = element("div", { className: "links" }, ...viewers);
    this.status = element("p", { className: "said", role: "status", hidden: true });
    this.place = element("div", {}, this.buttons, this.status);
  }

  show(run, isOther) {
    this.run = run;
    this.place.hidden = !run || run.recording;
    if (isOther) this.say("");
  }

  say(...content) {
    this.status.replaceChildren(...content);
    this.status.hidden = !content[0];
  }
}
