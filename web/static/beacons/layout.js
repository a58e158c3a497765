// Where the beacons stand. The table shows what station and vehicle confirmed; what is typed is a
// draft, marked as such, until it is applied. A refused draft is put aside with its reason.

import { request } from "../core/api.js";
import { element, hide, optionsOf, setIfChanged, setText, showNote } from "../core/dom.js";
import { icon } from "../icons/icons.js";
import { exact, parseNumber } from "../core/format.js";

// As it is, with three decimals at least, so that the points stand under each other.
const metres = (value) => {
  const text = exact(value);
  return /^-?\d+(\.\d{0,2})?$/.test(text) ? value.toFixed(3) : text;
};
const textsOf = ([id, ...place]) => [exact(id), ...place.map(metres)];

const AXES = ["x", "y", "z"];
const MOST = 32;

export class Layout {
  constructor(place, isOperator) {
    this.isOperator = isOperator;
    this.confirmed = [];
    this.draft = null; // rows of texts, while something is typed
    this.presets = {};
    this.preset = element("select", {
      ariaLabel: "preset of beacons",
      disabled: !isOperator,
      onchange: () => this.send({ preset: this.preset.value }),
    });
    this.body = element("tbody");
    this.reason = element("div", { className: "reason", hidden: true, role: "status" });
    this.file = element("input", {
      type: "file",
      accept: ".csv,text/csv",
      hidden: true,
      disabled: !isOperator,
      onchange: () => this.load(),
    });
    this.apply = button("Apply", "send the layout as typed to station and vehicle", () =>
      this.send(this.rows()),
    );
    this.discard = button("Discard", "back to the confirmed layout", () => this.edit(null));
    this.add = button("Add beacon", "", () => this.edit([...this.texts(), this.another()]));
    this.again = button("Edit again", "edit the refused draft again", () => this.edit(this.refused));
    const open = button("Load CSV", "a file with the header id,x,y,z, positions in m", () =>
      this.file.click(),
    );
    const save = element(
      "a",
      {
        className: "button",
        href: "/api/beacons/file",
        download: "beacons.csv",
        title: "the confirmed layout",
      },
      "Save CSV",
    );
    for (const one of [this.apply, this.discard, this.add, this.again, open]) one.disabled = !isOperator;
    const head = element(
      "tr",
      {},
      element("th", {}, "id"),
      ...AXES.map((axis) => element("th", { className: `axis-${axis}` }, `${axis} [m]`)),
      element("th", {}, element("span", { className: "unseen" }, "remove")),
    );
    this.why = element("p", { className: "facts", hidden: true, role: "status" });
    this.fields = element(
      "fieldset",
      { className: "plain" },
      element("div", { className: "line" }, element("label", {}, "Preset", this.preset), open, save),
      element("table", { className: "layout" }, element("thead", {}, head), this.body),
      element("div", { className: "line" }, this.add, element("i"), this.discard, this.apply),
      element("div", { className: "line refused" }, this.reason, this.again),
    );
    place.append(element("h2", {}, "Layout"), this.why, this.file, this.fields);
    this.draw();
  }

  // why: what has to end before beacons may be moved, or "".
  lock(why) {
    this.fields.disabled = Boolean(why);
    setText(this.why, why);
    hide(this.why, !why);
  }

  // rows: [[id, x, y, z], …] in m, confirmed; preset: its name, or "" for none
  show(rows, presets, preset) {
    this.confirmed = rows;
    if (Object.keys(presets).length + 1 !== this.preset.options.length) {
      this.preset.replaceChildren(
        element("option", { value: "", disabled: true }, "own"),
        ...optionsOf(Object.keys(presets)),
      );
    }
    this.name = preset;
    this.draw();
  }

  texts() {
    return (this.draft ?? this.confirmed.map(textsOf)).map((row) => [...row]);
  }
  rows() {
    return this.texts().map((row) => row.map(parseNumber));
  }

