// Names of estimates as people read them, and the colour each has in table and chart.

const COLORS = {
  vehicle: "var(--flown)",
  error_state: "var(--teal)",
  complementary: "var(--violet)",
  "complementary:resolved": "var(--violet)",
  "complementary:bearings": "var(--rose)",
  "complementary:paper": "var(--gold)",
};
const OTHER = "var(--dim)";

export const BOUND = "var(--text)";

export const colorOf = (name) => COLORS[name] ?? OTHER;

// An estimator and the gains it has: "complementary:paper" → ["complementary", "paper gains"].
export function partsOf(name) {
  const [estimator, gains] = name.split(":");
  return [estimator.replaceAll("_", "-"), gains ? `${gains} gains` : ""];
}

export const wordsOf = (name) => partsOf(name).filter(Boolean).join(", ");
