// What a chart shows as files: a picture, and its numbers.

import { binary } from "../core/api.js";
import { element } from "../core/dom.js";
import { font, onPaper, paint } from "../core/theme.js";
import { documentOf, recorded } from "./svg.js";

const PIXELS = 96,
  MILLIMETRES = 25.4; // in an inch
const MARGIN = 10; // px
const HEIGHT = 0.56; // of a figure on paper, of its width

/**
 * Signals of the same instants.
 * @typedef {{ names: string[], times: ArrayLike<number>, columns: ArrayLike<number>[] }} Group
 */

// A row an instant, a column a signal; empty where a signal has no value then.
/** @param {string} time the first column's name @param {Group[]} groups */
export function csvOf(time, groups) {
  const names = groups.flatMap((group) => group.names),
    width = names.length;
  /** @type {Map<number, string[]>} */
  const rows = new Map();
  let first = 0;
  for (const { names: own, times, columns } of groups) {
    for (let i = 0; i < times.length; i++) {
      const row = rows.get(times[i]) ?? Array(width).fill("");
      columns.forEach((column, k) => {
        if (Number.isFinite(column[i])) row[first + k] = String(column[i]);
      });
      if (row.some(Boolean)) rows.set(times[i], row);
    }
    first += own.length;
  }
  const quoted = [time, ...names].map((name) =>
    /[",\n]/.test(name) ? `"${name.replaceAll('"', '""')}"` : name,
  );
  const lines = [...rows]
    .sort(([a], [b]) => a - b)
    .map(([at, row]) => `${Number(at.toFixed(6))},${row.join(",")}`);
  return `${[quoted.join(","), ...lines].join("\n")}\n`;
}

/** @param {Blob} blob @param {string} name */
export function save(blob, name) {
  const link = element("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  URL.revokeObjectURL(link.href);
}

/** @param {any} chart */
const fileName = (chart) =>
  (chart.names.slice(0, 3).join("_") || "chart").replace(/[^\w.-]+/g, "_").slice(0, 80);

// All samples of the time shown where the source has them, else what is drawn.
/** @param {any} chart */
export async function saveNumbers(chart) {
  const { source, axis, lines, pieces } = chart,
    [from, to] = axis.span;
  const groups = source.table
    ? await source.table(chart.names, from, to)
    : lines.flatMap((/** @type {any} */ { name, rotor, motor }, /** @type {number} */ i) => {
        const piece = pieces[i],
          part = (/** @type {any} */ list) => Array.from(list).slice(piece.from, piece.to);
        return piece
          ? [
              {
                names: [motor ? `rotor ${motor ?? rotor}` : name],
                times: part(piece.times),
                columns: [part(piece.values)],
              },
            ]
          : [];
      });
  save(new Blob([csvOf(chart.xName, groups)], { type: "text/csv" }), `${fileName(chart)}.csv`);
}

// A canvas with the names of the lines, on which what the chart shows is then drawn at `at`.
/** @param {any} chart */
function sheet(chart) {
  const { canvas } = chart.uplot.ctx,
    ratio = devicePixelRatio,
    margin = MARGIN * ratio,
    row = 16 * ratio;
  const picture = element("canvas", {
    width: canvas.width + 2 * margin,
    height: canvas.height + row + 2 * margin,
  });
  const context = /** @type {CanvasRenderingContext2D} */ (picture.getContext("2d"));
  const drawNames = () => {
    context.fillStyle = paint("var(--panel)");
    context.fillRect(0, 0, picture.width, picture.height);
    context.font = font(ratio);
    context.textBaseline = "middle";
    let x = margin;
    for (const { label, stroke, dash, name } of chart.lines.filter((/** @type {any} */ line) => line.label)) {
      const text = `${label}${chart.signal(name).unit ? `, ${chart.signal(name).unit}` : ""}`;
      context.strokeStyle = paint(stroke);
      context.lineWidth = 2 * ratio;
      context.setLineDash((dash ?? []).map((/** @type {number} */ length) => length * ratio));
      context.beginPath();
      context.moveTo(x, margin + row / 2);
      context.lineTo(x + 20 * ratio, margin + row / 2);
      context.stroke();
      context.fillStyle = paint("var(--text)");
      context.fillText(text, x + 25 * ratio, margin + row / 2);
      x += context.measureText(text).width + 40 * ratio;
    }
  };
  return { canvas, picture, context, drawNames, at: [margin, margin + row], ratio };
}

/** @param {any} chart */
export function savePicture(chart) {
  const {
    canvas,
    picture,
    context,
    drawNames,
    at: [x, y],
  } = sheet(chart);
  drawNames();
  context.drawImage(canvas, x, y);
  picture.toBlob((blob) => {
    if (blob) save(blob, `${fileName(chart)}.png`);
  });
}

// In a width on paper (mm) it is drawn anew for that: text of 8 pt, lines of 1 pt, light. A PDF is made by the server,
// which has fonts to embed.
/** @param {any} chart @param {number} paper @param {boolean} [isPdf] */
export async function savePaper(chart, paper, isPdf) {
  const width = Math.round((paper * PIXELS) / MILLIMETRES),
    turn = () => new Promise((done) => setTimeout(done));
  let svg = "";
  try {
    await onPaper(async () => {
      chart.uplot.setSize({ width: width - 2 * MARGIN, height: Math.round(HEIGHT * width) });
      await turn(); // uPlot sets its size a little later
      svg = await drawingOf(chart, paper);
    });
  } finally {
    chart.resize();
  }
  const name = `${fileName(chart)}_${paper}mm`;
  if (isPdf) save(new Blob([await binary("/api/figure", { method: "POST", body: svg })]), `${name}.pdf`);
  else saveSvg(svg, name);
}

/** @param {string} svg @param {string} name */
const saveSvg = (svg, name) => save(new Blob([svg], { type: "image/svg+xml" }), `${name}.svg`);

/** @param {any} chart */
export const saveDrawing = async (chart) => saveSvg(await drawingOf(chart), fileName(chart));

/** @param {any} chart @param {number} [paper] mm */
async function drawingOf(chart, paper) {
  const { uplot } = chart,
    {
      picture,
      context,
      drawNames,
      at: [x, y],
      ratio,
    } = sheet(chart);
  const names = await recorded(context, drawNames);
  const plot = await recorded(uplot.ctx, () => {
    uplot.redraw();
    return new Promise((done) => {
      setTimeout(done);
    });
  });
  const parts = [...names, `<g transform="translate(${x} ${y})">`, ...plot, "</g>"];
  return documentOf(parts, picture.width, picture.height, ratio, paper);
}
