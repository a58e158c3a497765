// What a camera's calibration found: its figures, what is not good enough, and where the corners are off.

import { element, hide, setText, svg } from "/static/core/dom.js";
import { fixed } from "/static/core/format.js";

const FACTORS = [1, 2, 5, 10, 20, 50, 100, 200, 500]; // by which a residual is drawn longer
const LENGTH = 0.03; // of the picture's width, of a usual residual as drawn
const TERMS = ["k1", "k2", "p1", "p2", "k3"];

export class CameraResult {
  constructor({ isOperator, ask }) {
    this.isOperator = isOperator;
    this.title = element("p", { className: "instruction" });
    this.warnings = element("ul", { className: "warnings" });
    this.facts = element("dl", { className: "counts" });
    this.accept = element("button", { onclick: () => ask("accept") }, "Accept");
    this.cancel = element(
      "button",
      { title: "drop the result; nothing changes", onclick: () => ask("cancel") },
      "Cancel",
    );
    this.picture = svg("svg", { role: "img" });
    this.caption = element("figcaption");
    this.place = element(
      "div",
      { className: "guided", hidden: true },
      element("figure", { className: "residual-picture" }, this.picture, this.caption),
      element(
        "div",
        {},
        this.title,
        this.warnings,
        this.facts,
        element("p", { className: "hint" }, "Nothing is changed until it is accepted."),
        element("div", { className: "acts" }, this.accept, this.cancel),
      ),
    );
  }

  // found: of the API, or null; before: the intrinsics in use, if any.
  show(found, { called, requester, before }) {
    hide(this.place, !found);
    if (!found) return;
    const {
        matrix,
        distortion,
        warnings,
        focal_lengths: [across, down],
      } = found,
      isGood = !warnings.length;
    setText(this.title, `Result for ${called}`);
    hide(this.warnings, isGood);
    this.warnings.replaceChildren(...warnings.map((text) => element("li", {}, text)));
    const was =
      before && !before.problem
        ? `${before.focal_lengths.map((one) => fixed(one, 1)).join(" and ")} pixels`
        : "none";
    const rows = [
      [
        "Residual",
        `${fixed(found.residual, 2)} pixels rms, ${fixed(found.worst_view, 2)} in the worst picture`,
      ],
      [
        "Focal lengths",
        `${fixed(across, 1)} and ${fixed(down, 1)} pixels, ± ${fixed(found.focal_deviation, 1)}`,
      ],
      ["In use until now", was],
      [
        "Principal point",
        `${fixed(matrix[2], 1)}, ${fixed(matrix[5], 1)} of ${found.width} × ${found.height} pixels`,
      ],
      ["Distortion", TERMS.map((name, k) => `${name}\u00a0${fixed(distortion[k], 4)}`).join(", ")],
      ["Coverage", `${fixed(100 * found.coverage, 0)} % of the picture, ${found.views} pictures`],
      ["Made by", requester],
    ];
    this.facts.replaceChildren(
      ...rows.flatMap(([label, text]) => [element("dt", {}, label), element("dd", {}, text)]),
    );
    for (const button of [this.accept, this.cancel]) button.disabled = !this.isOperator;
    setText(this.accept, isGood ? "Accept" : "Accept anyway");
    this.accept.classList.toggle("caution", !isGood);
    this.draw(found);
  }

  draw({ corners, width, height, residual }) {
    const most = (LENGTH * width) / Math.max(residual, 1e-3),
      factor = FACTORS.findLast((one) => one <= most) ?? 1;
    this.picture.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.picture.ariaLabel = `residuals of ${corners.length} corners over the picture`;
    this.picture.replaceChildren(
      ...corners.map(([x, y, right, down]) =>
        svg("path", { d: `M${x} ${y}l${(factor * right).toFixed(1)} ${(factor * down).toFixed(1)}` }),
      ),
      ...corners.map(([x, y]) => svg("circle", { cx: x, cy: y, r: width / 320 })),
    );
    setText(
      this.caption,
      `The ${corners.length} corners, each with its residual, ${factor} times as long. Good ones ` +
        "point in all directions; a pattern means a lens that the model does not fit, or a bent board.",
    );
  }
}
