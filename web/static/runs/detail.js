// The chosen run: what can be done with it, its tags, notes and marks. Several: what can be done with all.

import { get, request } from "../core/api.js";
import { isThere } from "../core/vehicle_path.js";
import { element, hide } from "../core/dom.js";
import { icon } from "../icons/icons.js";
import { bytes, fixed } from "../core/format.js";
import { RunFill } from "./fill.js";
import { RunName } from "./name.js";
import { RunNotes } from "./notes.js";
import { RunReport } from "./report.js";
import { RunSharing } from "./sharing.js";
import { experiment, startOf, state } from "./labels.js";

export class RunDetail {
  // page: list, isOperator, remove(), say().
  constructor(place, page, events) {
    this.page = page;
    this.title = element("h2", {});
    this.naming = new RunName(page);
    this.facts = element("p", { className: "facts" });
    this.links = element("div", { className: "links" });
    this.sharing = new RunSharing();
    this.report = new RunReport(page.isOperator);
    this.fill = new RunFill(page, events);
    this.known = element("datalist", { id: "known-tags" });
    this.tags = element("div", { className: "tags" });
    this.tagInput = element("input", {
      placeholder: "add a tag",
      ariaLabel: "add a tag",
      maxLength: 40,
      disabled: !page.isOperator,
      list: "known-tags",
      onkeydown: (event) => this.tagKey(event),
      onchange: () => this.addTag(),
    });
    this.notes = new RunNotes(page);
    this.marks = element("ol", { className: "marks" });
    this.single = element(
      "div",
      {},
      this.fill.place,
      this.report.place,
      this.sharing.place,
      element("h3", {}, "Tags"),
      element("div", { className: "tag-row" }, this.tags, this.tagInput, this.known),
      this.notes.place,
      element("h3", {}, "Marks"),
      this.marks,
    );
    this.nothing = element("p", { className: "empty" }, "Choose a run to see its details.");
    this.content = element(
      "div",
      { hidden: true },
      this.title,
      this.naming.place,
      this.facts,
      this.links,
      this.single,
    );
    place.append(this.nothing, this.content);
    events.on("mark", ({ run_id: run }) => {
      if (run === this.run?.id) this.loadMarks();
    });
  }

  // run: under the cursor; chosen: by their boxes.
  show(run, chosen) {
    this.chosen = chosen;
    this.nothing.hidden = Boolean(run);
    this.content.hidden = !run;
    if (!run) {
      this.run = undefined;
      this.notes.show(null);
      return;
    }
    const isOther = run.id !== this.run?.id,
      several = chosen.length > 1;
    this.run = run;
    this.title.textContent = several ? `${chosen.length} runs selected` : startOf(run);
    const [text, , why] = state(run);
    this.facts.textContent = several
      ? chosen
          .map((one) => one.id)
          .slice(0, 3)
          .join(", ") + (chosen.length > 3 ? ", …" : "")
      : [
          run.id,
          run.operator,
          experiment(run),
          run.recording ? "" : bytes(run.bytes),
          run.problem || run.recovered || !run.complete ? `${text}: ${why}` : "",
        ]
          .filter(Boolean)
          .join(" · ");
    this.naming.show(several ? null : run);
    this.drawLinks(run, chosen);
    this.sharing.show(several ? null : run, isOther);
    const wanted = several ? null : run;
    this.fill.show(wanted);
    if (wanted?.id !== this.reported?.id || wanted?.recording !== this.reported?.recording)
      this.report.show(wanted);
    this.reported = wanted;
    this.drawTags();
    this.notes.show(several ? null : run);
    this.marks.hidden = several;
    hide(this.marks.previousElementSibling, several);
    if (isOther) {
      this.marks.replaceChildren();
      this.loadMarks();
    } else if (run.marks !== this.shownMarks) this.loadMarks();
  }

