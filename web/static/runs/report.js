// A report with figures of any run, made on request: one page and one PDF, opened in tabs of their own.

import { get, request } from "../core/api.js";
import { element } from "../core/dom.js";

const POLL = 700; // ms
const KINDS = [
  [".html", "Full report"],
  [".pdf", "PDF"],
];

export class RunReport {
  constructor(isOperator) {
    this.isOperator = isOperator;
    this.make = element("button", { onclick: () => this.ask() }, "Make report");
    this.links = element("span", { className: "links" });
    this.buttons = element("div", { className: "links" }, this.make, this.links);
    this.status = element("p", { className: "made", role: "status", hidden: true });
    this.place = element("div", { className: "making" }, this.buttons, this.status);
  }

  // run: with its id; or null.
  show(run) {
    clearTimeout(this.timer);
    this.id = run?.id;
    this.place.hidden = !run || run.recording;
    this.links.replaceChildren();
    this.say("");
    this.free(true);
    if (!this.place.hidden) this.look(() => get(`${this.path}_making`), true);
  }

  get path() {
    return `/api/runs/${encodeURIComponent(this.id)}/report`;
  }

  free(isFree) {
    this.make.disabled = !this.isOperator || !isFree;
    this.make.title = this.isOperator
      ? "figures, metrics, parameters, calibrations and versions as one page and a PDF"
      : "operators make reports";
  }

  ask() {
    clearTimeout(this.timer);
    this.look(() => request("POST", this.path));
  }

  // isFirst: what failed before this page looked is no news.
  async look(read, isFirst = false) {
    const { id } = this;
    this.free(false);
    let found;
    try {
      found = await read();
    } catch (error) {
      if (id === this.id) {
        this.say(isFirst ? "" : error.message);
        this.free(true);
      }
      return;
    }
    if (id !== this.id) return;
    const { state, progress, reason, files } = found,
      share = Math.round(100 * progress);
    if (state === "working" || state === "waiting") {
      this.say(
        state === "waiting" ? "Waiting for another report…" : `Making the report: ${share} % `,
        element("progress", { max: 100, value: share, ariaLabel: "report" }),
      );
      this.timer = setTimeout(() => this.look(() => get(`${this.path}_making`)), POLL);
      return;
    }
    this.free(true);
    this.say(
      state === "failed" && !isFirst
        ? `No report: ${reason}`
        : state === "ready" && !isFirst
          ? "The report is made."
          : "",
    );
    this.make.textContent = files.some((name) => name.endsWith(".html"))
      ? "Make report again"
      : "Make report";
    this.links.replaceChildren(
      ...KINDS.flatMap(([end, label]) =>
        files
          .filter((name) => name.endsWith(end))
          .slice(0, 1)
          .map((name) =>
            element(
              "a",
              {
                className: "button",
                href: `${this.path}/${encodeURIComponent(name)}`,
                target: "_blank",
                rel: "noopener",
                title: name,
              },
              label,
            ),
          ),
      ),
    );
  }

  say(...content) {
    this.status.replaceChildren(...content);
    this.status.hidden = !content[0];
  }
}
