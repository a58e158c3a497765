// A run in other programs: its 3D recording, and links for Foxglove and Lichtblick.

import { request } from "../core/api.js";
import { element } from "../core/dom.js";
import { moment } from "./labels.js";

const POLL = 700; // ms
const VIEWERS = [["foxglove", "Foxglove"], ["lichtblick", "Lichtblick"]];

// What a browser will let such a page read from here.
function honest() {
  const own = ["localhost", "127.0.0.1", "[::1]"].includes(location.hostname);
  if (location.protocol === "https:") return "The viewer's page reads the file in your browser, which must trust this server's certificate; Chrome asks whether the page may reach your network.";
  return own ? "The viewer's page reads the file in your browser, and only on this computer. Chrome asks first, Firefox allows it, Safari refuses http: download the file there." : "This page is not encrypted: browsers refuse to read from here. Download the file, or start quadlab with --tls.";
}

export class RunSharing {
  constructor() {
    this.run = null;
    this.record = element("button", { title: "the flight as a 3D recording that plays in the browser", onclick: () => this.ask() }, "3D recording");
    const viewers = VIEWERS.map(([name, label]) => element("button", { title: `open in ${label}, with a link that works for ten minutes`, onclick: () => this.link(name, label) }, label));
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

  async link(name, label) {
    const run = this.run;
    try {
      const { url, expires, viewers } = await request("POST", `/api/runs/${encodeURIComponent(run.id)}/link`);
      if (run.id !== this.run?.id) return;
      window.open(viewers[name], "_blank", "noopener,noreferrer");
      this.say(element("a", { href: viewers[name], target: "_blank", rel: "noopener noreferrer" }, `Open in ${label}`), " · ",
        element("button", { className: "link", onclick: (event) => navigator.clipboard?.writeText(url).then(() => { event.target.textContent = "Copied"; }, () => undefined) }, "Copy link"),
        ` · until ${moment(expires).slice(11)}, for anyone who has it. ${honest()}`);
    } catch (error) { this.say(error.message); }
  }
}
