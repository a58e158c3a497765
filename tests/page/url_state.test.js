import assert from "node:assert/strict";
import { test } from "node:test";

import "./browser.js";

const { followAddress } = await import("../../web/static/console/url_state.js");
globalThis.CSS ??= { escape: (text) => text };

test("an address opens its tab and searches; one without them does nothing", () => {
  const clicked = [], search = Object.assign(new EventTarget(), { value: "" }), heard = [];
  search.addEventListener("input", () => heard.push(search.value));
  document.querySelector = (selector) => (selector.includes('"gains"') ? { click: () => clicked.push("gains") } : null);
  document.getElementById = () => search;
  for (const hash of ["", "#tab=none", "#tab=gains&search=model."]) {
    location.hash = hash;
    followAddress();
  }
  assert.deepEqual([clicked, heard], [["gains"], ["model."]]);
});