  // One more where it will do: beside the others, at their mean height.
  another() {
    const rows = this.rows().filter((row) => row.every(Number.isFinite)),
      heights = rows.map((row) => row[3]);
    const mean = heights.reduce((sum, z) => sum + z, 0) / Math.max(1, heights.length);
    return textsOf([Math.max(0, ...rows.map(([id]) => id)) + 1, 0, 0, mean]);
  }

  edit(rows) {
    this.draft = rows;
    this.refused = null;
    this.reason.hidden = true;
    this.draw();
  }

  async send(body) {
    const wrong = Array.isArray(body) ? body.findIndex((row) => !row.every(Number.isFinite)) : -1;
    if (wrong >= 0) {
      this.refuse(`row ${wrong + 1}: id, x, y and z are numbers, in m`, true);
      return;
    }
    await this.attempt(() => request("PUT", "/api/beacons", body));
  }

  async load() {
    const [file] = this.file.files ?? [];
    this.file.value = "";
    if (!file) return;
    await this.attempt(() =>
      request("PUT", `/api/beacons?name=${encodeURIComponent(file.name.slice(0, 100))}`, file, "text/csv"),
    );
  }

  async attempt(act) {
    this.reason.hidden = true;
    this.body.classList.add("waiting");
    try {
      const { beacons } = await act();
      this.confirmed = beacons;
      this.edit(null);
    } catch (error) {
      this.refuse(error.message);
    } finally {
      this.body.classList.remove("waiting");
    }
  }

  // What is confirmed stands in the table again, unless the draft never left the page.
  refuse(reason, keepsDraft = false) {
    if (!keepsDraft) {
      this.refused = this.draft;
      this.draft = null;
    }
    this.draw();
    showNote(this.reason, reason);
  }

  draw() {
    this.preset.value = this.draft ? "" : (this.name ?? "");
    const texts = this.texts();
    if (this.body.contains(document.activeElement) && this.body.rows.length === texts.length)
      this.fill(texts);
    else this.body.replaceChildren(...texts.map((row, index) => this.row(row, index)));
    this.mark();
  }

  fill(texts) {
    texts.forEach((row, i) =>
      row.forEach((text, k) => {
        const input = this.body.rows[i].cells[k].firstChild;
        setIfChanged(input, "value", text); // else the caret would jump
      }),
    );
  }

  row(texts, index) {
    const inputs = texts.map((text, k) => {
      const input = element("input", {
        value: text,
        disabled: !this.isOperator,
        inputMode: "decimal",
        spellcheck: false,
        ariaLabel: `${["id", ...AXES][k]} of beacon ${texts[0]}`,
      });
      input.addEventListener("input", () => {
        this.draft = this.texts();
        this.draft[index][k] = input.value;
        this.reason.hidden = true;
        this.mark();
      });
      input.addEventListener("keydown", (event) => {
        if (event.key === "Enter" && this.draft) this.send(this.rows());
        if (event.key === "Escape") {
          input.blur();
          this.edit(null);
        }
      });
      return input;
    });
    const remove = element(
      "button",
      {
        className: "remove",
        disabled: !this.isOperator,
        title: `remove beacon ${texts[0]}`,
        onclick: () => this.edit(this.texts().filter((_, i) => i !== index)),
      },
      icon("close"),
    );
    return element("tr", {}, ...inputs.map((input) => element("td", {}, input)), element("td", {}, remove));
  }

  // Cells that are not what is confirmed, and the buttons that matter now.
  mark() {
    const known = new Map(this.confirmed.map((row) => [exact(row[0]), textsOf(row)]));
    this.texts().forEach((texts, i) => {
      const before = known.get(texts[0]);
      texts.forEach((text, k) =>
        this.body.rows[i]?.cells[k].firstElementChild?.classList.toggle(
          "draft",
          Boolean(this.draft) && before?.[k] !== text,
        ),
      );
    });
    this.apply.hidden = this.discard.hidden = !this.draft;
    this.again.hidden = !this.refused || Boolean(this.draft);
    this.add.disabled = !this.isOperator || this.texts().length >= MOST;
  }
}

const button = (text, title, onclick) => element("button", { title, onclick }, text);
