// Values to a TOML file and back; a file is compared first, and the chosen lines are applied.

import { request } from "../core/api.js";
import { attempt, element } from "../core/dom.js";

const PATH = "/api/parameters/file";

export class Files {
  // show(diff options): the comparison before anything is loaded.
  constructor(gains, place, show) {
    this.show = show;
    this.reason = element("div", { className: "reason", hidden: true, role: "status" });
    this.input = element("input", {
      type: "file",
      accept: ".toml",
      disabled: !gains.isOperator,
      ariaLabel: "file of parameters to load",
      onchange: () => this.load(),
    });
    place.append(
      element("h2", {}, "Save"),
      element(
        "p",
        { className: "facts" },
        "A TOML file with unit, bounds, default and meaning of each as comments.",
      ),
      element(
        "p",
        { className: "links" },
        element("a", { href: PATH, download: "" }, "All values"),
        element("a", { href: `${PATH}?which=modified`, download: "" }, "Modified values"),
      ),
      element("h2", {}, "Load"),
      element(
        "p",
        { className: "facts" },
        gains.isOperator
          ? "It is compared first; you choose what is applied."
          : "Viewers cannot load a file; ask an operator.",
      ),
      this.input,
      this.reason,
    );
  }

  async load() {
    const [file] = this.input.files ?? [];
    if (!file) return;
    await attempt(this.reason, async () => {
      const content = await request("POST", PATH, file, "application/toml");
      this.show({ title: `Load ${file.name}`, empty: "Loading this file would change nothing.", ...content });
    });
    this.input.value = ""; // the same file again is a change again
  }
}