  drawLinks(run, chosen) {
    const id = encodeURIComponent(run.id),
      several = chosen.length > 1;
    const link = (href, text, more = {}) => element("a", { href, className: "button", ...more }, text);
    const remove = element(
      "button",
      {
        disabled: !this.page.isOperator || (!several && run.recording),
        title: this.page.isOperator ? "to the trash; can be undone (Delete)" : "operators delete",
        onclick: () => this.page.remove(),
      },
      several ? `Delete ${chosen.length}` : "Delete",
    );
    if (several) {
      const pair = [...chosen]
        .sort((a, b) => a.start_ns - b.start_ns)
        .map((one) => encodeURIComponent(one.id));
      const both =
        pair.length === 2 && isThere("replay")
          ? [
              link(`/replay/${pair[0]}?with=${pair[1]}`, "Overlay in replay", {
                title: "show both in one replay, aligned at an event",
              }),
            ]
          : [];
      const compare = isThere("compare")
        ? [
            link(`/compare?${pair.map((one) => `run=${one}`).join("&")}`, "Compare", {
              title: "signals aligned at an event, metrics, and parameters that differ",
            }),
          ]
        : [];
      this.links.replaceChildren(...compare, ...both, remove);
      return;
    }
    this.links.replaceChildren(
      ...(run.recording || !isThere("replay")
        ? []
        : [link(`/replay/${id}`, "Replay", { title: "3D, charts and timeline (Enter)" })]),
      ...(run.report
        ? [link(`/report/${id}`, "Report", { target: "_blank", title: "verdict and plots" })]
        : []),
      ...(this.page.isOperator && !run.recording
        ? [
            link(`/#again=${id}`, "Fly again", {
              title: "set its gains, beacons and experiment again; compared before anything is applied",
            }),
          ]
        : []),
      link(`/api/runs/${id}/download`, "Download", { download: "", title: `${run.id}.mcap` }),
      remove,
    );
  }

  get ids() {
    return this.chosen.length > 1 ? this.chosen.map(({ id }) => id) : [this.run.id];
  }

  suggest(names) {
    this.known.replaceChildren(...names.map((value) => element("option", { value })));
  }

  // Of several runs: those that all have; removing takes a tag from all.
  drawTags() {
    const runs = this.chosen.length > 1 ? this.chosen : [this.run];
    const shared = runs[0].tags.filter((tag) => runs.every((run) => run.tags.includes(tag)));
    const key = JSON.stringify([this.ids, shared]);
    if (key === this.drawnTags) return;
    this.drawnTags = key;
    this.tags.replaceChildren(
      ...shared.map((tag) =>
        element(
          "span",
          { className: "tag" },
          tag,
          ...(this.page.isOperator
            ? [
                element(
                  "button",
                  {
                    className: "link",
                    ariaLabel: `remove the tag ${tag}`,
                    onclick: () => this.changeTags([], [tag]),
                  },
                  icon("close"),
                ),
              ]
            : []),
        ),
      ),
    );
  }

  tagKey(event) {
    if (event.key === "Enter") this.addTag();
    else if (event.key === "Escape") this.page.list.table.focus();
  }

  addTag() {
    const tag = this.tagInput.value.trim();
    this.tagInput.value = "";
    if (tag) this.changeTags([tag], []);
  }

  changeTags(add, remove) {
    this.page.attempt(() => request("POST", "/api/tags", { runs: this.ids, add, remove }));
  }

  async loadMarks() {
    const { id, marks } = this.run;
    this.shownMarks = marks;
    let found = [];
    try {
      found = await get(`/api/runs/${encodeURIComponent(id)}/marks`);
    } catch {
      /* the list says what is wrong with it */
    }
    if (id !== this.run?.id || this.marks.contains(document.activeElement)) return;
    this.marks.replaceChildren(
      ...(found.length
        ? found.map((mark) => this.mark(mark))
        : [element("li", { className: "empty" }, "None yet. In flight, press M to mark a moment.")]),
    );
  }

  mark({ id, time, text, requester, run_id: run }) {
    const at = `${fixed(time, 1)} s`;
    const href = `/replay/${encodeURIComponent(run)}?at=${time.toFixed(2)}`;
    const place = isThere("replay") ? element("a", { href, title: "replay from here" }, at) : at;
    const input = element("input", {
      value: text,
      placeholder: "describe this mark",
      ariaLabel: `text of the mark at ${fixed(time, 1)} s`,
      maxLength: 500,
      disabled: !this.page.isOperator,
    });
    input.addEventListener("change", () =>
      this.page.attempt(async () => {
        const { logged } = await request("POST", "/api/marks", { id, text: input.value });
        if (!logged) this.page.say("Written in the catalogue; the log itself is closed and stays as it is.");
      }),
    );
    return element("li", {}, place, input, element("span", { className: "dim" }, requester));
  }

  edit(what) {
    (what === "tags" ? this.tagInput : this.notes.text).focus();
  }
}
