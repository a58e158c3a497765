// The link between the vehicle's computer and its board, in words.

import { fixed } from "../core/format.js";

export const late = (value) =>
  value === null || value === undefined
    ? "–"
    : value < 1e-3
      ? `${fixed(1e6 * value, 0)} µs`
      : `${fixed(1e3 * value, 1)} ms`;

// What a board does not tell is 0: a line without acknowledgements, a board that answers no requests.
export function boardLink(status) {
  const {
    armed,
    nominal_rate: nominal,
    board_command_rate: rate,
    board_round_trip: trip,
    board_acknowledged: share,
    board_retries: retries,
    board_waiting: waiting,
  } = status;
  const parts = [
    ...(rate
      ? [
          [
            `${fixed(rate, 0)}${armed && nominal ? ` of ${fixed(nominal, 0)}` : ""} commands a second`,
            ...(armed === false ? ["motors off"] : []),
          ].join(", "),
        ]
      : []),
    ...(trip ? [`round trip ${late(trip)}${nominal ? `, a sample every ${late(1 / nominal)}` : ""}`] : []),
    ...(share
      ? [
          `${fixed(100 * share, 1)} % acknowledged after ${fixed(retries, 2)} retries, ${waiting} packets waiting`,
        ]
      : []),
  ];
  return parts.join(" · ") || "not reported by the board";
}
