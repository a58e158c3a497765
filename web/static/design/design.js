// Every component once in the light and once in the dark theme, made of the sheets that the pages have.

import { get } from "../core/api.js";
import { element } from "../core/dom.js";
import { head } from "../core/page_header.js";
import { ICONS, icon } from "../icons/icons.js";

const COLORS = [
  "ground",
  "panel",
  "raised",
  "hover",
  "pressed",
  "line",
  "strong",
  "edge",
  "text",
  "dim",
  "stale",
  "accent",
  "x",
  "y",
  "z",
  "amber",
  "red",
  "flown",
  "teal",
  "violet",
  "rose",
  "gold",
];
const SIZES = ["small", "note", "body", "lead", "large"];

const button = (label, more = {}) => element("button", { type: "button", ...more }, label);
const input = (type, label, more = {}) => element("input", { type, ariaLabel: label, ...more });

function swatch(name) {
  const place = element("span", { className: "swatch" }, element("i"), name);
  place.style.setProperty("--swatch", `var(--${name})`);
  return place;
}

function sized(name) {
  const place = element("span", {}, `${name}: 1.234 m`);
  place.style.fontSize = `var(--${name})`;
  return place;
}

function entry(label, value, color) {
  const place = element("span", {}, label, element("output", {}, value));
  place.style.setProperty("--line-style", `var(--${color})`);
  return place;
}

/** @type {[string, () => HTMLElement[]][]} */
const PARTS = [
  ["Colours", () => COLORS.map(swatch)],
  ["Type sizes", () => SIZES.map(sized)],
  [
    "Buttons",
    () => [
      button("Plain"),
      button("Pressed", { ariaPressed: "true" }),
      button("Disabled", { disabled: true }),
      button("Link", { className: "link" }),
      button("Take off", { className: "hold" }),
      button("Emergency land", { className: "caution" }),
      button("Cut motors", { className: "cut" }),
      element("button", { className: "icon", ariaLabel: "more" }, icon("more")),
      element("a", { className: "button", href: "/runs" }, "Link as a button"),
    ],
  ],
  [
    "Fields",
    () => [
      input("text", "text", { value: "text" }),
      input("search", "search", { placeholder: "Search" }),
      input("number", "number", { value: 1.25 }),
      input("number", "wrong", { value: 9, max: 3 }),
      element("select", { ariaLabel: "choice" }, element("option", {}, "choice")),
      element("label", {}, input("checkbox", "tick", { checked: true }), " ticked"),
      input("text", "disabled", { value: "disabled", disabled: true }),
    ],
  ],
  [
    "Values",
    () => [
      ...[
        ["battery", "15.9 V", ""],
        ["link age", "212 ms", "warn"],
        ["mode", "LANDING", "alarm"],
        ["mass", "1.31 kg", "stale"],
      ].map(([label, value, tone]) =>
        element(
          "div",
          { className: "cell" },
          element("label", {}, label),
          element("output", { className: tone }, value),
        ),
      ),
    ],
  ],
  [
    "Lines of the 3D view",
    () =>
      [
        ["wanted", "reference"],
        ["flown", "flown"],
        ["truth", "truth"],
        ["planned", "planned"],
      ].map(([name, label]) => element("span", { className: `key ${name}` }, label)),
  ],
  [
    "Legend of a chart",
    () => [
      element(
        "div",
        { className: "chart" },
        element(
          "header",
          {},
          element(
            "div",
            { className: "legend" },
            entry("x", "0.123", "x"),
            entry("y", "−1.004", "y"),
            entry("z", "1.200", "z"),
            entry("thrust", "12.8", "teal"),
          ),
        ),
      ),
    ],
  ],
  [
    "Table",
    () => [
      element(
        "table",
        { className: "statistics" },
        element(
          "thead",
          {},
          element("tr", {}, element("th", {}, "signal"), element("th", {}, "mean"), element("th", {}, "rms")),
        ),
        element(
          "tbody",
          {},
          element(
            "tr",
            {},
            element("th", { scope: "row" }, "x"),
            element("td", {}, "0.001"),
            element("td", {}, "0.024"),
          ),
        ),
      ),
    ],
  ],
  ["Icons", () => ICONS.map((name) => element("span", { title: name }, icon(name)))],
];

head(await get("/api/session"), "/design", null, { emergency: false, strip: false });
document.querySelector("main").append(
  ...["light", "dark"].map((name) => {
    const place = element(
      "section",
      { ariaLabel: `${name} theme` },
      element("h2", {}, `${name[0].toUpperCase()}${name.slice(1)}`),
      ...PARTS.flatMap(([title, make]) => [
        element("h2", {}, title),
        element("div", { className: "samples" }, ...make()),
      ]),
    );
    place.dataset.theme = name;
    return place;
  }),
);
