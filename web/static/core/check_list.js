// Checks as a list: a sign and a word beside each colour, what was found, and what to do.

import { element } from "./dom.js";

const WORDS = { ok: ["✓", "ok"], warn: ["!", "look"], fail: ["✗", "mend"], unknown: ["?", "not known"] };

export const badge = (state) => {
  const [sign, word] = WORDS[state] ?? WORDS.unknown;
  return element("span", { className: `badge ${state in WORDS ? state : "unknown"}` }, element("i", { ariaHidden: "true" }, sign), word);
};

export const checkList = (checks) => element("ul", { className: "checks" }, ...checks.map(({ name, state, found, wanted, advice }) =>
  element("li", { className: state }, badge(state), element("b", {}, name),
    element("span", { className: "found" }, found, ...(wanted && wanted !== found ? [element("small", {}, ` wanted: ${wanted}`)] : [])),
    ...(state !== "ok" && advice ? [element("span", { className: "advice" }, advice)] : []))));

// "20 ok, 1 to look at, 2 to mend"
export function count(checks) {
  const of = (state) => checks.filter((one) => one.state === state).length;
  return [[of("fail"), "to mend"], [of("warn"), "to look at"], [of("unknown"), "not known"], [of("ok"), "ok"]]
    .filter(([number]) => number).map(([number, text]) => `${number} ${text}`).join(", ");
}
