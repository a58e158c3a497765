// The motor law of a bench: force over reference, steps as points, f = (slope (ref + offset))² as a line.

import { element } from "../core/dom.js";
import { axisLook, onTheme, paint } from "../core/theme.js";

const HEIGHT = 170;
const STEPS = 120; // points of the line
const STEP = /^step ([\d.]+), count/; // the residual of one

// record: of a motor; an element that draws itself when it has a size, or null when it lacks the law.
export function motorFit({ values, residuals }) {
  const slope = values["model.motor_slope"],
    offset = values["model.motor_offset"];
  const points = residuals
    .filter(([name]) => STEP.test(name))
    .map(([name, miss]) => [Number(STEP.exec(name)?.[1]), miss]);
  if (!(slope > 0) || !Number.isFinite(offset) || points.length < 2) return null;
  const force = (reference) => (slope * Math.max(0, reference + offset)) ** 2;
  // A residual is what the law of the measured force says, less the reference that was commanded.
  const steps = points
    .map(([reference, miss]) => [reference, force(reference + miss)])
    .sort((a, b) => a[0] - b[0]);
  const from = steps[0][0],
    to = steps.at(-1)[0];
  const line = Array.from({ length: STEPS + 1 }, (_, i) => from + ((to - from) * i) / STEPS);
  const data = uPlot.join([
    [line, line.map(force)],
    [steps.map(([x]) => x), steps.map(([, y]) => y)],
  ]);
  const canvas = element("div", {
    className: "plot",
    role: "img",
    ariaLabel:
      `force over reference: ${steps.length} steps from ${from} to ${to} counts, 0 to ` +
      `${force(to).toFixed(2)} N, and the law fitted to them`,
  });
  const place = element(
    "figure",
    { className: "fit" },
    element("h3", {}, "Force over reference", element("span", {}, ", the law and the steps")),
    canvas,
  );
  let uplot = null;
  new ResizeObserver(() => {
    const width = canvas.clientWidth;
    if (width < 80) return;
    if (uplot) uplot.setSize({ width, height: HEIGHT });
    else uplot = new uPlot(options(width), data, canvas);
  }).observe(canvas);
  onTheme(place, () => uplot?.redraw(false));
  return place;
}

function options(width) {
  const line = { ...axisLook(), labelSize: 15, labelGap: 0 };
  return {
    width,
    height: HEIGHT,
    legend: { show: false },
    cursor: { show: false },
    padding: [6, 10, 0, 0],
    scales: { x: { time: false }, y: { range: (_, __, high) => [0, 1.06 * (high || 1)] } },
    axes: [
      { ...line, size: 20, gap: 3, label: "counts" },
      { ...line, size: 34, gap: 5, label: "N" },
    ],
    series: [
      {},
      { stroke: () => paint("var(--y)"), width: 1.4, spanGaps: true, pxAlign: 0, points: { show: false } },
      {
        stroke: () => paint("var(--text)"),
        width: 0,
        points: { show: true, size: 6, width: 1.4, fill: () => paint("var(--panel)") },
      },
    ],
  };
}
