// Sets of values under a name: the built-in ones and those somebody saved.

import { get, request } from "../core/api.js";
import { element, optionsOf } from "../core/dom.js";
import { timeOf } from "../core/format.js";

const PATH = "/api/parameters/presets";
const MODIFIED = "";

export class Presets {
  // show(diff options): the comparison before anything is switched.
  constructor(gains, place, show) {
    this.gains = gains;
    this.show = show;
    this.list = element("ul", { className: "presets" });
    this.answer = element("div", { className: "answer", hidden: true, role: "status" });
    this.name = element("input", { placeholder: "name", ariaLabel: "name of the new preset", maxLength: 60 });
    this.scope = element("select", { ariaLabel: "what the new preset contains" });
    const form = element(
      "form",
      {
        className: "tools",
        onsubmit: (event) => {
          event.preventDefault();
          this.save(false);
        },
      },
      this.name,
      this.scope,
      element(
        "button",
        { disabled: !gains.isOperator, title: "save the confirmed values under this name" },
        "Save",
      ),
    );
    place.append(this.answer, this.list, element("h2", {}, "Save the present values"), form);
    this.fillScope();
    this.read();
  }

  fillScope() {
    const components = [...new Set([...this.gains.rows.keys()].map((name) => name.split(".")[0]))];
    this.scope.replaceChildren(...optionsOf([...components, [MODIFIED, "all modified"]]));
  }

  async read() {
    let presets;
    try {
      ({ presets } = await get(PATH));
    } catch (error) {
      this.say(error.message);
      return;
    }
    presets.sort((a, b) => a.built_in - b.built_in); // one's own first
    this.list.replaceChildren(...presets.map((preset) => this.line(preset)));
  }

  line(preset) {
    const { name, who, stamp, built_in: isBuiltIn, count, differs } = preset;
    const facts = [isBuiltIn ? "built in" : `${who}, ${timeOf(stamp)}`, `${count} values`].join(" · ");
    const state =
      differs === 0 ? element("span", { className: "in-use" }, "✓ in use") : `differs in ${differs}`;
    const look = element(
      "button",
      {
        disabled: differs === 0,
        onclick: () => this.compare(preset),
        ariaLabel: `compare with preset ${name}`,
      },
      "Switch…",
    );
    const remove = element(
      "button",
      {
        disabled: !this.gains.isOperator,
        onclick: () => this.remove(preset),
        ariaLabel: `delete preset ${name}`,
      },
      "Delete",
    );
    return element(
      "li",
      {},
      element("span", { className: "name" }, name),
      element("span", { className: "buttons" }, ...(isBuiltIn ? [look] : [remove, look])),
      element("div", { className: "facts" }, `${facts} · `, state),
    );
  }

  async compare({ id, name }) {
    try {
      this.show({ title: `Switch to ${name}`, ...(await get(`${PATH}/${encodeURIComponent(id)}`)) });
    } catch (error) {
      this.say(error.message);
    }
  }

  async save(replaces) {
    const scope = this.scope.value,
      rows = [...this.gains.rows.values()].filter(({ description }) => !description.read_only);
    const chosen =
      scope === MODIFIED
        ? rows.filter((row) => row.isModified)
        : rows.filter(({ description }) => description.name.split(".")[0] === scope);
    const name = this.name.value.trim();
    if (!name) {
      this.say("Give it a name first.");
      this.name.focus();
      return;
    }
    if (chosen.length === 0) {
      this.say("Nothing is modified, so there is nothing to save.");
      return;
    }
    try {
      await request("POST", PATH, {
        name,
        parameters: chosen.map(({ description }) => description.name),
        replaces,
      });
      this.name.value = "";
      this.say(`Saved ${name} with ${chosen.length} values.`);
    } catch (error) {
      const isTaken = error.status === 409 && error.message.includes("replace");
      this.say(
        error.message,
        isTaken ? element("button", { onclick: () => this.save(true) }, "Replace") : null,
      );
    }
    this.read();
  }

  async remove({ id, name }) {
    try {
      await request("DELETE", `${PATH}/${id}`);
      this.say(`Deleted ${name}.`, element("button", { onclick: () => this.restore(id, name) }, "Undo"));
    } catch (error) {
      this.say(error.message);
    }
    this.read();
  }

  async restore(id, name) {
    try {
      await request("POST", `${PATH}/${id}/restore`, {});
      this.say(`${name} is back.`);
    } catch (error) {
      this.say(error.message);
    }
    this.read();
  }

  /** @param {HTMLElement | null} button */
  say(text, button = null) {
    this.answer.replaceChildren(text, ...(button ? [" ", button] : []));
    this.answer.hidden = false;
  }
}
