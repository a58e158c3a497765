// Which signals a chart shows: those with names first, then every number of the log by topic.

import { element } from "../core/dom.js";

const MOST = 8;
const LISTED = 400; // boxes at once; the search finds the others

export class SignalMenu {
  constructor(signals, choose) {
    this.signals = signals; this.choose = choose; this.chosen = [];
    this.search = element("input", { type: "search", placeholder: "Search signal, topic or unit", ariaLabel: "search signals", oninput: () => this.fill() });
    this.note = element("span", { className: "note" });
    this.list = element("div", { className: "columns" });
    this.place = element("div", { className: "menu signals", hidden: true }, element("div", { className: "tools" }, this.search, this.note), this.list);
    document.addEventListener("pointerdown", (event) => { if (!this.place.hidden && !this.place.parentElement?.contains(/** @type {Node} */ (event.target))) this.place.hidden = true; });
    this.place.addEventListener("keydown", (event) => { if (event.key === "Escape") this.place.hidden = true; });
  }

  toggle(chosen) {
    this.chosen = [...chosen];
    this.place.hidden = !this.place.hidden;
    if (this.place.hidden) return;
    this.fill();
    this.search.focus();
  }

  fill() {
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const fits = this.signals.filter(({ name, label, group, unit }) => {
      const text = `${name} ${label} ${group} ${unit}`.toLowerCase();
      return words.every((word) => text.includes(word));
    });
    const groups = new Map();
    for (const signal of fits.slice(0, LISTED)) groups.set(signal.group, [...(groups.get(signal.group) ?? []), signal]);
    this.list.replaceChildren(...[...groups].map(([group, members]) => element("fieldset", {}, element("legend", {}, legend(group, members)), ...members.map((signal) => this.box(signal)))));
    this.note.textContent = fits.length > LISTED ? `${LISTED} of ${fits.length}; search for more` : `${fits.length} signals`;
    this.limit();
  }

  box(signal) {
    const input = element("input", { type: "checkbox", value: signal.name, checked: this.chosen.includes(signal.name), onchange: () => this.changed(signal.name, input.checked) });
    const constant = "constant" in signal ? `always ${signal.constant ?? "empty"}` : "";
    return element("label", { title: `${signal.name}${constant ? `: ${constant}` : ""}`, className: constant ? "constant" : "" }, input, signal.label);
  }

  changed(name, on) {
    this.chosen = on ? [...this.chosen, name] : this.chosen.filter((one) => one !== name);
    this.limit();
    this.choose([...this.chosen]);
  }

  limit() {
    const full = this.chosen.length >= MOST;
    for (const box of this.list.querySelectorAll("input")) box.disabled = full && !box.checked;
    this.place.title = full ? `at most ${MOST} signals in one chart` : "";
  }
}

function legend(group, members) {
  const units = new Set(members.map((signal) => signal.unit));
  return units.size === 1 && members[0].unit ? `${group}, ${members[0].unit}` : group;
}
