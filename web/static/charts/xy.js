// One signal over another: a chart's first signal is x, the others are y, over the time shown. A reference has
// its own x where that is shown too. Dots are where the cursor and a replay's play-head are.

import { Chart } from "./chart.js";
import { extent, spread } from "./lines.js";
import { indexAt } from "./history.js";
import { element } from "../core/dom.js";
import { axisLook } from "../core/theme.js";

export class XyChart extends Chart {
  dots = [element("i", { className: "dot cursor" }), element("i", { className: "dot" })];
  spans = /** @type {Record<string, [number, number]>} */ ({}); // of each axis: "x" and units

  attach() {} // zoom and pan are those of the time, in the other charts

  select(names) {
    super.select(names);
    this.plot.append(...(this.dots ?? []));
    this.plot.ariaLabel =
      names.length > 1
        ? `${names
            .filter((name) => this.isY(name))
            .map((name) => this.title(name))
            .join(", ")} over ${this.title(names[0])}`
        : "empty chart";
  }

  // The signal that is x for another one: that of the same vector, if it is shown.
  xOf(name) {
    const [first] = this.names,
      partner = `${name.slice(0, name.lastIndexOf(".") + 1)}${first.slice(first.lastIndexOf(".") + 1)}`;
    return this.names.includes(partner) ? partner : first;
  }

  isY(name) {
    return this.xOf(name) !== name;
  }
  yUnits() {
    return [...new Set(this.names.filter((name) => this.isY(name)).map((name) => this.signal(name).unit))];
  }

  isListed({ name }) {
    return this.isY(name);
  }

  entries() {
    if (this.names.length < 2) return [element("span", {}, "choose two signals or more: the first is x")];
    return [...super.entries(), element("span", { className: "over" }, `over ${this.title(this.names[0])}`)];
  }

  options() {
    const options = super.options(),
      look = axisLook(),
      units = this.yUnits();
    const unit = this.names.length ? this.signal(this.names[0]).unit : "";
    return {
      ...options,
      scales: {
        x: { time: false, range: () => this.spans?.x ?? [-1, 1] },
        ...Object.fromEntries(
          (units.length ? units : [""]).map((one, i) => [
            `y${i}`,
            { range: () => this.spans?.[one] ?? [-1, 1] },
          ]),
        ),
      },
      axes: [
        { ...look, size: 34, gap: 3, label: unit || undefined, labelSize: 14, labelGap: 0 },
        ...(units.length ? units : [""]).map((one, i) => ({
          ...look,
          ...(i ? { grid: { show: false } } : {}),
          scale: `y${i}`,
          side: i ? 1 : 3,
          size: 48,
          gap: 5,
          label: one || undefined,
          labelSize: 15,
          labelGap: 0,
        })),
      ],
      hooks: { ...options.hooks, drawClear: [] },
      series: options.series.map((series, i) =>
        i ? { ...series, scale: `y${Math.max(0, units.indexOf(this.lines[i - 1].unit))}` } : series,
      ),
    };
  }

  // Ranges of all axes; where x and y have one unit, a metre is as long on both.
  measure() {
    const { bbox } = this.uplot,
      [first] = this.names;
    const of = (isWanted, unit) => {
      let low = null,
        high = null;
      this.pieces.forEach((piece, i) => {
        if (piece && isWanted(this.lines[i]))
          [low, high] = extent(piece.values, piece.from, piece.to, low, high);
      });
      return spread(low, high, unit);
    };
    const unit = first ? this.signal(first).unit : "",
      units = this.yUnits();
    this.spans = { x: of(({ name }) => !this.isY(name), unit) };
    for (const one of units)
      this.spans[one] = this.scales[one] ?? of(({ name, unit: its }) => this.isY(name) && its === one, one);
    if (units.length !== 1 || units[0] !== unit || this.scales[unit] || !bbox.height) return;
    const [x, y] = [this.spans.x, this.spans[unit]],
      size = Math.max((x[1] - x[0]) / bbox.width, (y[1] - y[0]) / bbox.height);
    const about = ([low, high], length) =>
      /** @type {[number, number]} */ ([(low + high - length) / 2, (low + high + length) / 2]);
    this.spans = { x: about(x, size * bbox.width), [unit]: about(y, size * bbox.height) };
  }

  show() {
    if (this.names.length) this.measure();
    this.uplot.setScale("x", { min: this.spans.x?.[0] ?? -1, max: this.spans.x?.[1] ?? 1 });
  }

  pieceOfX(i) {
    const line = this.lines[i];
    return this.pieces[
      this.lines.findIndex(({ name, run }) => name === this.xOf(line.name) && run === line.run)
    ];
  }

  path(u, i) {
    const piece = this.pieces[i],
      line = this.lines[i];
    if (!piece || !this.isY(line.name)) return null;
    const x = this.pieceOfX(i),
      key = u.series[i + 1].scale,
      path = new Path2D();
    if (!x) return null;
    const { times, values, from, to } = piece,
      [start, end] = this.shownOf(line);
    let isDrawn = false;
    for (let k = from; k < to; k++) {
      const across = times[k] >= start && times[k] <= end ? at(x, times[k]) : NaN;
      if (!Number.isFinite(values[k] + across)) {
        isDrawn = false;
        continue;
      }
      path[isDrawn ? "lineTo" : "moveTo"](u.valToPos(across, "x", true), u.valToPos(values[k], key, true));
      isDrawn = true;
    }
    return { stroke: path, fill: null, clip: null, band: null, gaps: null, flags: 1 };
  }

  // The time shown, on the line's own clock.
  shownOf({ run }) {
    return this.axis.span.map((time) => time + (run?.shift ?? 0));
  }

  drawEnds() {}

  moveLines() {
    const { uplot, axis } = this,
      first = this.lines?.findIndex(({ name }) => this.isY(name)) ?? -1;
    if (!uplot || !this.dots) return;
    this.cursor.hidden = this.head.hidden = true;
    [axis.cursor, axis.head].forEach((time, k) => {
      const piece = first >= 0 && time !== null ? this.pieces[first] : undefined,
        x = piece && this.pieceOfX(first),
        own = time + (this.lines[first]?.run?.shift ?? 0);
      const place = x ? [at(x, own), at(piece, own)] : [NaN, NaN],
        dot = this.dots[k];
      dot.hidden = !place.every(Number.isFinite);
      if (dot.hidden) return;
      const across = uplot.valToPos(place[0], "x", true);
      const along = uplot.valToPos(place[1], uplot.series[first + 1].scale, true);
      const [right, down] = [across, along].map((one) => `${(one / devicePixelRatio).toFixed(1)}px`);
      dot.style.transform = `translate(${right}, ${down})`;
    });
  }
}

// The value at a time, between two samples.
function at({ times, values, from, to }, time) {
  const next = indexAt(times, time, from, to);
  if (next >= to || (next === from && times[next] > time)) return NaN;
  if (next === from || times[next] === time) return values[next];
  const share = (time - times[next - 1]) / (times[next] - times[next - 1]);
  return values[next - 1] + share * (values[next] - values[next - 1]);
}
