// The emergency page: two buttons, no 3D, nothing that could be slow. Who opens it means it: one
// press is enough here, for cut too.

import { get } from "./api.js";
import { EmergencyPress } from "./emergency_press.js";
import { words } from "./format.js";
import { onKey } from "./keys.js";
import { Events } from "./sockets.js";
import { isAlone, landing, pressed } from "./who_flies.js";

const $ = (id) => document.getElementById(id);
const events = new Events();
const sent = new EmergencyPress(events, "");

function arm(button, action) {
  button.addEventListener("pointerdown", (event) => { if (event.button === 0) sent.press(action); });
  button.addEventListener("click", (event) => event.detail === 0 && sent.press(action)); // keyboard
}

arm($("cut"), "cut");
arm($("emergency-land"), "land");
onKey("e", "emergency land", () => sent.press("land"));
onKey("x", "cut the motors", () => sent.press("cut"), { hold: 500 });

// The buttons work before this is known, and when it never is.
get("/api/session").then(({ label, role }) => {
  sent.label = label;
  if (role !== "viewer") return;
  $("cut").disabled = true;
  $("cut").lastElementChild.textContent = "viewers may land the vehicle, but not cut its motors";
}).catch(() => {});

setInterval(() => {
  const { status, emergency_land: chosen } = events.summary, age = events.age("status"), isHeard = events.connected && age <= 1;
  const text = !events.connected ? "no connection to quadlab web; reconnecting. Presses are sent all the same" : !isHeard ? "the vehicle is not heard; commands are tried all the same" : `${words(status.mode)}${landing(status) ? `: ${landing(status)}` : `, ${words(status.behavior)}`}`;
  show($("state"), text);
  $("state").className = !isHeard ? "" : isAlone(status) ? "landing alone" : landing(status) ? "landing" : "";
  if (pressed(chosen)) show($("emergency-land").lastElementChild, pressed(chosen));
  const { tone, said, running } = sent.pressState; // who flies stands above
  show($("said"), said);
  show($("running"), running);
  $("answer").className = tone;
}, 100);

function show(place, text) { if (place.textContent !== text) place.textContent = text; }
