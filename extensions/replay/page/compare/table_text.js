// A table as text: LaTeX for a paper, Markdown for notes, CSV for a spreadsheet.

/** @type {Record<string, (rows: string[][]) => string>} */
export const TEXTS = {
  LaTeX: (rows) => {
    const [head, ...others] = rows.map((row) => `${row.map(latex).join(" & ")} \\\\`);
    const columns = `l${"r".repeat(Math.max(0, rows[0].length - 1))}`;
    return [
      `\\begin{tabular}{${columns}}`,
      "\\hline",
      head,
      "\\hline",
      ...others,
      "\\hline",
      "\\end{tabular}",
      "",
    ].join("\n");
  },
  Markdown: (rows) => {
    const line = (/** @type {string[]} */ cells) =>
      `| ${cells.map((text) => text.replaceAll("|", "\\|")).join(" | ")} |`;
    const [head, ...others] = rows;
    return [line(head), `|---${"|--:".repeat(Math.max(0, head.length - 1))}|`, ...others.map(line), ""].join(
      "\n",
    );
  },
  CSV: (rows) => `${rows.map((row) => row.map(quoted).join(",")).join("\n")}\n`,
};

/** @param {string} text */
const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

/** @type {Record<string, string>} */
const SIGNS = {
  "\\": "\\textbackslash{}",
  "°": "$^\\circ$",
  "−": "$-$",
  "–": "--",
  "²": "$^2$",
  "√": "$\\sqrt{}$",
  "~": "\\textasciitilde{}",
  "^": "\\textasciicircum{}",
};

/** @param {string} text */
const latex = (text) => text.replace(/[\\°−–²√~^&%$#_{}]/g, (sign) => SIGNS[sign] ?? `\\${sign}`);

// What stands in a table's cells, in rows of one length.
/** @param {HTMLTableElement} table */
export function rowsOf(table) {
  const rows = [...table.rows].map((row) => [...row.cells].map((cell) => (cell.textContent ?? "").trim()));
  const width = Math.max(...rows.map((row) => row.length));
  return rows.map((row) => [...row, ...Array(width - row.length).fill("")]);
}
