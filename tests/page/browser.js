// What modules take for granted of a browser when they are loaded: import this before them.

import { webcrypto } from "node:crypto";
import { register } from "node:module";

// An extension's module names others by their addresses, as "/static/core/dom.js" and "/static/extensions/NAME/x.js".
const resolve = (name, context, next) =>
  next(name.replace(/^\/static\/extensions\/(\w+)\//, `${ROOT}extensions/$1/page/`).replace(/^\/static\//, `${ROOT}web/static/`), context);
const root = new URL("../../", import.meta.url);
register(`data:text/javascript,${encodeURIComponent(`const ROOT = "${root}"; export const resolve = ${resolve};`)}`);

const kept = new Map();
const given = {
  document: Object.assign(new EventTarget(), { hidden: false }),
  window: globalThis,
  matchMedia: () => new EventTarget(),
  location: { protocol: "http:", host: "station:8080", pathname: "/", hash: "", search: "" },
  localStorage: {
    getItem: (key) => kept.get(key) ?? null,
    setItem: (key, value) => kept.set(key, String(value)),
    removeItem: (key) => kept.delete(key),
    clear: () => kept.clear(),
  },
};
for (const [name, value] of Object.entries(given)) {
  Object.defineProperty(globalThis, name, { value, configurable: true, writable: true });
}
globalThis.crypto ??= webcrypto; // for node 18, these three
globalThis.CustomEvent ??= class extends Event {
  constructor(type, { detail } = {}) { super(type); this.detail = detail; }
};
globalThis.MessageEvent ??= class extends Event {
  constructor(type, { data } = {}) { super(type); this.data = data; }
};
const listeners = new EventTarget();
globalThis.addEventListener ??= listeners.addEventListener.bind(listeners);
globalThis.removeEventListener ??= listeners.removeEventListener.bind(listeners);

// Wait until `is()` holds, one turn of the event loop after another; fails after `turns` of them.
export async function until(is, turns = 10_000) {
  for (let turn = 0; turn < turns; turn++) {
    const found = is();
    if (found) return found;
    await new Promise((done) => { setTimeout(done); });
  }
  throw new Error(`not so after ${turns} turns: ${is}`);
}
