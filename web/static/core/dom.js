// Elements of the page: found, made, and set without work for the browser where nothing changed.

import { here } from "./vehicle_path.js";

/** @type {(id: string) => any} */
export const $ = (id) => document.getElementById(id);

// Even an equal value makes the browser style and draw a frame.
/** @type {(place: any, name: string, value: unknown) => void} */
export function setIfChanged(place, name, value) {
  if (place[name] !== value) place[name] = value;
}

/** @type {(place: any, text: unknown) => void} */
export const setText = (place, text) => setIfChanged(place, "textContent", text);
/** @type {(place: any, isHidden: boolean) => void} */
export const hide = (place, isHidden) => setIfChanged(place, "hidden", isHidden);

// A text in a place that is hidden while there is none: a reason, a note.
/** @type {(place: any, text: string) => void} */
export function showNote(place, text) {
  setText(place, text);
  hide(place, !text);
}

// Does something that may fail, with the reason in `place`; whether it went well.
/** @type {(place: any, act: () => unknown) => Promise<boolean>} */
export async function attempt(place, act) {
  showNote(place, "");
  try {
    await act();
  } catch (error) {
    showNote(place, /** @type {Error} */ (error).message);
  }
  return place.hidden;
}

/**
 * A new element: attributes and properties by name, "onclick" and the like as listeners.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, any>} attributes
 * @param {...(Node | string)} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function element(tag, attributes = {}, ...children) {
  const made = /** @type {any} */ (document.createElement(tag));
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "href" || key === "src") made.setAttribute(key, here(value));
    else if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (key in made && key !== "list") made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

/** @type {(tag: string, attributes?: Record<string, any>, ...children: (Node | string)[]) => any} */
export function svg(tag, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes))
    made.setAttribute(name, typeof value === "number" ? String(Number(value.toFixed(1))) : value);
  made.append(...children);
  return made;
}

// What this browser keeps under a name, as JSON; null in a private window, and for a text of others.
/** @type {(key: string) => any} */
export function recall(key) {
  try {
    return JSON.parse(localStorage.getItem(key) ?? "null");
  } catch {
    return null;
  }
}
/** @type {(key: string, value: unknown) => void} */
export function remember(key, value) {
  try {
    localStorage.setItem(key, JSON.stringify(value));
  } catch {
    /* a private window forgets, and so does a full one */
  }
}

// The head of a table: a text for each column.
/** @type {(...columns: string[]) => HTMLElement} */
export const tableHead = (...columns) =>
  element("thead", {}, element("tr", {}, ...columns.map((text) => element("th", { scope: "col" }, text))));

// The options of a select, each a value or [value, text].
/** @type {(choices: Iterable<string | string[]>, chosen?: string) => HTMLOptionElement[]} */
export const optionsOf = (choices, chosen) =>
  [...choices].map((one) => {
    const [value, text = value] = [one].flat();
    return element("option", { value, selected: value === chosen }, text);
  });

// The window in a frame of our own; null while the browser shows an error of its own in it, as when the server is away.
/** @type {(frame: HTMLIFrameElement) => any} */
export const windowIn = (frame) => (frame.contentDocument ? frame.contentWindow : null);

// Whether a text is in the clipboard now: without https, browsers give none.
/** @param {string} text @returns {Promise<boolean>} */
export const copied = (text) =>
  (navigator.clipboard?.writeText(text) ?? Promise.reject(new Error("none"))).then(
    () => true,
    () => false,
  );
