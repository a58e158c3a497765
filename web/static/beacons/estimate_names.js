// Names of estimates as people read them, and the colour each has in table and chart.

const COLORS = {
  vehicle: "#ff922b",
  error_state: "#6fc3c6",
  complementary: "#b08fd8",
  "complementary:resolved": "#b08fd8",
  "complementary:bearings": "#d08fae",
  "complementary:paper": "#c9b06b",
};
const OTHER = "#9aa8b4";

export const BOUND = "#d5dbe1";
export const OFFERED = ["error_state", "complementary:resolved", "complementary:bearings", "complementary:paper"];

export const colorOf = (name) => COLORS[name] ?? OTHER;

// An estimator and the gains it has: "complementary:paper" → ["complementary", "paper gains"].
export function partsOf(name) {
  const [estimator, gains] = name.split(":");
  return [estimator.replaceAll("_", "-"), gains ? `${gains} gains` : ""];
}

export const wordsOf = (name) => partsOf(name).filter(Boolean).join(", ");
