// Which of many texts a person means by a few words.

const IDLE = new Set(
  "a an and are by do does for how i in is it my of on or the to what where with".split(" "),
);

// Those that have every word, the best of each kind first: at most `each` of a kind, in the order of the kinds.
/**
 * @template {{ kind: string, text: string, note?: string, words?: string }} T
 * @param {T[]} all @param {string} words @param {number} each
 * @returns {T[]}
 */
export function ranked(all, words, each) {
  const asked = words.toLowerCase().split(/\s+/),
    meant = asked.filter((word) => !IDLE.has(word)),
    wanted = meant.length ? meant : asked;
  /** @type {Map<string, [number, T][]>} */
  const kinds = new Map();
  for (const one of all) {
    const score = scoreOf(one, wanted);
    if (score === 0) continue;
    if (!kinds.has(one.kind)) kinds.set(one.kind, []);
    kinds.get(one.kind)?.push([score, one]);
  }
  return [...kinds.values()].flatMap((found) =>
    found
      .sort(([a, one], [b, other]) => b - a || one.text.length - other.text.length)
      .slice(0, each)
      .map(([, one]) => one),
  );
}

// 0 where a word is missing; a word that begins the text counts most, then one that begins a part of it.
/** @param {{ text: string, note?: string, words?: string }} one @param {string[]} wanted */
function scoreOf({ text, note = "", words = "" }, wanted) {
  const own = text.toLowerCase(),
    more = note.toLowerCase();
  let sum = 0;
  for (const word of wanted) {
    const at = own.indexOf(word);
    if (at === 0) sum += 4;
    else if (at > 0) sum += /[\s._:/-]/.test(own[at - 1]) ? 3 : 2;
    else if (more.includes(word) || words.includes(word)) sum += 1;
    else return 0;
  }
  return sum;
}
