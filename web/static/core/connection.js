// A strip that shows when a page has lost its server, and why it cannot start.

import { get } from "./api.js";
import { $, element, showNote } from "./dom.js";

// "Signed out" in `place` where that is why the server does not answer; whether it is.
export async function showSignedOut(place, isWanted = () => true) {
  const status = await get("/api/session").then(
    () => 200,
    (error) => error.status,
  );
  if (status !== 401 || !isWanted()) return false;
  place.replaceChildren("Signed out. ", element("a", { href: "/login" }, "Sign in"), " to come back");
  return true;
}

// socket: the page's own; note: what still works meanwhile.
export function followConnection(socket, note = "") {
  const strip = $("offline");
  const show = () => {
    strip.hidden = socket.connected;
    if (socket.connected) return;
    strip.textContent = `No connection to this page's server; reconnecting. These values are out of date${note}.`;
    showSignedOut(strip, () => !socket.connected);
  };
  socket.addEventListener("close", () => setTimeout(show, 400));
  socket.addEventListener("open", show);
}

/** @param {() => Promise<void>} start */
export function begin(start) {
  start().catch((error) => showNote($("offline"), `The page could not start: ${error.message}`));
}
