import assert from "node:assert/strict";
import { test } from "node:test";

import "../../../../tests/page/browser.js";

const { rowsOf, TEXTS } = await import("../../page/compare/table_text.js");

const ROWS = [["", "A", "B"], ["position rms, mm", "2.13", "−4"], ["a_b | c", "5 %", "–"]];

test("a table is written as LaTeX, with its signs as LaTeX takes them", () => {
  assert.equal(TEXTS.LaTeX(ROWS), [
    "\\begin{tabular}{lrr}", "\\hline", " & A & B \\\\", "\\hline",
    "position rms, mm & 2.13 & $-$4 \\\\", "a\\_b | c & 5 \\% & -- \\\\", "\\hline", "\\end{tabular}", ""].join("\n"));
  assert.equal(TEXTS.LaTeX([["\\x{1}"]]).split("\n")[2], "\\textbackslash{}x\\{1\\} \\\\");
});

test("as Markdown and CSV, whose own signs in a cell part no cells", () => {
  assert.equal(TEXTS.Markdown(ROWS), [
    "|  | A | B |", "|---|--:|--:|", "| position rms, mm | 2.13 | −4 |", "| a_b \\| c | 5 % | – |", ""].join("\n"));
  assert.equal(TEXTS.CSV(ROWS), [",A,B", '"position rms, mm",2.13,−4', "a_b | c,5 %,–", ""].join("\n"));
});

test("rows that are too short are filled", () => {
  const row = (...texts) => ({ cells: texts.map((textContent) => ({ textContent })) });
  assert.deepEqual(rowsOf({ rows: [row(" a ", "b"), row("c")] }), [["a", "b"], ["c", ""]]);
});
