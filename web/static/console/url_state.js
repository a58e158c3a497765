// Where in the console an address points: `/#tab=gains&search=model.` opens that tab, and searches;
// `/#again=RUN` prepares what was flown in a run, which the parts hear as the document's event "again".

import { get } from "../core/api.js";
import { $ } from "../core/dom.js";

export function followAddress() {
  const wanted = new URLSearchParams(location.hash.slice(1));
  document.querySelector(`[role=tab][data-tab="${CSS.escape(wanted.get("tab") ?? "")}"]`)?.click();
  if (wanted.has("again")) again(wanted.get("again") ?? "");
  const search = $("search");
  if (!wanted.has("search") || !search) return;
  search.value = wanted.get("search");
  search.dispatchEvent(new Event("input"));
}

// Where something differs, its comparison comes first; without an experiment, that nothing does.
/** @param {string} run */
async function again(run) {
  let found;
  try {
    found = await get(`/api/runs/${encodeURIComponent(run)}/again`);
  } catch (/** @type {any} */ error) {
    found = { run, problem: error.message, lines: [], experiment: "", options: {} };
  }
  const tab = found.experiment && !found.problem && !found.lines.length ? "experiments" : "gains";
  document.querySelector(`[role=tab][data-tab="${tab}"]`)?.click();
  document.dispatchEvent(new CustomEvent("again", { detail: found }));
}
