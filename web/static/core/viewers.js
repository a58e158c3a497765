// Links that open something in Foxglove or Lichtblick, whose pages connect to this server from the browser.

import { request } from "./api.js";
import { copied, element } from "./dom.js";

const VIEWERS = [
  ["foxglove", "Foxglove"],
  ["lichtblick", "Lichtblick"],
];

// What a browser lets such a page do.
function honest() {
  const own = ["localhost", "127.0.0.1", "[::1]"].includes(location.hostname);
  if (location.protocol === "https:")
    return (
      "The viewer's page connects from your browser, which must trust this server's " +
      "certificate; Chrome asks whether the page may reach your network."
    );
  return own
    ? "The viewer's page connects from your browser, and only on this computer. Chrome asks first, " +
        "Firefox allows it, Safari refuses http."
    : "This page is not encrypted: browsers let the viewer's page connect only with --tls. The " +
        "desktop programs connect.";
}

// Buttons; `path()` makes the link by POST, `say(...content)` shows what came of it.
export function viewerButtons(path, say) {
  async function open(name, label) {
    const asked = path();
    try {
      const { url, viewers } = await request("POST", asked);
      if (asked !== path()) return;
      window.open(viewers[name], "_blank", "noopener,noreferrer");
      say(
        element(
          "a",
          { href: viewers[name], target: "_blank", rel: "noopener noreferrer" },
          `Open in ${label}`,
        ),
        " · ",
        element(
          "button",
          {
            className: "link",
            onclick: async ({ target }) => {
              if (await copied(url)) target.textContent = "Copied";
            },
          },
          "Copy link",
        ),
        ` · for ten minutes, for anyone who has it. ${honest()}`,
      );
    } catch (error) {
      say(error.message);
    }
  }
  return VIEWERS.map(([name, label]) =>
    element(
      "button",
      { title: `open in ${label}, with a link that works for ten minutes`, onclick: () => open(name, label) },
      label,
    ),
  );
}
