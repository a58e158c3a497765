// One page: what a test asks of it, with waiting where Playwright waits.

import vm from "node:vm";
import { normal, select, textOf } from "./selectors.js";
import { isVisible, seen } from "./style.js";
import { load } from "./window.js";

const PAUSES = { first: 5, last: 50 }; // ms between two looks, which grow longer
const TYPED = "input:not([type=checkbox], [type=radio], [type=range], [type=file], [type=button], [type=submit]), textarea";
const CODES = { " ": "Space", Escape: "Escape", Enter: "Enter", Shift: "ShiftLeft" };

export class Page {
  dom;

  constructor(context, tell) {
    this.context = context;
    this.tell = (kind, fields) => { if (kind === "navigate") this.go(fields.url); else tell(kind, fields); };
    this.held = new Set(); // keys
    this.begun = new WeakMap(); // the values of fields when the focus came to them
  }

  async goto(address, form) {
    await this.leave();
    const { dom, status } = await load(this.context, address, form, this.tell);
    this.dom = dom;
    const { window } = dom;
    window.addEventListener("focusin", ({ target }) => { if (target.matches(TYPED)) this.begun.set(target, target.value); });
    // jsdom goes nowhere: links and forms that the page leaves to the browser are followed here.
    window.addEventListener("click", (event) => this.follow(event));
    window.addEventListener("submit", (event) => this.submit(event));
    return status;
  }

  get window() { return this.dom?.window; }
  reload() { return this.goto(this.window.location.href); }
  url() { return this.window?.location.href ?? "about:blank"; }

  async leave() {
    const { window } = this;
    if (!window) return;
    this.context.storage = { ...window.localStorage };
    this.dom = undefined;
    await new Promise((done) => { setImmediate(done); }); // what its scripts have begun ends first
    window.close();
  }

  close() { return this.leave(); }

  follow(event) {
    const link = event.target.closest?.("a[href]");
    if (!link || event.defaultPrevented || link.getAttribute("href").startsWith("#")) return;
    event.preventDefault();
    if (link.target || link.hasAttribute("download")) this.tell("pageerror", { text: `the DOM page opens no other window or download: ${link.outerHTML}`, stack: "" });
    else this.go(link.href);
  }

  submit(event) {
    if (event.defaultPrevented) return;
    event.preventDefault();
    const { target: form, submitter } = event, fields = new URLSearchParams([...new this.window.FormData(form, submitter)]);
    if (form.method === "post") this.go(form.action, fields);
    else this.go(`${form.action.split("?")[0]}?${fields}`);
  }

  go(address, form) {
    const failed = (error) => this.tell("pageerror", { text: `${error.message}: ${error.cause?.message ?? ""}`, stack: error.stack });
    this.going = Promise.resolve().then(() => this.goto(address, form)).catch(failed); // after what goes there has ended
  }

  // ---------------------------------------------------------------- looking
  // A selector is a text, or { only: text } where it may find only one element.
  all(selector) {
    return this.window ? select(this.window.document, selector.only ?? selector, isVisible) : [];
  }

  // The first element of a selector, or undefined while there is none.
  one(selector) {
    const found = this.all(selector);
    if (selector.only && found.length > 1) throw new Error(`${selector.only} is not one element but ${found.length}`);
    return found[0];
  }

  // Look until `look` returns something else than undefined; the error after `bound` ms has `told`.
  async until(look, bound, told) {
    const end = performance.now() + bound;
    for (let pause = PAUSES.first; ; pause = Math.min(1.5 * pause, PAUSES.last)) {
      const found = look();
      if (found !== undefined) return found;
      if (performance.now() > end) throw new Error(`waited ${bound} ms in vain: ${told()}`);
      await new Promise((done) => { setTimeout(done, pause); });
    }
  }

  first(selector, bound) { return this.until(() => this.one(selector), bound, () => `there is no ${nameOf(selector)}`); }

  waitFor(selector, state, bound) {
    const holds = { visible: (one) => one && seen(one), hidden: (one) => !one || seen(one) === false, attached: Boolean, detached: (one) => !one }[state];
    if (!holds) throw new Error(`the DOM page does not wait for the state ${state}`);
    return this.until(() => holds(this.all(selector)[0]) || undefined, bound, () => `${nameOf(selector)} is not ${state}`);
  }

