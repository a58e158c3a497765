// What a chart draws beside its lines: limits, events and missing samples below them, their names at their ends.

import { font, paint } from "../core/theme.js";

const LONGEST = 28; // characters of an event
const LONGEST_NAME = 18; // characters of a line's name

function shortened(text, most) {
  return text.length > most ? `${text.slice(0, most - 1)}…` : text;
}

// Below the lines. chart: units, limits, axis, hasEvents, and pieces, the samples of each line
export function drawMarks(u, { units, limits, axis, hasEvents, pieces }) {
  const { ctx, bbox } = u,
    { left, top, width, height } = bbox;
  ctx.save();
  ctx.beginPath();
  ctx.rect(left, top, width, height);
  ctx.clip();
  ctx.font = font(devicePixelRatio);
  ctx.lineWidth = devicePixelRatio;
  units.forEach((unit, i) => {
    if (!(unit in limits)) return;
    const y = u.valToPos(limits[unit], `y${i}`, true);
    stroke(ctx, "var(--amber)", [6, 4], [left, y], [left + width, y]);
  });
  drawHoles(u, pieces[0]?.holes ?? []);
  if (hasEvents) drawEvents(u, axis);
  ctx.restore();
}

function stroke(ctx, color, dash, [x, y], [across, up]) {
  ctx.strokeStyle = paint(color);
  ctx.setLineDash(dash.map((length) => length * devicePixelRatio));
  ctx.beginPath();
  ctx.moveTo(x, y);
  ctx.lineTo(across, up);
  ctx.stroke();
}

// When something happened; its words where they cover no others.
function drawEvents({ ctx, bbox: { left, top, width, height }, scales }, { events, origin }) {
  const ratio = devicePixelRatio,
    { min, max } = scales.x;
  let free = -Infinity;
  ctx.textBaseline = "top";
  ctx.textAlign = "left";
  for (const { t: time, text, kind } of events) {
    const t = time - origin;
    if (t < min || t > max) continue;
    const x = Math.round(left + ((t - min) / (max - min)) * width) + 0.5,
      isWarning = kind === "warn";
    stroke(ctx, isWarning ? "var(--amber)" : "var(--strong)", [], [x, top], [x, top + height]);
    if (x < free) continue;
    const words = shortened(text, LONGEST);
    ctx.fillStyle = paint(isWarning ? "var(--amber)" : "var(--dim)");
    ctx.fillText(words, x + 3 * ratio, top + 2 * ratio);
    free = x + ctx.measureText(words).width + 10 * ratio;
  }
}

// A mark at the bottom where samples are missing, and how many; those of neighbouring holes together.
function drawHoles({ ctx, bbox: { left, top, width, height }, scales }, holes) {
  const ratio = devicePixelRatio,
    { min, max } = scales.x,
    apart = 74 * ratio,
    groups = [];
  ctx.fillStyle = paint("var(--amber)");
  for (const { t, count } of holes) {
    const x = left + ((t - min) / (max - min)) * width;
    if (t < min || t > max || !count) continue;
    ctx.fillRect(x - ratio, top + height - 5 * ratio, 2 * ratio, 5 * ratio);
    const last = groups.at(-1);
    if (last && x - last.x < apart) last.count += count;
    else groups.push({ x, count });
  }
  ctx.textBaseline = "bottom";
  ctx.textAlign = "center";
  for (const { x, count } of groups)
    ctx.fillText(`${count} missing`, Math.max(left + apart / 2, x), top + height - 6 * ratio);
}

// The name of each line where it ends, at ends: [x, y] or null; moved apart where they would cover each other.
export function drawEnds({ ctx, bbox }, lines, ends) {
  const ratio = devicePixelRatio,
    least = 11 * ratio,
    right = bbox.left + bbox.width,
    bottom = bbox.top + bbox.height;
  const named = lines
    .map(({ label, stroke: color }, i) => ({ label, color, end: ends[i], y: 0 }))
    .filter(({ label, end }) => label && end);
  named.sort((a, b) => a.end[1] - b.end[1]);
  let below = bbox.top - least / 2;
  for (const one of named) below = one.y = Math.max(below + least, Math.min(one.end[1], bottom));
  let above = bottom + least / 2;
  for (const one of named.reverse()) above = one.y = Math.min(one.y, above - least);
  ctx.save();
  ctx.font = font(ratio);
  ctx.textBaseline = "middle";
  ctx.textAlign = "left";
  for (const { label, end, y, color } of named) {
    const text = shortened(label, LONGEST_NAME),
      wide = ctx.measureText(text).width;
    const x = Math.min(end[0] + 5 * ratio, right - wide - 2 * ratio);
    if (x < end[0]) {
      ctx.fillStyle = paint("var(--veil)");
      ctx.fillRect(x - 2 * ratio, y - least / 2, wide + 4 * ratio, least);
    }
    ctx.fillStyle = paint(color);
    ctx.fillText(text, x, y);
  }
  ctx.restore();
}
