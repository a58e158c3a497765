// A camera's intrinsics: those in use, and the guided calibration that finds them. One runs at a time, for
// all pages, and every page shows it.

import { CameraGuide } from "./guide.js";
import { CameraResult } from "./result.js";
import { get, request } from "/static/core/api.js";
import { attempt, element, hide, optionsOf, showNote } from "/static/core/dom.js";
import { fixed, parseNumber } from "/static/core/format.js";
import { Socket } from "/static/core/sockets.js";
import { here } from "/static/core/vehicle_path.js";

const PATH = "/api/camera",
  SIMULATED = "simulated";
const BOARD = [
  { name: "columns", label: "Squares across", usual: "7", unit: "", scale: 1 },
  { name: "rows", label: "Squares down", usual: "5", unit: "", scale: 1 },
  { name: "square", label: "Square", usual: "35", unit: "mm", scale: 1e-3 },
  { name: "marker", label: "Marker", usual: "26", unit: "mm", scale: 1e-3 },
];
const DECIDED = {
  accepted: (file, camera) =>
    [
      `✓ Accepted and stored in ${file}.`,
      ...(camera === SIMULATED
        ? []
        : [`quadlab tracker camera --device ${camera} takes it from there at its next start.`]),
    ].join(" "),
  rejected: () => "Cancelled. Nothing was changed.",
  "": () => "",
};

export function show(place, { isOperator }) {
  place.append(element("h2", {}, "Camera"));
  new CameraSection(place, isOperator);
}

class CameraSection {
  constructor(place, isOperator) {
    this.known = []; // cameras of the computer, with the intrinsics accepted for each
    this.camera = element("select", { ariaLabel: "camera", onchange: () => this.describe() });
    this.facts = element("dl", { className: "facts" });
    this.earlier = element("ol");
    this.past = element("details", { hidden: true }, element("summary", {}, "Earlier"), this.earlier);
    this.inputs = BOARD.map(({ label, usual }) =>
      element("input", {
        value: usual,
        inputMode: "decimal",
        autocomplete: "off",
        ariaLabel: label,
        oninput: () => this.link(),
      }),
    );
    this.start = element(
      "button",
      {
        disabled: !isOperator,
        title: isOperator
          ? "opens the camera; nothing changes until the result is accepted"
          : "viewers cannot calibrate; ask an operator",
        onclick: () => this.begin(),
      },
      "Calibrate",
    );
    this.print = element(
      "a",
      {
        className: "button",
        target: "_blank",
        title: "a PDF of the true size, with rulers: print it at 100 %",
      },
      "Print the board",
    );
    this.choice = element(
      "div",
      {},
      element(
        "div",
        { className: "fields" },
        element("label", { className: "which" }, element("span", {}, "Camera"), this.camera),
      ),
      this.facts,
      this.past,
      element("h3", {}, "Calibration with a ChArUco board"),
      element(
        "p",
        { className: "hint" },
        "Print the board, check its rulers, and glue it to something flat and stiff. Then hold it in " +
          "front of the camera as the guide says; pictures are taken automatically while it is still.",
      ),
      element(
        "div",
        { className: "fields" },
        ...BOARD.map(({ label, unit }, k) =>
          element("label", {}, element("span", {}, label), this.inputs[k] ?? "", element("small", {}, unit)),
        ),
      ),
      element("div", { className: "acts" }, this.start, this.print),
    );
    const ask = (action) => this.ask(`/${action}`);
    this.guide = new CameraGuide({ isOperator, ask });
    this.result = new CameraResult({ isOperator, ask });
    this.reason = element("p", { className: "reason", role: "alert", hidden: true });
    this.said = element("p", { className: "note good", role: "status", hidden: true });
    place.append(this.choice, this.guide.place, this.result.place, this.reason, this.said);
    this.socket = new Socket("/camera", { binary: true });
    this.socket.addEventListener("message", ({ data }) => {
      if (typeof data === "string") this.show(JSON.parse(data));
      else this.guide.take(data);
    });
    this.link();
    this.load();
  }

  // What is typed, in m; NaN for what is no number.
  get board() {
    return Object.fromEntries(
      BOARD.map(({ name, scale }, k) => [
        name,
        Number((scale * parseNumber(this.inputs[k]?.value ?? "")).toPrecision(6)),
      ]),
    );
  }

  link() {
    const chosen = Object.entries(this.board).map(([name, value]) => [name, String(value)]);
    this.print.setAttribute("href", here(`/api/camera/board.pdf?${new URLSearchParams(chosen)}`));
  }

  begin() {
    const { board } = this,
      wrong = BOARD.find(({ name }) => !Number.isFinite(board[name]));
    if (wrong)
      showNote(
        this.reason,
        `${wrong.label}: ${this.inputs[BOARD.indexOf(wrong)]?.value || "nothing"} is not a number`,
      );
    else
      this.ask("", {
        camera: this.camera.value === SIMULATED ? SIMULATED : Number(this.camera.value),
        ...board,
      });
  }

  async ask(action, body = {}) {
    await attempt(this.reason, async () => {
      this.show(await request("POST", PATH + action, body));
    });
  }

  async load() {
    const known = await get("/api/camera/devices").catch(() => null);
    if (!known) return;
    this.known = known;
    this.camera.replaceChildren(
      ...optionsOf(
        known.map(({ camera, name }) => [
          String(camera),
          camera === SIMULATED ? `${name}, to try it out` : `${camera}: ${name}`,
        ]),
        this.camera.value,
      ),
    );
    this.describe();
  }

  describe() {
    const { history = [] } = this.known.find(({ camera }) => String(camera) === this.camera.value) ?? {},
      [now, ...earlier] = history;
    const rows = !now
      ? [["Intrinsics", "none yet: calibrate the camera"]]
      : now.problem
        ? [["Intrinsics", now.problem]]
        : [
            ["Intrinsics", described(now)],
            ["File", now.file],
          ];
    this.facts.replaceChildren(
      ...rows.flatMap(([label, text]) => [element("dt", {}, label), element("dd", {}, text)]),
    );
    hide(this.past, !earlier.length);
    this.earlier.replaceChildren(
      ...earlier.map((one) =>
        element("li", {}, one.problem || described(one), " ", element("small", {}, one.file)),
      ),
    );
  }

  show({ state, decision, progress, result, camera, requester, reason, file }) {
    const runs = state === "running",
      waits = state === "ready" && !decision,
      called = camera === SIMULATED ? "the simulated camera" : `camera ${camera}`;
    const key = `${state} ${decision}`;
    if (key !== this.key) {
      this.key = key;
      if (runs) this.guide.clear();
      else if (!waits) this.load();
      showNote(this.reason, state === "failed" ? reason : "");
    }
    hide(this.choice, runs || waits);
    showNote(this.said, DECIDED[decision](file, camera));
    this.guide.show(runs ? progress : null, `${requester} calibrates ${called}`);
    this.result.show(waits ? result : null, {
      called,
      requester,
      before: this.known.find((one) => one.camera === camera)?.history[0],
    });
  }
}

// Of a file: what it has, how good it is, when and by whom it was accepted.
const described = ({ date, requester, width, height, focal_lengths: [across, down], residual }) =>
  [
    `focal lengths ${fixed(across, 1)} and ${fixed(down, 1)} pixels at ${width} × ${height}`,
    residual === undefined ? "" : `residual ${fixed(residual, 2)} pixels`,
    date ? `${date.slice(0, 16).replace("T", " ")} UTC` : "",
    requester ? `by ${requester}` : "",
  ]
    .filter(Boolean)
    .join(", ");
