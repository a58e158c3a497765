// The emergency page: two buttons, no 3D, nothing that could be slow. One press is enough here.

import { command } from "./api.js";
import { words } from "./format.js";
import { Events } from "./sockets.js";

const $ = (id) => document.getElementById(id);
const events = new Events();

async function act(action, label) {
  $("answer").textContent = `${label} …`;
  try {
    await command("emergency", { action });
    $("answer").textContent = `${label}: accepted`;
  } catch (error) {
    $("answer").textContent = `${label}: ${error.message}`;
  }
}

$("cut").addEventListener("pointerdown", () => act("cut", "Cut motors"));
$("emergency-land").addEventListener("pointerdown", () => act("land", "Emergency land"));
$("cut").addEventListener("click", (event) => event.detail === 0 && act("cut", "Cut motors")); // keyboard
$("emergency-land").addEventListener("click", (event) => event.detail === 0 && act("land", "Emergency land"));

setInterval(() => {
  const { status } = events.summary, age = events.age("status");
  const text = !events.connected ? "no connection to quadlab web; reconnecting" : age > 1 ? "the vehicle is not heard; commands are tried all the same" : `${words(status.mode)}, ${words(status.behavior)}`;
  $("state").textContent = text;
}, 200);
