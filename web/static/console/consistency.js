// Whether the estimate in use and its measurements agree.

import { fixed } from "../core/format.js";

const LARGEST = 3,
  MOST_REFUSED = 0.5; // as the error-state filter judges itself

// A word for the bar and what it rests on, of the status' flags and the summary's estimate.
export function consistencyOf(flags, estimate) {
  const { consistency = null, refused_share: refused = null } = estimate ?? {};
  const isOff = consistency >= LARGEST || refused > MOST_REFUSED;
  const word = flags.includes("rescued")
    ? "on the shadow"
    : isOff
      ? "inconsistent"
      : flags.includes("estimate_drifted")
        ? "drifted"
        : "consistent";
  if (consistency === null) return { word, tip: "whether the estimate and its measurements agree" };
  const noise = ["accelerometer", "gyroscope", "measurement"]
    .map((kind) => `${kind} × ${fixed(estimate[`${kind}_noise_scale`], 1)}`)
    .join(", ");
  return {
    word,
    tip:
      `innovations ${fixed(consistency, 1)} times their expected square, ` +
      `${fixed(100 * refused, 0)} % refused; noise adapted: ${noise}`,
  };
}
