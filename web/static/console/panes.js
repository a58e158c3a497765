// The edges between the parts of the console, to be dragged: left of the tabs, and above the charts. Where they were
// put is kept in this browser; a double click puts one back.

import { element, recall, remember } from "../core/dom.js";

const KEPT = "quadlab.panes";
const STEP = 20; // px, of a key
const LEAST = 120; // px of the 3D view and the charts

/** @type {() => Record<string, number>} */
const kept = () => ({ ...recall(KEPT) }); // a text of others has none of its names

// What a pane may be, in px, in this window.
/** @type {(least: number, most: number, wanted: number) => number} */
const fitted = (least, most, wanted) => Math.round(Math.max(least, Math.min(most, wanted)));

class Edge {
  /**
   * size(): of the pane now; at(event): what it is to be; most(): what it may be, px.
   * @param {{ name: string, label: string, orientation: string, least: number, grows: string, shrinks: string,
   *   size: () => number, at: (event: PointerEvent) => number, most: () => number }} pane
   */
  constructor(pane) {
    this.pane = pane;
    this.place = element("div", {
      className: `edge ${pane.name}`,
      role: "separator",
      tabIndex: 0,
      ariaLabel: pane.label,
      ariaOrientation: pane.orientation,
      title: "drag, or use the arrow keys; double click: as it was",
    });
    const { place } = this;
    place.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      event.preventDefault();
      place.setPointerCapture(event.pointerId); // also over the frame of the 3D view
    });
    place.addEventListener("pointermove", (event) => {
      if (place.hasPointerCapture(event.pointerId)) this.put(pane.at(event));
    });
    place.addEventListener("dblclick", () => this.put(null));
    place.addEventListener("keydown", (event) => {
      const side = { [pane.grows]: 1, [pane.shrinks]: -1 }[event.key];
      if (!side) return;
      this.put(pane.size() + side * STEP);
      event.preventDefault();
      event.stopPropagation();
    });
    document.body.append(place);
    this.put(kept()[pane.name] ?? null);
    addEventListener("resize", () => this.put(kept()[pane.name] ?? null));
  }

  /** @param {number | null} wanted */
  put(wanted) {
    const { name, least, most, size } = this.pane,
      { style } = document.body;
    if (typeof wanted === "number" && Number.isFinite(wanted))
      style.setProperty(`--${name}`, `${fitted(least, most(), wanted)}px`);
    else style.removeProperty(`--${name}`);
    this.place.ariaValueMin = String(least);
    this.place.ariaValueMax = String(Math.round(most()));
    this.place.ariaValueNow = String(Math.round(size()));
    remember(KEPT, { ...kept(), [name]: wanted ?? undefined });
  }
}

/** @param {{ side: HTMLElement, charts: HTMLElement, view: HTMLElement }} parts */
export function addEdges({ side, charts, view }) {
  new Edge({
    name: "side",
    label: "width of the tabs",
    orientation: "vertical",
    least: 320,
    grows: "ArrowLeft",
    shrinks: "ArrowRight",
    size: () => side.offsetWidth,
    at: ({ clientX }) => innerWidth - clientX,
    most: () => innerWidth / 2,
  });
  new Edge({
    name: "charts",
    label: "height of the charts",
    orientation: "horizontal",
    least: LEAST,
    grows: "ArrowUp",
    shrinks: "ArrowDown",
    size: () => charts.offsetHeight,
    at: ({ clientY }) => innerHeight - clientY,
    most: () => view.offsetHeight + charts.offsetHeight - LEAST,
  });
}
