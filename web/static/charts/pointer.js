// What pointer, wheel and keys do in a chart: the shared cursor, zoom, pan.

import { element } from "../core/dom.js";

const STEP = 0.02; // of the span, of the cursor by keys
const LEAST = 5; // px of a drag

// Drag: zoom to it. Shift and drag, or a wheel sideways: pan. Wheel: zoom. Double click: all of it.
export function pointing(chart) {
  const { axis, plot } = chart,
    { signal } = chart.shown;
  const mark = element("i", { className: "marked", hidden: true });
  let down = null; // where a drag began: { x, time, pans }
  let dragged = false; // until the click that follows
  plot.append(mark);
  plot.title = "wheel or drag: zoom; Shift and drag: pan; double click: back";
  const at = (event) => event.clientX - plot.getBoundingClientRect().left;
  const on = (type, act, options = {}) => plot.addEventListener(type, act, { signal, ...options });

  on("pointermove", (event) => {
    chart.pointer = at(event);
    if (!axis.isKnown || !chart.uplot) return;
    if (down?.pans) axis.pan(down.time - chart.timeAt(chart.pointer));
    axis.point(chart.timeAt(chart.pointer));
    if (down && !down.pans) {
      const [left, right] = [down.x, chart.pointer].sort((a, b) => a - b);
      mark.hidden = right - left < LEAST;
      Object.assign(mark.style, { left: `${left}px`, width: `${right - left}px` });
    }
  });
  on("pointerleave", () => {
    chart.pointer = undefined;
    if (document.activeElement !== plot) axis.point(null);
  });
  on("pointerdown", (event) => {
    if (event.button || event.pointerType === "touch" || !axis.isKnown || !chart.uplot) return;
    down = { x: at(event), time: chart.timeAt(at(event)), pans: event.shiftKey };
    plot.setPointerCapture(event.pointerId);
  });
  on("pointerup", (event) => {
    const from = down;
    down = null;
    mark.hidden = true;
    dragged = Boolean(from) && Math.abs(at(event) - from.x) >= LEAST;
    if (!dragged || from.pans) return;
    const [start, end] = [from.time, chart.timeAt(at(event))].sort((a, b) => a - b);
    axis.show(start, end);
  });
  on("pointercancel", () => {
    down = null;
    mark.hidden = true;
  });
  on("click", (event) => {
    if (!dragged && chart.uplot) axis.choose(chart.timeAt(at(event)));
    dragged = false;
  });
  on("dblclick", () => axis.reset());
  on(
    "wheel",
    (event) => {
      if (!axis.isKnown || !chart.uplot) return;
      event.preventDefault();
      const [from, to] = axis.span,
        sideways = event.shiftKey ? event.deltaY : event.deltaX;
      if (Math.abs(sideways) > Math.abs(event.shiftKey ? 0 : event.deltaY))
        axis.pan(((to - from) * sideways) / 1000);
      else axis.scale(Math.exp(event.deltaY * 1.5e-3), chart.timeAt(at(event)));
    },
    { passive: false },
  );
}

// The same by keys, in the chart that has the focus.
export function pointingByKeys(chart) {
  const { axis, plot } = chart,
    { signal } = chart.shown;
  plot.tabIndex = 0;
  plot.addEventListener(
    "blur",
    () => {
      if (chart.pointer === undefined) axis.point(null);
    },
    { signal },
  );
  plot.addEventListener(
    "keydown",
    (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey || !axis.isKnown) return;
      const [from, to] = axis.span,
        cursor = axis.cursor ?? to,
        side = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (side && event.shiftKey) axis.pan(side * 0.2 * (to - from));
      else if (side) axis.point(Math.min(to, Math.max(from, cursor + side * STEP * (to - from))));
      else if (event.key === "+" || event.key === "-") axis.scale(event.key === "+" ? 0.7 : 1 / 0.7, cursor);
      else if (event.key === "Home") axis.reset();
      else if (event.key === "Escape") axis.point(null);
      else return;
      event.preventDefault();
      event.stopPropagation();
    },
    { signal },
  );
}
