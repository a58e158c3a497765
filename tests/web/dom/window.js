// A window of jsdom with the page in it, served by a real server: cookies, requests, storage, scripts.

import vm from "node:vm";
import { JSDOM, VirtualConsole } from "jsdom";
import Location from "jsdom/lib/jsdom/living/window/Location-impl.js";
import { computed, hiding, holds } from "./style.js";

const kept = new Map(); // texts by an address that has a version: no page fetches one again
const compiled = new Map();
const sheets = new Map();

// jsdom goes to no other document; the page does, where a script asks for one.
const { prototype } = Location.implementation, within = prototype._locationObjectNavigate, { get: hrefOf } = Object.getOwnPropertyDescriptor(prototype, "href");
prototype._locationObjectNavigate = function navigate(url, how) {
  const { _defaultView: window } = this._relevantDocument, next = hrefOf.call({ _url: url });
  if (next.split("#")[0] === this.href.split("#")[0]) within.call(this, url, how);
  else if (window.parent === window) window.navigated(next); // a frame stays empty
};

// Open an address as a browser does: redirections followed, scripts run after the document is read.
// `tell(kind, fields)` hears of requests, answers and errors.
export async function load(context, address, form, tell) {
  let url = address, answer, body = form;
  for (let hops = 0; ; hops++) {
    if (hops > 10) throw new Error(`too many redirections from ${address}`);
    answer = await request(url, { redirect: "manual", method: body ? "POST" : "GET", body, headers: { accept: "text/html", ...await headersFor(context, url, body ? "POST" : "GET") } });
    await keepCookies(context, url, answer);
    let next = answer.status >= 300 && answer.status < 400 ? answer.headers.get("location") : null;
    const text = next ? "" : await answer.text();
    const token = /<form id="by_link".*name="token" value="([^"]*)"/.exec(text)?.[1]; // its page posts it
    if (token) { [url, body] = [new URL("/login", url).href, new URLSearchParams({ token })]; continue; }
    next ??= /<meta http-equiv="refresh" content="0;url=([^"]*)"/.exec(text)?.[1];
    if (!next) return { dom: await build(context, url, text, tell), status: answer.status };
    url = new URL(next, url).href;
    body = undefined;
  }
}

// The server closes a connection that rests for 5 s; a browser then asks again for what it only reads.
async function request(url, how) {
  try {
    return await fetch(url, how);
  } catch (error) {
    if ((how.method ?? "GET") !== "GET" || !["ECONNRESET", "UND_ERR_SOCKET"].includes(error.cause?.code)) throw error;
    return fetch(url, how);
  }
}

async function headersFor(context, url, method) {
  const origin = method === "GET" || method === "HEAD" ? {} : { origin: new URL(url).origin };
  return { cookie: await context.jar.getCookieString(url), ...origin };
}

async function keepCookies(context, url, answer) {
  for (const cookie of answer.headers.getSetCookie()) await context.jar.setCookie(cookie, url);
}

async function build(context, url, text, tell) {
  const noise = new VirtualConsole();
  noise.on("jsdomError", (error) => tell("pageerror", { text: error.message, stack: error.cause?.stack ?? error.stack ?? "" }));
  const dom = new JSDOM(text, { url, cookieJar: context.jar, runScripts: "outside-only", pretendToBeVisual: true, virtualConsole: noise });
  const { window } = dom;
  window.navigated = (next) => tell("navigate", { url: next });
  window.Error.prototype.madeIn = window; // so that a rejection leads to its page
  window.unhandled = (error) => tell("pageerror", { text: String(error?.message ?? error), stack: error?.stack ?? "" });
  for (const [name, value] of Object.entries(context.storage)) window.localStorage.setItem(name, value);
  await addMissing(window, context, tell);
  await addSheets(window, context);
  for (const script of window.document.querySelectorAll("script[src]")) await run(dom, script, context);
  window.document.dispatchEvent(new window.Event("DOMContentLoaded"));
  return dom;
}

export async function textAt(context, url) {
  if (!kept.has(url)) {
    const answer = await request(url, { headers: await headersFor(context, url, "GET") });
    if (!answer.ok) throw new Error(`${url}: ${answer.status}`);
    const text = await answer.text();
    if (!/\/v-[0-9a-f]{16}\/|[?]v=/.test(url)) return text;
    kept.set(url, text);
  }
  return kept.get(url);
}

async function addSheets(window, context) {
  const { document } = window;
  for (const link of document.querySelectorAll("link[rel=stylesheet]")) {
    const text = await textAt(context, link.href);
    if (!sheets.has(text)) sheets.set(text, hiding(text));
    const style = document.createElement("style");
    style.textContent = sheets.get(text);
    link.replaceWith(style);
  }
}

