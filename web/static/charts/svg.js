// What is drawn on a canvas, recorded as an SVG while it is drawn.

/** @param {number} value */
const number = (value) => String(Number(value.toFixed(2)));
/** @param {string} text */
const escaped = (text) => text.replace(/[&<>"]/g, (one) => `&#${one.charCodeAt(0)};`);
/** @param {Record<string, any>} attributes */
const written = (attributes) =>
  Object.entries(attributes)
    .filter(([, value]) => value !== "" && value !== undefined)
    .map(
      ([name, value]) => ` ${name}="${escaped(typeof value === "number" ? number(value) : String(value))}"`,
    )
    .join("");

/** @type {Record<string, (...c: number[]) => string>} */
const STEPS = {
  moveTo: (x, y) => `M${number(x)} ${number(y)}`,
  lineTo: (x, y) => `L${number(x)} ${number(y)}`,
  rect: (x, y, w, h) => `M${number(x)} ${number(y)}h${number(w)}v${number(h)}h${number(-w)}z`,
  arc: (x, y, r) =>
    `M${number(x - r)} ${number(y)}a${number(r)} ${number(r)} 0 1 0 ${number(2 * r)} 0a${number(r)} ` +
    `${number(r)} 0 1 0 ${number(-2 * r)} 0`, // all are circles
  closePath: () => "z",
};
const BASELINES = /** @type {Record<string, string>} */ ({
  top: "text-before-edge",
  middle: "central",
  bottom: "text-after-edge",
});
const ANCHORS = /** @type {Record<string, string>} */ ({ center: "middle", right: "end", end: "end" });

// Runs draw() with its strokes, fills, texts and pictures on `context` recorded: the elements of an SVG, in the
// canvas's pixels. Paths made meanwhile are recorded; a cleared canvas begins anew.
/** @param {any} context @param {() => unknown} draw @returns {Promise<string[]>} */
export async function recorded(context, draw) {
  const Plain = globalThis.Path2D;
  /** @type {string[]} */
  let parts = [];
  let path = "",
    clip = "";
  /** @type {string[]} */
  const clips = [],
    known = [];
  class Traced extends Plain {
    d = "";
  }
  for (const [name, step] of Object.entries(STEPS)) {
    /** @type {any} */ (Traced.prototype)[name] = function (/** @type {number[]} */ ...c) {
      this.d += step(...c);
      return /** @type {any} */ (Plain.prototype)[name].apply(this, c);
    };
  }
  /** @param {string} tag @param {Record<string, any>} attributes */
  const add = (tag, attributes, content = "") => {
    const { a, b, c, d, e, f } = context.getTransform();
    const matrix = [a, b, c, d, e, f];
    const isMoved = matrix.join() !== "1,0,0,1,0,0";
    const all = written({
      ...attributes,
      "clip-path": clip,
      opacity: context.globalAlpha === 1 ? "" : context.globalAlpha,
      transform: isMoved ? `matrix(${matrix.map(number).join(" ")})` : "",
    });
    parts.push(`<${tag}${all}${content ? `>${content}</${tag}>` : "/>"}`);
  };
  /** @type {Record<string, (...given: any[]) => void>} */
  const heard = {
    clearRect: () => {
      parts = [];
      known.length = 0;
    },
    save: () => clips.push(clip),
    restore: () => {
      clip = clips.pop() ?? "";
    },
    clip: (own) => {
      // the innermost alone: the others are around it
      const d = own?.d ?? path;
      if (!known.includes(d)) parts.push(`<clipPath id="c${known.push(d) - 1}"><path d="${d}"/></clipPath>`);
      clip = `url(#c${known.indexOf(d)})`;
    },
    beginPath: () => {
      path = "";
    },
    stroke: (own) =>
      add("path", {
        d: own?.d ?? path,
        fill: "none",
        stroke: context.strokeStyle,
        "stroke-width": context.lineWidth,
        "stroke-dasharray": context.getLineDash().join(" "),
      }),
    fill: (own) => add("path", { d: own?.d ?? path, fill: context.fillStyle }),
    fillRect: (x, y, width, height) => add("rect", { x, y, width, height, fill: context.fillStyle }),
    fillText: (text, x, y) =>
      add(
        "text",
        {
          x,
          y,
          fill: context.fillStyle,
          style: `font: ${context.font}`,
          "text-anchor": ANCHORS[context.textAlign],
          "dominant-baseline": BASELINES[context.textBaseline],
        },
        escaped(String(text)),
      ),
    drawImage: (image, ...place) => {
      const [x, y, width, height] = place.slice(-4);
      if (place.length >= 4)
        add("image", { x, y, width, height, preserveAspectRatio: "none", href: image.toDataURL() });
    },
    ...Object.fromEntries(
      Object.entries(STEPS).map(([name, step]) => [
        name,
        (/** @type {number[]} */ ...c) => {
          path += step(...c);
        },
      ]),
    ),
  };
  for (const [name, hear] of Object.entries(heard))
    context[name] = (/** @type {any[]} */ ...given) => {
      hear(...given);
      return Object.getPrototypeOf(context)[name].apply(context, given);
    };
  globalThis.Path2D = Traced;
  try {
    await draw();
  } finally {
    globalThis.Path2D = Plain;
    for (const name of Object.keys(heard)) delete context[name];
  }
  return parts;
}

/**
 * @param {string[]} parts
 * @param {number} width
 * @param {number} height canvas pixels
 * @param {number} ratio of them to the page's
 * @param {number} [paper] mm, the width on paper
 */
export function documentOf(parts, width, height, ratio, paper) {
  const [wide, high] = paper
    ? [`${number(paper)}mm`, `${number((paper * height) / width)}mm`]
    : [number(width / ratio), number(height / ratio)];
  return (
    `<svg xmlns="http://www.w3.org/2000/svg" width="${wide}" height="${high}" ` +
    `viewBox="0 0 ${number(width)} ${number(height)}">\n${parts.join("\n")}\n</svg>\n`
  );
}