  count(selector) { return this.all(selector).length; }

  visible(selector) { const one = this.one(selector); return Boolean(one) && isVisible(one); }

  // Wait until a property of the only element is as a test expects: { text | class | value | count | enabled, isNot }.
  expect(selector, kind, wanted, { isNot = false, flags = "" } = {}, bound) {
    let last;
    const look = () => {
      if (kind === "count") { last = this.count(selector); return last === wanted || undefined; }
      const one = this.one(selector);
      if (!one) { last = undefined; return undefined; }
      if (kind === "enabled") { last = isEnabled(one); return last === wanted || undefined; }
      last = { text: textOf, class: (it) => it.getAttribute("class") ?? "", value: (it) => it.value }[kind](one);
      const matches = typeof wanted === "string" ? last === wanted : new RegExp(wanted.pattern, flags).test(last);
      return matches !== isNot || undefined;
    };
    return this.until(look, bound, () => `${kind} of ${nameOf(selector)} is ${JSON.stringify(last)}, wanted ${isNot ? "not " : ""}${JSON.stringify(wanted)}`);
  }

  async read(selector, kind, name, bound) {
    const one = await this.first(selector, bound);
    return {
      attribute: () => one.getAttribute(name), value: () => one.value, text: () => one.textContent, enabled: () => isEnabled(one), checked: () => one.checked,
      inner: () => shownText(one),
    }[kind]();
  }

  // ---------------------------------------------------------------- scripts
  evaluate(script, argument) { return this.run(script, argument ?? undefined); }

  // The value of an expression, or what it returns if it is a function.
  async run(script, ...given) {
    const found = vm.runInContext(`(${script}\n)`, this.dom.getInternalVMContext());
    return typeof found === "function" ? found(...given) : found;
  }

  async evaluateOn(selector, script, argument) {
    const one = this.one(selector);
    if (!one) throw new Error(`there is no ${nameOf(selector)}`);
    return this.run(script, one, argument ?? undefined);
  }

  // ---------------------------------------------------------------- acting
  async ready(selector, bound, needsEnabled = true) {
    let why = "";
    return this.until(() => {
      const one = this.one(selector);
      why = !one ? "there is none" : !seen(one) ? "it is not visible" : needsEnabled && !isEnabled(one) ? "it is disabled" : "";
      return why ? undefined : one;
    }, bound, () => `${nameOf(selector)}: ${why}`);
  }

  async click(selector, bound, times = 1) {
    const one = await this.ready(selector, bound);
    for (let i = 1; i <= times; i++) {
      this.pointer(one, "pointerdown", "mousedown");
      this.focus(one);
      this.pointer(one, "pointerup", "mouseup");
      one.click();
    }
    if (times === 2) one.dispatchEvent(new this.window.MouseEvent("dblclick", { bubbles: true, cancelable: true }));
  }

  // The pointer rests on an element from then on, and is pressed there.
  async hover(selector, bound) { this.under = await this.ready(selector, bound); }

  mouse(isDown) {
    if (!this.under?.isConnected) throw new Error("the DOM page's pointer is on no element: hover first");
    this.pointer(this.under, ...(isDown ? ["pointerdown", "mousedown"] : ["pointerup", "mouseup"]));
    if (isDown) this.focus(this.under);
    else this.under.click();
  }

  pointer(one, ...types) {
    const { PointerEvent, MouseEvent } = this.window, how = { bubbles: true, cancelable: true, composed: true, button: 0, view: this.window };
    for (const type of types) one.dispatchEvent(type.startsWith("pointer") ? new PointerEvent(type, { ...how, pointerType: "mouse", isPrimary: true }) : new MouseEvent(type, how));
  }

  // The focus goes to an element or what holds it; a field that it leaves tells its change.
  focus(one) {
    const { document } = this.window, before = document.activeElement;
    const next = one.closest("input, select, textarea, button, a[href], summary, [tabindex], iframe");
    if (next === before) return;
    this.settle(before);
    if (next) next.focus();
    else before.blur?.();
  }

