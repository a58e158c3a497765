// The Runs tab: recorded flights, newest first.

import { get, request } from "./api.js";
import { bytes, duration, element } from "./format.js";

const $ = (id) => document.getElementById(id);

export class Runs {
  constructor(events, isOperator) {
    this.isOperator = isOperator;
    this.open = false;
    document.addEventListener("tab", ({ detail }) => { this.open = detail === "runs"; if (this.open) this.load(); });
    $("run-search").addEventListener("input", () => this.load());
    events.on("summary", ({ station }) => {
      if (station && station.recording !== this.recording) { this.recording = station.recording; setTimeout(() => this.open && this.load(), 500); }
    });
  }

  async load() {
    const search = encodeURIComponent($("run-search").value.trim());
    try {
      const runs = await get(`/api/runs?search=${search}`);
      $("runs").replaceChildren(...(runs.length ? runs.map((run) => this.row(run)) : [element("p", { className: "empty" }, search ? "No run matches." : "No runs yet. Recording starts by itself on arming.")]));
    } catch (error) {
      $("runs").replaceChildren(element("p", { className: "empty" }, error.message));
    }
  }

  row(run) {
    const start = new Date(run.start_ns / 1e6), day = start.toLocaleDateString(undefined, { day: "numeric", month: "short" });
    const facts = [run.complete ? duration(run.duration) : "not closed", bytes(run.bytes), run.vehicle, run.operator].filter(Boolean).join(" · ");
    const problem = run.problem ? element("span", { className: "warn" }, ` · ${run.problem}`) : "";
    const notes = element("input", { value: run.notes, placeholder: "notes", ariaLabel: `notes of ${run.id}`, disabled: !this.isOperator });
    notes.addEventListener("change", () => request("PUT", `/api/runs/${encodeURIComponent(run.id)}/notes`, { notes: notes.value }).catch((error) => notes.setCustomValidity(error.message)));
    return element("div", { className: "run" },
      element("div", { title: run.id }, `${day}, ${start.toTimeString().slice(0, 8)}`),
      element("span", { className: "links" },
        ...(run.report ? [element("a", { href: `/report/${encodeURIComponent(run.id)}`, target: "_blank", title: "verdict and plots" }, "Report")] : []),
        element("a", { href: `/api/runs/${encodeURIComponent(run.id)}/download`, download: "", title: `${run.id}.mcap` }, "Download")),
      element("div", { className: "facts" }, facts, problem), notes);
  }
}