// The joined script is one text: as a function, it is compiled once and run in each window.
async function run(dom, script, context) {
  const text = await textAt(context, script.src);
  const source = script.type === "module" ? `(async () => { "use strict"; ${text}\n})().catch(unhandled);` : text;
  if (!compiled.has(source)) compiled.set(source, new vm.Script(source, { filename: script.src }));
  compiled.get(source).runInContext(dom.getInternalVMContext());
}

// What jsdom has not: requests, and the parts of a browser that need none of its drawing.
async function addMissing(window, context, tell) {
  window.fetch = async (path, how = {}) => {
    const url = new URL(path, window.location.href).href, method = (how.method ?? "GET").toUpperCase();
    tell("request", { url, method });
    const headers = { ...how.headers, ...await headersFor(context, url, method) };
    const answer = await request(url, { ...how, method, headers, body: await bodyOf(window, how.body), signal: signalOf(how.signal) });
    await keepCookies(context, url, answer);
    tell("response", { url, method, status: answer.status });
    return answer;
  };
  window.matchMedia = (media) => Object.assign(new window.EventTarget(), { media, matches: holds(media) });
  // Charts need some room for their axes; nothing has a real size here, and so none ever changes.
  for (const [name, value] of [["clientWidth", 600], ["clientHeight", 200]]) Object.defineProperty(window.Element.prototype, name, { configurable: true, get: () => value });
  window.ResizeObserver = class { observe() {} unobserve() {} disconnect() {} };
  window.Worker = class extends window.EventTarget {
    constructor(path) {
      super();
      const postMessage = (data) => { const event = new window.MessageEvent("message", { data }); this.dispatchEvent(event); this.onmessage?.(event); };
      const start = (text) => vm.runInNewContext(text, { postMessage, setInterval: (act, period) => window.setInterval(act, period) });
      textAt(context, new URL(path, window.location.href).href).then(start, () => this.dispatchEvent(new window.Event("error")));
    }
  };
  // jsdom's own ends node where a task of a closed window fails.
  window.queueMicrotask = (act) => queueMicrotask(() => { try { if (!window.closed) act(); } catch (error) { window.unhandled(error); } });
  window.structuredClone ??= structuredClone;
  // The page asks for colours and sizes only to draw with them, and nothing is drawn.
  computed.set(window, window.getComputedStyle.bind(window));
  window.getComputedStyle = () => ({ color: "", getPropertyValue: () => "0" });
  window.CSS = { escape: (text) => text.replace(/[^\w-]|^\d/gu, (at) => `\\${at.codePointAt(0).toString(16)} `) };
  for (const name of ["TextDecoder", "TextEncoder"]) window[name] ??= globalThis[name];
  window.Element.prototype.scrollIntoView = () => {}; // nothing has a place
  const dialog = window.HTMLDialogElement.prototype;
  dialog.show = function show() { this.open = true; this.querySelector("[autofocus]")?.focus(); };
  dialog.close = function close() { if (this.open) { this.open = false; window.setTimeout(() => this.dispatchEvent(new window.Event("close"))); } };
  // jsdom takes no such selector; no popover is ever open here, because none can be opened.
  const { matches } = window.Element.prototype;
  window.Element.prototype.matches = function judged(selector) { return selector === ":popover-open" ? false : matches.call(this, selector); };
  window.Path2D = class {};
  for (const name of ["moveTo", "lineTo", "arc", "rect", "closePath", "bezierCurveTo", "addPath"]) window.Path2D.prototype[name] = () => undefined;
  window.HTMLCanvasElement.prototype.getContext = function pen(kind) { return kind === "2d" ? blind(this) : null; };
}

async function bodyOf(window, body) {
  if (!(body instanceof window.Blob)) return body;
  return new Promise((done) => { const reader = new window.FileReader(); reader.onload = () => done(reader.result); reader.readAsArrayBuffer(body); });
}

function signalOf(signal) {
  if (!signal) return undefined;
  const ours = new AbortController();
  if (signal.aborted) ours.abort();
  signal.addEventListener("abort", () => ours.abort());
  return ours.signal;
}

// A pen that draws nothing, as no test here looks at a picture; a read of one fails.
function blind(canvas) {
  const set = {};
  return new Proxy(set, {
    get: (_, name) => {
      if (name === "canvas") return canvas;
      if (name in set || typeof name === "symbol") return set[name];
      if (/^(get|create|is|measure)/.test(name)) return name === "measureText" ? (text) => ({ width: 7 * text.length }) : () => { throw new Error(`the DOM page draws nothing: ${name} has no answer`); };
      return () => undefined;
    },
  });
}
