// The page's vehicle by its address: `/v/quad2/…` is quad2's; without it, it is the first one's.
// Everything the page asks for goes to the same vehicle.

const [PREFIX] = /^\/v\/[a-z0-9_]+(?=\/)/.exec(location.pathname) ?? [""];
const OF_ALL = /^\/(static|vendor|login|v|signed|favicon)\b|^\/\//; // the same for all vehicles

// A path of ours ("/api/…") as it is for this page's vehicle; any other address as it is.
/** @param {any} path */
export const here = (path) =>
  typeof path === "string" && path.startsWith("/") && !OF_ALL.test(path) ? PREFIX + path : path;

// The page's own path, as if there were one vehicle only.
export const pathname = location.pathname.slice(PREFIX.length);

// This same page of another vehicle; `hash` with its sign, or "".
/** @param {string} name */
export const sameFor = (name, hash = "") => `/v/${name}${pathname}${hash}`;

// Whether a document that an extension offers is there, as the server says in the page's first tag; a link to one is
// shown only then.
/** @param {string} name */
export const isThere = (name) => (document.documentElement.dataset.documents ?? "").split(" ").includes(name);
