// Where in the console an address points: `/#tab=gains&search=model.` opens that tab, and searches.

import { $ } from "../core/dom.js";

export function followAddress() {
  const wanted = new URLSearchParams(location.hash.slice(1));
  document.querySelector(`[role=tab][data-tab="${CSS.escape(wanted.get("tab") ?? "")}"]`)?.click();
  const search = $("search");
  if (!wanted.has("search") || !search) return;
  search.value = wanted.get("search");
  search.dispatchEvent(new Event("input"));
}
