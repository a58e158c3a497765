// How a chart shows its signals, statistics of the time shown, event lines, and saving: one button for all.

import { attempt, element } from "../core/dom.js";
import { icon } from "../icons/icons.js";
import { saveDrawing, saveNumbers, savePaper, savePicture } from "./save.js";

/** @type {[string, number][]} */
const PAPER = [
  ["column", 88],
  ["page", 180],
]; // mm

// An exported page has no server that makes a PDF.
const FORMATS = /** @type {any} */ (globalThis).quadlabRun ? ["SVG"] : ["SVG", "PDF"];

const VIEWS = [
  ["time", "Over time", "values over time"],
  ["xy", "XY plot", "the first signal is x, the others are y"],
  ["spectrum", "Spectrum", "density over frequency, with the rotors' frequencies"],
  ["spectrogram", "Spectrogram", "density of the first signal over time and frequency"],
];

// view: the present one's name; views: what can be chosen, none where there is one only; choose(name):
// another one; changed(): statistics or event lines are.
export function viewMenu(chart, view, choose, changed = () => {}, views = VIEWS) {
  const place = element("div", {
    className: "menu view",
    role: "dialog",
    ariaLabel: "view of the chart",
    hidden: true,
  });
  const button = element(
    "button",
    {
      className: "icon",
      title: "view, statistics, event lines, save",
      ariaLabel: "view",
      ariaExpanded: "false",
      onclick: () => open(place.hidden),
    },
    icon("more"),
  );
  const outside = (event) => {
    if (!place.contains(event.target) && !button.contains(event.target)) open(false);
  };
  function open(wanted) {
    place.hidden = !wanted;
    button.ariaExpanded = String(wanted);
    document[wanted ? "addEventListener" : "removeEventListener"]("pointerdown", outside);
    if (wanted) place.querySelector("button")?.focus();
  }
  const act = (label, title, onclick, more = {}) =>
    element(
      "button",
      {
        title,
        onclick: () => {
          open(false);
          onclick();
        },
        ...more,
      },
      label,
    );
  const box = (label, name) =>
    element(
      "label",
      {},
      element("input", {
        type: "checkbox",
        checked: chart[name],
        onchange: ({ target }) => {
          chart.set(name, target.checked);
          changed();
        },
      }),
      label,
    );
  const problem = element("p", { className: "problem", role: "status", hidden: true });
  const isPlain = view === "time" || view === "xy";
  place.append(
    ...(views.length < 2
      ? []
      : [
          element(
            "div",
            { className: "views", role: "group", ariaLabel: "view" },
            ...views.map(([name, label, title]) =>
              act(
                label,
                title,
                () => {
                  if (name !== view) choose(name);
                },
                { ariaPressed: String(name === view), name },
              ),
            ),
          ),
        ]),
    ...(isPlain ? [box("Statistics", "hasFigures")] : []),
    ...(view === "time" && views.length > 1 ? [box("Event lines", "hasEvents")] : []),
    element(
      "div",
      { className: "tools" },
      act("Save PNG", "what is drawn, as a picture", () => savePicture(chart)),
      act("Save SVG", "what is drawn, as lines and text", () => saveDrawing(chart)),
      ...PAPER.flatMap(([name, width]) =>
        FORMATS.map((format) =>
          act(`${format} ${width} mm`, `for print, as wide as a ${name}: light, text of 8 pt`, () =>
            attempt(problem, () => savePaper(chart, width, format === "PDF")).then(
              (isMade) => isMade || open(true),
            ),
          ),
        ),
      ),
      act("Save CSV", "the numbers of what is shown", () => saveNumbers(chart)),
    ),
    problem,
  );
  place.addEventListener("keydown", (event) => {
    if (event.key === "Escape") {
      open(false);
      button.focus();
      event.stopPropagation();
    }
  });
  chart.place.append(place);
  chart.shown.signal.addEventListener("abort", () => open(false));
  return button;
}
