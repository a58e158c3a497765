import assert from "node:assert/strict";
import { test } from "node:test";

import "../browser.js";

const { characterOf, onKey } = await import("../../../web/static/core/keys.js");

test("keys are understood on keyboards that write no Latin letters", () => {
  const cases = [
    ["e", "KeyE", false, "e"],
    ["E", "KeyE", true, "e"],
    ["у", "KeyE", false, "e"],
    ["Ч", "KeyX", true, "x"],
    ["ε", "KeyE", false, "e"],
    ["х", "BracketLeft", false, "["],
    ["é", "Digit2", false, "2"],
    ["؟", "Slash", true, "?"],
    ["ж", "Semicolon", false, "ж"],
    ["e", "KeyD", false, "e"],
    ["ArrowLeft", "ArrowLeft", false, "ArrowLeft"],
  ];
  for (const [key, code, shiftKey, expected] of cases) assert.equal(characterOf({ key, code, shiftKey }), expected);
});

test("a key has one meaning", () => {
  onKey("q", "the first", () => {});
  assert.throws(() => onKey("q", "the second", () => {}), /q.*the first/);
});

test("a key is left to others while it has no meaning", () => {
  const pressed = () => {
    const event = new Event("keydown", { cancelable: true });
    Object.assign(event, { key: "Escape", view: window });
    document.dispatchEvent(event);
    return event.defaultPrevented;
  };
  let isOpen = false, left = 0;
  onKey("Escape", "leave", () => left++, { when: () => isOpen });
  assert.deepEqual([pressed(), left], [false, 0]);
  isOpen = true;
  assert.deepEqual([pressed(), left], [true, 1]);
});
