// The documents of the page that extensions offer, as the server names them in the page's first tag: a link to one of
// them is shown only where it is there.

/** @param {string} name */
export const isThere = (name) => (document.documentElement.dataset.documents ?? "").split(" ").includes(name);
