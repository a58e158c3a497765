// Pages without a browser: reads one request a line (JSON) and answers each with a line.
// A request is { id, on, call, args }; an answer { id, value } or { id, error }; other lines are { event, page, … }.

import { createInterface } from "node:readline";
import { CookieJar } from "jsdom";
import { Page } from "./page.js";

const contexts = new Map(), pages = new Map();
const say = (line) => process.stdout.write(`${JSON.stringify(line)}\n`);
let made = 0;

const calls = {
  newContext() {
    contexts.set(++made, { jar: new CookieJar(), storage: {} });
    return made;
  },
  newPage(context) {
    const id = ++made;
    pages.set(id, new Page(contexts.get(context), (event, fields) => say({ event, page: id, ...fields })));
    return id;
  },
  async addCookies(context, cookies) {
    for (const { name, value, url } of cookies) await contexts.get(context).jar.setCookie(`${name}=${value}; Path=/`, url);
  },
  clearCookies(context) { return contexts.get(context).jar.removeAllCookies(); },
  async closePage(page) {
    await pages.get(page).close();
    pages.delete(page);
  },
  closeContext(context) { contexts.delete(context); },
};

// A rejection that nobody handles is told to the page whose script made it; to all where that is not known.
// A page that has been closed or left tells nothing: its scripts end with errors then.
process.on("unhandledRejection", (error) => {
  for (const page of pages.values()) if (!error?.madeIn || error.madeIn === page.window) page.tell("pageerror", { text: String(error?.message ?? error), stack: error?.stack ?? "" });
});

createInterface({ input: process.stdin }).on("line", async (line) => {
  const { id, on, call, args } = JSON.parse(line);
  try {
    const page = pages.get(on);
    await page?.going; // to where a click, a form or a script leads
    const value = await (page ?? calls)[call](...args);
    say({ id, value: value ?? null });
  } catch (error) {
    say({ id, error: `${error?.stack ?? error}${error?.cause ? `\nbecause of ${error.cause.stack}` : ""}` });
  }
}).on("close", () => process.exit(0));
