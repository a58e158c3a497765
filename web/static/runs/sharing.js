// A run in other programs: its 3D recording, and links for Foxglove and Lichtblick.

import { request } from "../core/api.js";
import { element } from "../core/dom.js";
import { viewerButtons } from "../core/viewers.js";

const POLL = 700; // ms
export class RunSharing {
  constructor() {
    this.run = null;
    this.record = element("button", { title: "the flight as a 3D recording that plays in the browser", onclick: () => this.ask() }, "3D recording");
    const viewers = viewerButtons(() => `/api/runs/${encodeURIComponent(this.run.id)}/link`, (...content) => this.say(...content));
    this.buttons = element("div", { className: "links" }, this.record, ...viewers);
    this.status = element("p", { className: "said", role: "status", hidden: true });
    this.place = element("div", {}, this.buttons, this.status);
  }

  show(run, isOther) {
    this.run = run;
    this.place.hidden = !run || run.recording;
    if (isOther) { clearTimeout(this.timer); this.say(""); this.record.disabled = false; }
  }

  say(...content) { this.status.replaceChildren(...content); this.status.hidden = !content[0]; }

  async ask() {
    const run = this.run;
    clearTimeout(this.timer);
    this.record.disabled = true;
    try {
      const path = `/api/runs/${encodeURIComponent(run.id)}/viser`;
      const { state, progress, reason } = await request("POST", path);
      if (run !== this.run && run.id !== this.run?.id) return;
      if (state === "working" || state === "waiting") {
        const share = Math.round(100 * progress);
        this.say(state === "waiting" ? "Waiting for another recording…" : `Making the 3D recording: ${share} % `, element("progress", { max: 100, value: share, ariaLabel: "3D recording" }));
        this.timer = setTimeout(() => this.ask(), POLL);
        return;
      }
      if (state === "failed") this.say(`No 3D recording: ${reason}`);
      else this.say("3D recording: ", element("a", { href: `/viser/?playbackPath=${encodeURIComponent(path)}&darkMode`, target: "_blank" }, "Play"), " · ", element("a", { href: path, download: `${run.id}.viser` }, "Save .viser"));
    } catch (error) { this.say(error.message); }
    this.record.disabled = false;
  }
}
