// Checks as a list: a sign and a word beside each colour, what was found, and what to do.

import { element } from "./dom.js";

const WORDS = { ok: ["✓", "OK"], warn: ["!", "Warning"], fail: ["✗", "Fix"], unknown: ["?", "Unknown"] };

export const badge = (state) => {
  const [sign, word] = WORDS[state] ?? WORDS.unknown;
  return element(
    "span",
    { className: `badge ${state in WORDS ? state : "unknown"}` },
    element("i", { ariaHidden: "true" }, sign),
    word,
  );
};

export const checkList = (checks) =>
  element(
    "ul",
    { className: "checks" },
    ...checks.map(({ name, state, found, wanted, advice }) =>
      element(
        "li",
        { className: state },
        badge(state),
        element("b", {}, name),
        element(
          "span",
          { className: "found" },
          found,
          ...(wanted && wanted !== found ? [element("small", {}, ` expected: ${wanted}`)] : []),
        ),
        ...(state !== "ok" && advice ? [element("span", { className: "advice" }, advice)] : []),
      ),
    ),
  );

// "2 to fix, 1 warning, 20 OK"
export function count(checks) {
  const of = (state) => checks.filter((one) => one.state === state).length;
  return [
    [of("fail"), "to fix"],
    [of("warn"), of("warn") === 1 ? "warning" : "warnings"],
    [of("unknown"), "unknown"],
    [of("ok"), "OK"],
  ]
    .filter(([number]) => number)
    .map(([number, text]) => `${number} ${text}`)
    .join(", ");
}
