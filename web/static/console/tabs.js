// The tabs beside the 3D view. Below 900 px, where all stands in one column, charts and values are
// one more of them; in a wider window they are always in sight.

import { onKey } from "../core/keys.js";
import { $ } from "../core/dom.js";
import { icon } from "../icons/icons.js";

const narrow = matchMedia("(max-width: 900px)"); // as in the style sheets

// Arrow keys go from tab to tab, as in every tab list; only the open one is on the tab key's way.
export function tabs() {
  const wide = [...document.querySelectorAll("[role=tab]")].filter((button) => button !== $("open-charts"));
  const shown = () => (narrow.matches ? [...wide, $("open-charts")] : wide);
  const open = (wanted) => {
    for (const button of shown()) {
      button.setAttribute("aria-selected", String(button === wanted));
      button.tabIndex = button === wanted ? 0 : -1;
      $(button.getAttribute("aria-controls")).hidden = button !== wanted;
    }
    document.dispatchEvent(new CustomEvent("tab", { detail: wanted.dataset.tab }));
  };
  const selected = () => shown().find((button) => button.getAttribute("aria-selected") === "true") ?? wide[0];
  const fit = () => {
    const { matches } = narrow,
      place = $("tab-charts");
    $("open-charts").hidden = !matches;
    if (matches) place.setAttribute("role", "tabpanel");
    else {
      place.removeAttribute("role");
      place.hidden = false;
      $("open-charts").setAttribute("aria-selected", "false");
    }
    open(selected());
  };
  for (const link of document.querySelectorAll(".pages a")) link.prepend(icon(link.getAttribute("href")));
  for (const button of [...wide, $("open-charts")])
    button.prepend(icon(button.dataset.tab, button.dataset.icon));
  wide.forEach((button, i) => onKey(String(i + 1), `open ${button.textContent}`, () => button.click()));
  for (const button of [...wide, $("open-charts")]) {
    button.addEventListener("click", () => open(button));
    button.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      const all = shown(),
        next = all[(all.indexOf(button) + step + all.length) % all.length];
      next.focus();
      open(next);
    });
  }
  narrow.addEventListener("change", fit);
  fit();
}
