// The experiments as cards: what each flies, and its last verdict. The open one has the options and Start.

import { badge } from "./figures.js";
import { element, setText } from "../core/dom.js";
import { ago, words } from "../core/format.js";

export class Cards {
  chosen = "";
  cards = new Map();
  results = {};

  // body: what the open card has; chose(): another card is open.
  constructor(body, chose) {
    this.body = body;
    this.chose = chose;
    this.place = element("ul", { className: "cards", ariaLabel: "experiments" });
  }

  // experiments: of /api/experiments; the one of this name is open, else the first.
  show(experiments, name) {
    this.cards = new Map(experiments.map((one) => [one.name, this.card(one)]));
    this.place.replaceChildren(...[...this.cards.values()].map(({ place }) => place));
    this.chosen = "";
    this.open(this.cards.has(name) ? name : experiments[0].name);
    this.judge(this.results);
  }

  card({ name, description, problem }) {
    const last = element("span", { className: "last" }),
      said = problem || description,
      button = element(
        "button",
        { className: "head", ariaExpanded: "false", title: said, onclick: () => this.open(name) },
        element("b", {}, problem ? name : words(name)),
        last,
      );
    const about = element("p", { className: problem ? "about reason" : "about" }, said);
    return { button, last, place: element("li", { className: "card" }, button, about) };
  }

  open(name) {
    if (name === this.chosen) return;
    this.chosen = name;
    for (const [own, { button, place }] of this.cards) {
      button.ariaExpanded = String(own === name);
      place.classList.toggle("open", own === name);
    }
    this.cards.get(name).place.append(this.body);
    this.chose();
  }

  // results: the newest judged run of each experiment, of /api/experiments/results.
  judge(results) {
    this.results = results;
    for (const [name, { last }] of this.cards) {
      const found = results[name];
      if (!found) setText(last, "not flown yet");
      else last.replaceChildren(element("small", {}, ago(found.start)), badge(found));
    }
  }
}
