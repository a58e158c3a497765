// The search on the pages beside the console, in their head; a parameter is shown on the console.

import { $ } from "/static/core/dom.js";
import { addSearch } from "./search.js";

export function show(place) {
  $("help").before(place);
  addSearch(place, {});
}
