// Elements of the page: found, made, and set without work for the browser where nothing changed.

import { here } from "./vehicle_path.js";

/** @type {(id: string) => any} */
export const $ = (id) => document.getElementById(id);

// Even an equal value makes the browser style and draw a frame.
/** @type {(place: any, name: string, value: unknown) => void} */
export function setIfChanged(place, name, value) { if (place[name] !== value) place[name] = value; }

/** @type {(place: any, text: unknown) => void} */
export const setText = (place, text) => setIfChanged(place, "textContent", text);
/** @type {(place: any, isHidden: boolean) => void} */
export const hide = (place, isHidden) => setIfChanged(place, "hidden", isHidden);

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