  settle(field) {
    if (!field || !this.begun.has(field) || this.begun.get(field) === field.value) return;
    this.begun.set(field, field.value);
    field.dispatchEvent(new this.window.Event("change", { bubbles: true }));
  }

  async fill(selector, text, bound) {
    const one = await this.ready(selector, bound);
    if (!one.matches(TYPED) || one.readOnly) throw new Error(`${nameOf(selector)} cannot be filled`);
    this.focus(one);
    one.value = text;
    if (one.value !== text) throw new Error(`${nameOf(selector)} does not take ${text}`);
    one.dispatchEvent(new this.window.InputEvent("input", { bubbles: true, data: text }));
  }

  async choose(selector, wanted, bound) {
    const one = await this.ready(selector, bound);
    const option = await this.until(() => [...one.options].find(({ value, label }) => value === wanted || normal(label) === wanted), bound, () => `${nameOf(selector)} has no option ${wanted}`);
    option.selected = true;
    for (const type of ["input", "change"]) one.dispatchEvent(new this.window.Event(type, { bubbles: true }));
  }

  async check(selector, wanted, bound) {
    const one = await this.ready(selector, bound);
    if (one.checked !== wanted) await this.click(selector, bound);
    if (one.checked !== wanted) throw new Error(`${nameOf(selector)} did not become ${wanted ? "checked" : "unchecked"}`);
  }

  async setFile(selector, name, text, bound) {
    const one = await this.first(selector, bound), { File, Event } = this.window;
    const file = new File([text], name);
    file.text ??= async () => text;
    Object.defineProperty(one, "files", { configurable: true, value: Object.assign([file], { item: (i) => [file][i] }) });
    for (const type of ["input", "change"]) one.dispatchEvent(new Event(type, { bubbles: true }));
  }

  async focusOn(selector, bound) { this.focus(await this.first(selector, bound)); }

  keyDown(key) { return this.key("keydown", key); }
  keyUp(key) { return this.key("keyup", key); }

  // A key's events, with the browser's own action for Enter and letters in a field; other keys have none on this page.
  press(key) {
    const { document, InputEvent } = this.window, one = document.activeElement ?? document.body, isField = one.matches(TYPED);
    if (["Tab", "Backspace", "Delete", "Home", "End"].includes(key) || /^(Arrow|Page)/.test(key)) throw new Error(`the DOM page does not do what ${key} does in a browser`);
    const goesOn = this.key("keydown", key);
    if (goesOn && isField && key.length === 1) {
      one.value += key;
      one.dispatchEvent(new InputEvent("input", { bubbles: true, data: key }));
    } else if (goesOn && key === "Enter" && isField && one.tagName === "INPUT") {
      this.settle(one);
      one.form?.requestSubmit(one.form.querySelector("button:not([type=button]), input[type=submit]") ?? undefined);
    } else if (goesOn && ["Enter", " "].includes(key) && one.matches("button, a[href], summary")) one.click();
    else if (goesOn && key === "Enter" && isField) throw new Error("the DOM page breaks no line");
    this.key("keyup", key);
  }

  key(type, key) {
    const code = CODES[key] ?? (/^[a-z]$/i.test(key) ? `Key${key.toUpperCase()}` : /^\d$/.test(key) ? `Digit${key}` : "");
    const target = this.window.document.activeElement ?? this.window.document.body, repeat = type === "keydown" && this.held.has(key);
    if (type === "keydown") this.held.add(key);
    else this.held.delete(key);
    return target.dispatchEvent(new this.window.KeyboardEvent(type, { key, code, repeat, shiftKey: this.held.has("Shift"), bubbles: true, cancelable: true, composed: true }));
  }
}

const nameOf = (selector) => selector.only ?? selector;
const isEnabled = (one) => !one.matches(":disabled") && !one.closest("fieldset:disabled");

// The text that is seen, where no style sheet changes it: of an element of words alone.
function shownText(one) {
  if (one.children.length) throw new Error(`the DOM page does not lay out ${one.outerHTML.slice(0, 80)}: ask for its text_content`);
  return normal(one.textContent);
}
