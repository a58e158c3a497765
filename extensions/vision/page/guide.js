// The guided calibration of a camera while it runs: its picture with what is covered, what to do next, and
// how to end it.

import { element, hide, setText, showNote, svg } from "/static/core/dom.js";
import { fixed, NONE } from "/static/core/format.js";
import { paint } from "/static/camera/picture.js";

/** @type {[string, RegExp][]} */
const KINDS = [
  ["Places", /^place/],
  ["Tilts", /^(left|right|upper|lower)$/],
  ["Distances", /^(near|far)$/],
];

export class CameraGuide {
  constructor({ isOperator, ask }) {
    this.isOperator = isOperator;
    this.canvas = element("canvas", { width: 640, height: 480 });
    this.canvas.setAttribute("role", "img");
    this.canvas.ariaLabel = "picture of the camera, with the board's corners and the cells that are covered";
    this.cells = svg("g");
    this.wanted = svg("rect", { class: "wanted" });
    this.cover = svg("svg", { preserveAspectRatio: "none", "aria-hidden": "true" }, this.cells, this.wanted);
    this.title = element("p", { className: "hint" });
    this.bar = element("i");
    this.progress = element(
      "div",
      {
        className: "progress",
        role: "progressbar",
        ariaLabel: "progress of the calibration",
        ariaValueMin: "0",
        ariaValueMax: "100",
      },
      this.bar,
    );
    this.instruction = element("p", { className: "instruction", role: "status" });
    this.hint = element("p", { className: "reason", hidden: true });
    this.counts = element("dl", { className: "counts" });
    this.finish = element(
      "button",
      {
        disabled: !isOperator,
        title: "calibrate with the pictures taken so far",
        onclick: () => ask("finish"),
      },
      "Finish",
    );
    this.cancel = element(
      "button",
      { disabled: !isOperator, title: "end without a result; nothing changes", onclick: () => ask("cancel") },
      "Cancel",
    );
    this.place = element(
      "div",
      { className: "guided", hidden: true },
      element("figure", { className: "picture" }, this.canvas, this.cover),
      element(
        "div",
        {},
        this.title,
        this.progress,
        this.instruction,
        element("div", { className: "hints" }, this.hint),
        this.counts,
        element("div", { className: "acts" }, this.finish, this.cancel),
      ),
    );
  }

  // Of a calibration that begins: the picture of the one before is not its own.
  clear() {
    this.canvas.getContext("2d")?.clearRect(0, 0, this.canvas.width, this.canvas.height);
  }

  take(jpeg) {
    return paint(this.canvas, jpeg);
  }

  // progress: of the API, empty until the camera is open; null while none runs.
  show(progress, title) {
    hide(this.place, !progress);
    if (!progress) return;
    const {
      views = 0,
      share = 0,
      cells = [],
      goals = {},
      goal = "",
      instruction = "",
      hint = "",
      residual = null,
    } = progress;
    setText(this.title, title);
    setText(this.instruction, instruction || (views ? "Enough: calculating" : "Opening the camera"));
    showNote(this.hint, hint);
    this.bar.style.width = `${(100 * share).toFixed(1)}%`;
    this.progress.ariaValueNow = String(Math.round(100 * share));
    const rows = [
      ...KINDS.map(([label, pattern]) => [
        label,
        counted(Object.entries(goals).filter(([key]) => pattern.test(key))),
      ]),
      ["Pictures taken", String(views)],
      ["Residual so far", residual === null ? NONE : `${fixed(residual, 2)} pixels`],
    ];
    this.counts.replaceChildren(
      ...rows.flatMap(([label = "", text = ""]) => [element("dt", {}, label), element("dd", {}, text)]),
    );
    this.drawCover(cells, goal);
  }

  drawCover(cells, goal) {
    const across = cells[0]?.length ?? 0,
      down = cells.length,
      [, column, row] = /^place-(\d)-(\d)$/.exec(goal) ?? [];
    this.wanted.toggleAttribute("hidden", column === undefined);
    if (!across) {
      this.cells.replaceChildren();
      return;
    }
    this.cover.setAttribute("viewBox", `0 0 ${across} ${down}`);
    this.cells.replaceChildren(
      ...cells.flatMap((line, y) =>
        line.flatMap((isCovered, x) => (isCovered ? [svg("rect", { x, y, width: 1, height: 1 })] : [])),
      ),
    );
    const wide = across / 3,
      high = down / 3;
    for (const [name, value] of [
      ["x", Number(column) * wide],
      ["y", Number(row) * high],
      ["width", wide],
      ["height", high],
    ])
      if (column !== undefined) this.wanted.setAttribute(name, value);
  }
}

const counted = (goals) =>
  goals.length ? `${goals.filter(([, isDone]) => isDone).length} of ${goals.length}` : NONE;
