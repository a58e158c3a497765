// What to press first, and the keys: one key away. On the first visit of the console the steps are open by
// themselves, as a narrow card beside the vehicle, which goes at the first command.

import { commands } from "./api.js";
import { $, element, optionsOf } from "./dom.js";
import { keys, onKey } from "./keys.js";
import { themeChoice } from "./theme.js";
import { chooseZone, zone } from "./time_zone.js";

const ROOM = 800; // px of a page in which the card leaves the vehicle in sight
const SEEN = "quadlab.help.seen";
const STEPS = [
  [
    "Status",
    "The bar shows what the vehicle is doing, the line below it how well, and the large button the " +
      "next step. A grey value is out of date.",
  ],
  [
    "Arm",
    "Hold Arm until it fills. The Fly tab lists what is not ready and how to fix it. Disarm is next " +
      "to Arm while the vehicle is on the ground.",
  ],
  [
    "Take off",
    "It climbs to 1 m and hovers. Fly to, Figure 8 and sticks are in the Fly tab, experiments next to it.",
  ],
  [
    "Land",
    "Land descends on the spot. Emergency land descends immediately, overrides everything else and " +
      "may drift; anyone may press it.",
  ],
  ["Cut motors", "Only when a fall is better than flight: hold it for half a second."],
  ["Calibrate", "The Calibrate tab guides through each; nothing changes before you accept it."],
];
const NAMES = { " ": "space", Escape: "Esc" };

// Times that stand in a list are written anew; elsewhere the page is loaded again.
const zoneChoice = (guides) =>
  element(
    "label",
    { className: "theme" },
    "Times",
    element(
      "select",
      {
        title: "the zone of all times on these pages; those in UTC end with Z",
        onchange: ({ target }) => {
          chooseZone(target.value);
          if (!guides) location.reload();
        },
      },
      ...optionsOf(
        [
          ["", "Local"],
          ["utc", "UTC"],
        ],
        zone(),
      ),
    ),
  );

function seen() {
  try {
    return localStorage.getItem(SEEN) !== null;
  } catch {
    return true;
  }
}
function remember() {
  try {
    localStorage.setItem(SEEN, "1");
  } catch {
    /* a private window forgets; the help opens again */
  }
}

export class Help {
  // place: what it lies over; guides: it begins with the first steps, as on the console.
  constructor(button, isOperator, { place = $("view"), guides = true } = {}) {
    this.button = button;
    this.isOperator = isOperator;
    this.guides = guides;
    this.dialog = element("dialog", { id: "help-panel", ariaLabel: "help" });
    place.append(this.dialog);
    button.addEventListener("click", () => this.toggle());
    this.dialog.addEventListener("close", () => {
      if (guides) remember();
      button.setAttribute("aria-expanded", "false");
    });
    onKey("?", "this help", () => this.toggle());
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.dialog.close();
    });
    if (!guides || seen() || innerWidth < ROOM) return;
    this.open(true);
    commands.addEventListener("sent", () => this.dialog.close(), { once: true });
  }

  toggle() {
    if (this.dialog.open) this.dialog.close();
    else this.open();
  }

  // isFirst: the steps alone.
  open(isFirst = false) {
    this.dialog.classList.toggle("first", isFirst);
    const steps = this.isOperator
      ? STEPS.slice(0, isFirst ? -1 : undefined)
      : [
          STEPS[0],
          [
            "Watch",
            "You are a viewer: you see everything and may press Emergency land. An operator can invite you to command.",
          ],
        ];
    const item = ({ key, meaning, hold }) =>
      element(
        "div",
        {},
        element("dt", {}, element("kbd", {}, NAMES[key] ?? key), hold ? " held" : ""),
        element("dd", {}, meaning),
      );
    const close = element(
      "button",
      { className: "small", autofocus: true, onclick: () => this.dialog.close() },
      "Close",
    );
    const title = (text, ...more) =>
      element(
        "header",
        {},
        element("h1", {}, text),
        ...(isFirst ? [] : [themeChoice(), zoneChoice(this.guides)]),
        ...more,
      );
    const list = element("dl", {}, ...keys().map(item));
    if (this.guides) {
      this.dialog.replaceChildren(
        title(this.isOperator ? "Your first flight" : "What you see", close),
        element(
          "ol",
          {},
          ...steps.map(([name, text]) => element("li", {}, element("b", {}, name), ` ${text}`)),
        ),
        ...(isFirst
          ? [element("p", {}, "Press ? for more, keys, theme and time zone.")]
          : [
              element("h1", {}, "Keys"),
              list,
              element(
                "p",
                {},
                "They also work in the 3D view, where W A S D and the arrows move the camera.",
              ),
            ]),
      );
    } else this.dialog.replaceChildren(title("Keys", close), list);
    this.button.setAttribute("aria-expanded", "true");
    this.dialog.show();
  }
}
