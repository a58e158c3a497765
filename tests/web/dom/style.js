// Which elements the page's stylesheets hide, in a window of 1440 by 900 pixels with a mouse.

const WIDTH = 1440, HEIGHT = 900;
const KEPT = /^(display|visibility)\s*:/;

// The rules of a stylesheet that show or hide; nested rules and unknown conditions are refused.
export function hiding(css) {
  const text = css.replace(/\/\*[\s\S]*?\*\//g, "");
  return rulesOf(text).flatMap(([head, body]) => {
    if (/^@(keyframes|font-face|property)/.test(head)) return [];
    if (head.startsWith("@media")) return holds(head.slice(6).trim()) ? [hiding(body)] : [];
    if (head.startsWith("@")) throw new Error(`the DOM page does not know the rule ${head}`);
    if (body.includes("{")) throw new Error(`the DOM page knows no nested rules, as in ${head}`);
    if (/::[\w-]+/.test(head) && !head.includes(",")) return [];
    const kept = body.split(";").map((one) => one.trim()).filter((one) => KEPT.test(one));
    return kept.length ? [`${head} { ${kept.join("; ")} }`] : [];
  }).join("\n");
}

function rulesOf(text) {
  const found = [];
  let depth = 0, start = 0, open = 0;
  for (let i = 0; i < text.length; i++) {
    if (text[i] === "{") { if (!depth++) open = i; }
    else if (text[i] === "}" && !--depth) { found.push([text.slice(start, open).trim(), text.slice(open + 1, i)]); start = i + 1; }
  }
  return found;
}

// Whether a media query holds.
export function holds(query) {
  return query.split(",").some((one) => one.trim().split(/\s+and\s+/).every((part) => {
    const feature = /^\(\s*([\w-]+)\s*:\s*([\w.-]+)\s*\)$/.exec(part);
    if (!feature) throw new Error(`the DOM page does not know the media query ${query}`);
    const [, name, value] = feature, pixels = /^\d+(\.\d+)?px$/.test(value) ? parseFloat(value) : NaN;
    const known = {
      "min-width": WIDTH >= pixels, "max-width": WIDTH <= pixels, "min-height": HEIGHT >= pixels, "max-height": HEIGHT <= pixels,
      "prefers-color-scheme": value === "light", "prefers-reduced-motion": value === "no-preference", "pointer": value === "fine", "hover": value === "hover", "min-resolution": parseFloat(value) <= 1, "max-resolution": parseFloat(value) >= 1,
    };
    if (!(name in known)) throw new Error(`the DOM page does not know the media query ${query}`);
    return known[name];
  }));
}

const OF_THEIR_SIZE = "input, select, textarea, canvas, img, svg, svg *, iframe, progress, meter";

// The function that finds an element's style, by window: scripts of a page have none.
export const computed = new WeakMap();

// Whether a person could see an element; undefined if only a layout would tell, because it has nothing in it.
export function seen(element) {
  if (!element.isConnected) return false;
  const styleOf = computed.get(element.ownerDocument.defaultView);
  for (let one = element; one; one = one.parentElement) {
    const parent = one.parentElement;
    if (styleOf(one).display === "none") return false;
    if (parent?.tagName === "DETAILS" && !parent.open && one !== parent.querySelector(":scope > summary")) return false;
  }
  if (styleOf(element).visibility === "hidden") return false;
  const hasSize = element.matches(OF_THEIR_SIZE) || element.querySelector(OF_THEIR_SIZE) !== null || element.textContent.trim() !== "";
  return hasSize && !["OPTION", "OPTGROUP"].includes(element.tagName) ? true : undefined;
}

export function isVisible(element) {
  const found = seen(element);
  if (found === undefined) throw new Error(`the DOM page cannot judge whether ${element.outerHTML.slice(0, 80)} is visible, because it has no layout`);
  return found;
}
