// Signals derived by an expression. The server alone parses and computes them (web/signals/expression.py); this
// browser keeps their texts.

/** @typedef {{ name: string, label: string, unit: string, group: string, topic: string, problem?: string }} Signal */
/** @typedef {(texts: string[]) => Promise<Signal[]>} Ask what the server says of texts */

const KEY = "charts.derived",
  MOST = 24;

/** @param {string} name */
export const isDerived = (name) => name.includes("=");

/** @returns {string[]} */
function kept() {
  try {
    const names = JSON.parse(localStorage.getItem(KEY) ?? "[]");
    return Array.isArray(names) ? names.filter((name) => typeof name === "string" && isDerived(name)) : [];
  } catch {
    return [];
  }
}

/** @param {string[]} names */
const keep = (names) => localStorage.setItem(KEY, JSON.stringify(names));

// Those kept here that can be computed where it is asked; none where nothing answers.
/** @param {Ask} ask */
export async function derivedSignals(ask, more = /** @type {string[]} */ ([])) {
  const names = [...new Set([...kept(), ...more.filter(isDerived)])];
  if (!names.length) return [];
  return (await ask(names).catch(() => [])).filter(({ problem }) => !problem);
}

// A new one, kept from now on; throws the one line that says what is wrong with it.
/** @param {string} text @param {Ask} ask */
export async function derive(text, ask) {
  const [signal] = await ask([text]),
    names = kept();
  if (signal.problem) throw new Error(signal.problem);
  if (names.length >= MOST && !names.includes(signal.name))
    throw new Error(`${names.length} derived signals are kept; remove one first`);
  keep([...new Set([...names, signal.name])]);
  return signal;
}

/** @param {string} name */
export const forget = (name) => keep(kept().filter((other) => other !== name));
