// The page's icons: lines of the text's colour on 20 × 20.


/** @type {Record<string, string>} */
const PATHS = {
  bell: "M5 13.5V9a5 5 0 0 1 10 0v4.5l1.5 2h-13zM8 17.5h4",
  close: "M5 5l10 10M15 5L5 15",
};

/** @param {string} name */
export function icon(name) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", "svg"), path = document.createElementNS(made.namespaceURI, "path");
  for (const [key, value] of Object.entries({ class: "icon", viewBox: "0 0 20 20", "aria-hidden": "true" })) made.setAttribute(key, value);
  path.setAttribute("d", PATHS[name]);
  made.append(path);
  return made;
}
