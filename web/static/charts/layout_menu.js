// Saving, removing, and files of chart layouts.

import { element } from "../core/dom.js";

export class LayoutMenu {
  // current(): the layout shown; shown(): its name or ""; show(name); listed(): names have changed
  // derive(text): a derived signal of a file, known from then on
  constructor(layouts, { current, shown, show, listed, derive }) {
    this.layouts = layouts;
    this.current = current;
    this.shown = shown;
    this.show = show;
    this.listed = listed;
    this.derive = derive;
    this.button = element(
      "button",
      {
        title: "save, remove, export and import layouts",
        ariaExpanded: "false",
        onclick: () => this.toggle(),
      },
      "Layouts",
    );
    this.name = element("input", {
      type: "text",
      maxLength: 40,
      placeholder: "name",
      ariaLabel: "name of the layout",
      onkeydown: (event) => {
        if (event.key === "Enter") this.save();
      },
    });
    this.remove = element(
      "button",
      {
        onclick: () =>
          this.attempt(() => {
            this.layouts.remove(this.shown());
            return "removed";
          }),
      },
      "Remove",
    );
    this.file = element("input", {
      type: "file",
      accept: ".json,application/json",
      hidden: true,
      onchange: () => this.read(),
    });
    this.answer = element("p", { role: "status", hidden: true });
    this.place = element(
      "div",
      { className: "menu layouts", role: "dialog", ariaLabel: "layouts of the charts", hidden: true },
      element(
        "div",
        { className: "tools" },
        this.name,
        element("button", { onclick: () => this.save() }, "Save"),
      ),
      element(
        "div",
        { className: "tools" },
        this.remove,
        element("button", { title: "save your layouts to a file", onclick: () => this.write() }, "Export"),
        element(
          "button",
          {
            title: "load layouts from a file; those of the same name are replaced",
            onclick: () => this.file.click(),
          },
          "Import",
        ),
        this.file,
      ),
      this.answer,
    );
    this.place.addEventListener("keydown", (event) => {
      if (event.key === "Escape") {
        this.close();
        this.button.focus();
        event.stopPropagation();
      }
    });
    document.addEventListener("pointerdown", (event) => {
      if (
        !this.place.hidden &&
        !this.place.contains(/** @type {Node} */ (event.target)) &&
        event.target !== this.button
      )
        this.close();
    });
  }

  toggle() {
    if (!this.place.hidden) {
      this.close();
      return;
    }
    this.place.hidden = this.answer.hidden = false;
    this.say("");
    this.button.ariaExpanded = "true";
    this.name.value = this.layouts.names.includes(this.shown()) ? this.shown() : "";
    this.remove.disabled = !this.layouts.names.includes(this.shown());
    this.name.focus();
  }

  close() {
    this.place.hidden = true;
    this.button.ariaExpanded = "false";
  }

  say(text) {
    this.answer.textContent = text;
    this.answer.hidden = !text;
  }

  // act(): what was done, in a word; or it throws.
  attempt(act) {
    try {
      this.say(act());
    } catch (error) {
      this.say(error.message);
    }
    this.remove.disabled = !this.layouts.names.includes(this.shown());
    this.listed();
  }

  save() {
    this.attempt(() => {
      const name = this.name.value.trim();
      this.layouts.save(name, this.current());
      this.show(name);
      return `saved as ${name}`;
    });
  }

  write() {
    const link = element("a", {
      href: URL.createObjectURL(new Blob([this.layouts.file], { type: "application/json" })),
      download: "chart_layouts.json",
    });
    link.click();
    URL.revokeObjectURL(link.href);
  }

  async read() {
    const text = (await this.file.files?.[0].text()) ?? "";
    this.file.value = "";
    try {
      for (const name of this.layouts.derivedOf(text)) await this.derive(name);
    } catch (error) {
      this.say(error.message);
      return;
    }
    this.attempt(() => `${this.layouts.take(text).join(", ") || "nothing"} imported`);
  }
}
