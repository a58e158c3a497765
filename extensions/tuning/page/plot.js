// Set-points (dashed) and actual values (solid) of step tests, aligned at the first edge.

import { element } from "/static/core/dom.js";
import { axisLook, font, onTheme, paint } from "/static/core/theme.js";
import { DEGREES } from "./units.js";

const AXIS = { x: "var(--x)", y: "var(--y)", z: "var(--z)", yaw: "var(--z)" };
const OTHERS = ["var(--teal)", "var(--violet)", "var(--gold)", "var(--text)"];
const SETPOINT = "var(--dim)";

// The first one has its axis' colour; a letter at the end of each line says which it is, too.
export function colorsOf(runs) {
  return runs.map(({ plan }, i) => (i === 0 ? AXIS[plan.axis] : OTHERS[(i - 1) % OTHERS.length]));
}

export class TunePlot {
  constructor(place) {
    this.place = place;
    this.note = element(
      "p",
      { className: "empty" },
      "No test yet. Hover, choose an axis and run one; it is drawn here from the vehicle's own log.",
    );
    this.plot = element("div", { className: "plot", role: "img" });
    place.append(this.note, this.plot);
    this.plot.hidden = true;
    onTheme(this.plot, () => this.uplot?.redraw(false));
    new ResizeObserver(() => this.resize()).observe(this.plot);
  }

  // runs: with time, setpoint, actual; letters: one for each.
  show(runs, letters) {
    this.uplot?.destroy();
    this.uplot = undefined;
    this.note.hidden = runs.length > 0;
    this.plot.hidden = runs.length === 0;
    if (!runs.length) return;
    const colors = colorsOf(runs),
      isAngle = runs.every(({ plan }) => plan.axis === "yaw");
    const scaled = (values) =>
      isAngle ? values.map((value) => (value === null ? null : value * DEGREES)) : values;
    const planOf = ({ plan }) => JSON.stringify(plan);
    const setpoints = runs.filter((run, i) => runs.findIndex((other) => planOf(other) === planOf(run)) === i);
    const series = [
      ...setpoints.map((run) => ({
        run,
        values: scaled(run.setpoint),
        stroke: setpoints.length > 1 ? colors[runs.indexOf(run)] : SETPOINT,
        dash: [5, 4],
        width: 1.2,
        letter: "",
      })),
      ...runs.map((run, i) => ({
        run,
        values: scaled(run.actual),
        stroke: colors[i],
        dash: undefined,
        width: 1.5,
        letter: letters[i],
      })),
    ];
    this.plot.setAttribute(
      "aria-label",
      `set-point and actual of ${runs.map(({ plan }, i) => `${letters[i]}: ${plan.axis} ${plan.shape}`).join(", ")}`,
    );
    // Runs have their own times: what one has not at another's is left out, null is a gap.
    const data = uPlot.join(series.map(({ run, values }) => [run.time, values]));
    this.uplot = new uPlot(this.options(series, isAngle ? "°" : "m"), data, this.plot);
  }

  options(series, unit) {
    const line = axisLook();
    return {
      width: Math.max(50, this.plot.clientWidth),
      height: Math.max(50, this.plot.clientHeight),
      legend: { show: false },
      cursor: { drag: { x: true, y: false }, points: { show: false } },
      padding: [6, 18, 0, 0],
      scales: { x: { time: false } },
      axes: [
        {
          ...line,
          size: 20,
          gap: 3,
          values: (_, ticks) => ticks.map((tick) => `${Number(tick.toFixed(3))} s`),
        },
        { ...line, size: 46, gap: 5, label: unit, labelSize: 14, labelGap: 0, labelFont: "11px system-ui" },
      ],
      series: [
        {},
        ...series.map(({ stroke, dash, width }) => ({
          stroke: () => paint(stroke),
          dash,
          width,
          points: { show: false },
          spanGaps: false,
        })),
      ],
      hooks: { draw: [(plot) => label(plot, series)] },
    };
  }

  resize() {
    if (this.uplot && this.plot.clientWidth > 50)
      this.uplot.setSize({ width: this.plot.clientWidth, height: this.plot.clientHeight });
  }
}

// The letter of each line behind its last point in view; letters that would meet move apart.
function label(plot, series) {
  const { ctx, data } = plot,
    { min, max } = plot.scales.x,
    taken = [];
  ctx.save();
  ctx.font = font(devicePixelRatio);
  ctx.textBaseline = "middle";
  series.forEach(({ letter, stroke }, i) => {
    if (!letter) return;
    const values = data[i + 1];
    let at = values.length - 1;
    while (at >= 0 && (!Number.isFinite(values[at]) || data[0][at] > max)) at--;
    if (at < 0 || data[0][at] < min) return;
    let y = plot.valToPos(values[at], "y", true);
    const height = 12 * devicePixelRatio;
    while (taken.some((other) => Math.abs(other - y) < height)) y -= height;
    taken.push(y);
    ctx.fillStyle = paint(stroke);
    ctx.fillText(letter, plot.valToPos(data[0][at], "x", true) + 4 * devicePixelRatio, y);
  });
  ctx.restore();
}
