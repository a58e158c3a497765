// Search of all that the page knows, by Ctrl-K: places, buttons, parameters, signals, runs, events and documents.
// A button is shown and not pressed: what moves the vehicle is pressed by a person, where its guards are.

import { get } from "/static/core/api.js";
import { $, element, setText } from "/static/core/dom.js";
import { here, isThere } from "/static/core/vehicle_path.js";
import { ranked } from "./ranking.js";

const PAUSE = 150; // ms without typing before the runs are searched
const PLACES = "[role=tab]:not([hidden]), nav .pages a, #head nav a";
const BUTTONS = "#invite, :is(#primary, #behaviors, #recorder, #parameter-views) button";
const EACH = 6; // most of a kind

/** @typedef {{ kind: string, text: string, note?: string, words?: string, go: () => void }} Found */

// On the console: with what its parts know.
export function show(place, parts) {
  addSearch(place, parts);
  guide(place);
}

// parts: of the console; none on other pages.
export function addSearch(place, parts) {
  const search = new Search(parts);
  const button = element(
    "button",
    { className: "link", title: "search everything (Ctrl-K)", onclick: () => search.open() },
    "Search",
  );
  place.append(button);
  document.addEventListener("keydown", (event) => {
    if (event.key.toLowerCase() !== "k" || !(event.ctrlKey || event.metaKey) || event.altKey) return;
    event.preventDefault();
    search.open();
  });
}

// The document of the open tab, next to Help.
function guide(place) {
  const link = element("a", { target: "_blank", title: "the document of the open tab" }, "Guide");
  const follow = (tab) => link.setAttribute("href", here(`/documents/of/${tab}`));
  const chosen = document.querySelector("[role=tab][aria-selected=true]");
  follow(chosen instanceof HTMLElement ? chosen.dataset.tab : "");
  document.addEventListener("tab", (event) => follow(/** @type {CustomEvent} */ (event).detail));
  place.append(link);
}

class Search {
  /** @type {Found[]} */
  found = [];
  /** @type {Found[]} */
  runs = [];
  /** @type {Found[]} */
  documents = [];
  /** @type {{ name: string, description: string }[]} */
  parameters = []; // read where the page has none of its own
  at = 0;
  asked = "";
  problem = "";
  timer = 0;

  constructor(parts) {
    this.parts = parts;
    this.input = element("input", {
      type: "search",
      placeholder: "Search tabs, buttons, parameters, signals, runs, events, documents",
      ariaLabel: "search everything",
      role: "combobox",
      ariaExpanded: "true",
      ariaAutoComplete: "list",
      oninput: () => this.changed(),
    });
    this.input.setAttribute("aria-controls", "search-found");
    this.list = element("ul", { id: "search-found", role: "listbox", ariaLabel: "found" });
    this.state = element("p", { className: "state", role: "status" });
    this.dialog = element(
      "dialog",
      { id: "search-dialog", ariaLabel: "search everything" },
      this.input,
      this.list,
      this.state,
    );
    this.dialog.addEventListener("keydown", (event) => this.key(event));
    document.addEventListener("pointerdown", ({ target }) => {
      if (target instanceof Node && !this.dialog.contains(target)) this.dialog.close();
    });
    document.body.append(this.dialog);
    parts.gains?.addEventListener("read", () => this.dialog.open && this.draw());
  }

  open() {
    if (this.dialog.open) return;
    this.problem = "";
    this.dialog.show(); // not modal: the emergency buttons can be pressed beside it
    this.input.focus();
    this.input.select();
    this.readDocuments();
    this.changed();
  }

  // What the server answers; without an answer nothing, and the reason below the list.
  async ask(address) {
    try {
      return await get(address);
    } catch (error) {
      this.problem = `Runs or documents could not be searched: ${error.message}`;
      return [];
    }
  }

  async readDocuments() {
    if (this.documents.length) return;
    if (!this.parts.gains) this.parameters = (await this.ask("/api/parameters")).parameters ?? [];
    const found = await this.ask("/api/documents");
    this.documents = found.map(({ title, heading, address, words }) => ({
      kind: "Documents",
      words,
      text: heading ? `${title}: ${heading}` : title,
      go: () => open(here(`/documents/${address}`), "_blank"),
    }));
    this.draw();
  }

