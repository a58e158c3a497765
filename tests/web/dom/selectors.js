// Playwright's selectors, as far as the tests of the page use them; any other is refused.

const EXTENDED = /:(has-text|text-is)\((?:'([^']*)'|"([^"]*)")\)|:(visible)(?![\w-])/g;
const SKIPPED = new Set(["HEAD", "SCRIPT", "STYLE", "NOSCRIPT", "TEMPLATE"]);

export const normal = (text) => text.replace(/[\u200b\u00ad]/g, "").trim().replace(/\s+/g, " ");

// What Playwright compares: the text of an element, or the label of an input that is a button.
export const textOf = (element) => (element.tagName === "INPUT" && ["button", "submit", "reset"].includes(element.type) ? element.value : element.textContent);

// Elements whose own text matches, not only as that of a part of them.
const smallest = (elements, matches) => elements.filter((one) => !SKIPPED.has(one.tagName) && matches(normal(textOf(one))) && ![...one.children].some((part) => !SKIPPED.has(part.tagName) && matches(normal(textOf(part)))));

// All elements of a document, in its order, that a selector finds. `isVisible` judges one of them.
export function select(document, selector, isVisible) {
  let found = [document];
  for (const part of parts(selector)) {
    const nth = /^nth=(-?\d+)$/.exec(part), text = /^text=(.*)$/.exec(part), visible = /^visible=(true|false)$/.exec(part);
    if (nth) found = [found.at(Number(nth[1]))].filter(Boolean);
    else if (visible) found = found.filter((one) => isVisible(one) === (visible[1] === "true"));
    else if (text) found = inOrder(found.flatMap((root) => byText(root, text[1])));
    else if (/^[\w-]+=/.test(part)) throw new Error(`the DOM page has no selector engine for ${part}`);
    else found = inOrder(found.flatMap((root) => byCss(root, part, isVisible)));
  }
  return found;
}

// The text's parts between " >> " outside of quotes and brackets.
function parts(selector) {
  const found = [""];
  let quote = "", depth = 0;
  for (let i = 0; i < selector.length; i++) {
    const at = selector[i];
    if (quote) { if (at === quote) quote = ""; }
    else if (at === "'" || at === '"') quote = at;
    else if ("([".includes(at)) depth++;
    else if (")]".includes(at)) depth--;
    if (!quote && !depth && selector.startsWith(">>", i)) { found.push(""); i++; }
    else found[found.length - 1] += at;
  }
  return found.map((part) => part.trim());
}

function byText(root, wanted) {
  const exact = /^(["'])(.*)\1$/.exec(wanted), low = normal(wanted).toLowerCase();
  const matches = exact ? (text) => text === normal(exact[2]) : (text) => text.toLowerCase().includes(low);
  return smallest([...(root.nodeType === 1 ? [root] : []), ...root.querySelectorAll("*")], matches);
}

function byCss(root, css, isVisible) {
  if (/:(text|text-matches|nth-match|left-of|right-of|above|below|near)\(/.test(css)) throw new Error(`the DOM page does not know a part of ${css}`);
  let found = [root], from = 0;
  for (const match of css.matchAll(EXTENDED)) {
    found = narrow(found, css.slice(from, match.index), from > 0);
    from = match.index + match[0].length;
    const wanted = match[2] ?? match[3];
    if (match[4]) found = found.filter(isVisible);
    else if (match[1] === "text-is") found = smallest(found, (text) => text === normal(wanted));
    else found = found.filter((one) => normal(textOf(one)).toLowerCase().includes(normal(wanted).toLowerCase()));
  }
  if (from > 0 && /,(?![^([]*[)\]])/.test(css)) throw new Error(`the DOM page takes no list of selectors with ${css}`);
  return from === css.length ? found : narrow(found, css.slice(from), from > 0);
}

// What `css` finds in the elements; where it goes on a selector, what it finds beside or below each of them.
function narrow(elements, css, continues) {
  if (!continues) return elements.flatMap((one) => [...one.querySelectorAll(css.trim() ? (/[\s>+~(]$/.test(css) ? `${css}*` : css) : "*")]);
  const own = /^(?:[^\s>+~[(]|\[[^\]]*\]|\([^)]*\))*/.exec(css)[0], rest = css.slice(own.length);
  const kept = own ? elements.filter((one) => one.matches(`*${own}`)) : elements;
  if (!rest.trim()) return kept;
  if (/^\s*[+~]/.test(rest)) throw new Error(`the DOM page does not look beside an element, as in ${css}`);
  const below = /[\s>+~]$/.test(rest) ? `${rest}*` : rest;
  return inOrder(kept.flatMap((one) => [...one.querySelectorAll(`:scope ${below}`)]));
}

const inOrder = (elements) => [...new Set(elements)].sort((a, b) => (a.compareDocumentPosition(b) & 4 ? -1 : 1));
