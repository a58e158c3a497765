// The link between vehicle and board in words: what a board does not tell is left out.

import assert from "node:assert/strict";
import { test } from "node:test";

import { boardLink } from "../../web/static/link/board_link.js";

const NOTHING = { board_command_rate: 0, board_round_trip: 0, board_acknowledged: 0, board_retries: 0, board_waiting: 0 };

test("what a board tells of its link is told, and nothing else", () => {
  assert.equal(boardLink(NOTHING), "not reported by the board");
  assert.equal(boardLink({ ...NOTHING, board_command_rate: 249.6, board_round_trip: 0.00034 }), "250 commands a second · round trip 340 µs");
  const onGround = { ...NOTHING, armed: false, nominal_rate: 250, board_command_rate: 49.2, board_round_trip: 0.0008 };
  assert.equal(boardLink(onGround), "49 commands a second, motors off · round trip 800 µs, a sample every 4.0 ms");
  assert.equal(boardLink({ ...onGround, armed: true, board_command_rate: 247.6 }), "248 of 250 commands a second · round trip 800 µs, a sample every 4.0 ms");
  assert.equal(
    boardLink({ ...NOTHING, board_command_rate: 100, board_acknowledged: 0.973, board_retries: 0.25, board_waiting: 2 }),
    "100 commands a second · 97.3 % acknowledged after 0.25 retries, 2 packets waiting");
});