  changed() {
    this.at = 0;
    this.draw();
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.readRuns(), PAUSE);
  }

  async readRuns() {
    const words = this.input.value.trim();
    if (!words || words === this.asked) return;
    this.asked = words;
    const found = await this.ask(`/api/runs?limit=${EACH}&search=${encodeURIComponent(words)}`);
    if (words !== this.input.value.trim()) return; // an older answer
    this.runs = found.map(({ id, title }) => ({
      kind: "Runs",
      text: title || id,
      note: title ? id : "",
      go: () => location.assign(here(isThere("replay") ? `/replay/${encodeURIComponent(id)}` : "/runs")),
    }));
    this.draw();
  }

  /** @returns {Found[]} */
  all() {
    const { gains, description, charts } = this.parts;
    const places = [...document.querySelectorAll(PLACES)].map((one) => ({
      kind: "Places",
      text: one.textContent ?? "",
      go: () => /** @type {HTMLElement} */ (one).click(),
    }));
    const buttons = [...document.querySelectorAll(BUTTONS)]
      .filter((one) => one.textContent && !(/** @type {HTMLElement} */ (one).hidden))
      .map((one) => ({
        kind: "Buttons",
        text: one.textContent ?? "",
        note: "show it",
        go: () => this.showButton(/** @type {HTMLElement} */ (one)),
      }));
    const known = gains ? [...gains.known.values()] : this.parameters;
    const parameters = known.map(({ name, description: said = "" }) => ({
      kind: "Parameters",
      text: name,
      note: said,
      go: () => this.showParameter(name),
    }));
    const signals = (description?.signals ?? []).map(({ name, label, group }) => ({
      kind: "Signals",
      text: name,
      note: label === name ? "" : `${group} ${label}`,
      go: () => charts.plot(name),
    }));
    const events = [...document.querySelectorAll("#events li")].map((one) => ({
      kind: "Events",
      text: one.children[1]?.textContent ?? "",
      note: one.children[0]?.textContent ?? "",
      go: () => $("event-center").showPopover(),
    }));
    return [...places, ...buttons, ...parameters, ...signals, ...events];
  }

  showButton(button) {
    const tab = button.closest("[role=tabpanel]");
    if (tab) $(tab.getAttribute("aria-labelledby")).click();
    button.scrollIntoView({ block: "nearest" });
    button.focus({ focusVisible: true });
  }

  showParameter(name) {
    if (!this.parts.gains) {
      location.assign(here(`/#tab=gains&search=${encodeURIComponent(name)}`));
      return;
    }
    $("open-gains").click();
    const field = $("search");
    field.value = name;
    field.dispatchEvent(new Event("input"));
    field.focus();
  }

  draw() {
    const words = this.input.value.trim();
    const runs = words ? this.runs : [];
    this.found = words ? [...ranked([...this.all(), ...this.documents], words, EACH), ...runs] : [];
    this.at = Math.min(this.at, Math.max(0, this.found.length - 1));
    let kind = "";
    this.list.replaceChildren(
      ...this.found.flatMap((one, i) => {
        const head =
          one.kind === kind ? [] : [element("li", { role: "presentation", className: "kind" }, one.kind)];
        kind = one.kind;
        return [...head, this.option(one, i)];
      }),
    );
    this.mark();
    setText(this.state, this.problem || (words && !this.found.length ? `Nothing is called “${words}”.` : ""));
  }

  option(one, i) {
    const made = element(
      "li",
      { role: "option", id: `search-${i}`, onclick: () => this.choose(i) },
      element("span", {}, one.text),
      element("small", {}, one.note ?? ""),
    );
    return made;
  }

  mark() {
    for (const one of this.list.querySelectorAll("[role=option]"))
      one.setAttribute("aria-selected", String(one.id === `search-${this.at}`));
    const chosen = $(`search-${this.at}`);
    chosen?.scrollIntoView({ block: "nearest" });
    this.input.setAttribute("aria-activedescendant", chosen ? chosen.id : "");
  }

  key(event) {
    event.stopPropagation(); // no key of the page works beneath it
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step && this.found.length) {
      event.preventDefault();
      this.at = (this.at + step + this.found.length) % this.found.length;
      this.mark();
    } else if (event.key === "Escape") {
      this.dialog.close();
    } else if (event.key === "Enter") {
      event.preventDefault();
      this.choose(this.at);
    }
  }

  choose(i) {
    const chosen = this.found[i];
    if (!chosen) return;
    this.dialog.close();
    chosen.go();
  }
}
