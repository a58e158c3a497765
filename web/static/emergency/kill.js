// The emergency page: two buttons, no 3D, nothing that could be slow. Who opens it means it: one
// press is enough here, for cut too.

import { get, request } from "../core/api.js";
import { EmergencyPress } from "./press.js";
import { $, setText } from "../core/dom.js";
import { words } from "../core/format.js";
import { onKey } from "../core/keys.js";
import { Events } from "../core/sockets.js";
import { isAlone, landing, pressed } from "../core/control_authority.js";

const events = new Events();
const sent = new EmergencyPress(events, "");
let ours = ""; // which vehicle, where there are several

function arm(button, action) {
  button.addEventListener("pointerdown", (event) => {
    if (event.button === 0) sent.press(action);
  });
  button.addEventListener("click", (event) => event.detail === 0 && sent.press(action)); // keyboard
}

$("buttons").addEventListener("submit", (event) => event.preventDefault()); // from here on it is ours
arm($("cut"), "cut");
arm($("emergency-land"), "land");
onKey("e", "emergency land", () => sent.press("land"));
onKey("x", "cut the motors", () => sent.press("cut"), { hold: 500 });

// The buttons work before this is known, and when it never is.
get("/api/session")
  .then(({ label, role, vehicle, vehicles }) => {
    sent.label = label;
    if (vehicles.length > 1) several(vehicle);
    if (role !== "viewer") return;
    $("cut").disabled = true;
    $("cut").lastElementChild.textContent = "viewers may land the vehicle but not cut its motors";
  })
  .catch(() => {});

setInterval(() => {
  const { status, emergency_land: chosen } = events.summary,
    age = events.age("status"),
    hasContact = events.connected && age <= 1;
  const text = !events.connected
    ? "no connection to this page's server; reconnecting. The buttons still send"
    : !hasContact
      ? "no data from the vehicle; commands are still sent"
      : `${words(status.mode)}${landing(status) ? `: ${landing(status)}` : `, ${words(status.behavior)}`}`;
  setText($("state"), ours + text);
  $("state").className = !hasContact
    ? ""
    : isAlone(status)
      ? "landing alone"
      : landing(status)
        ? "landing"
        : "";
  if (pressed(chosen)) setText($("emergency-land").lastElementChild, pressed(chosen));
  const { tone, said, running } = sent.pressState; // who flies stands above
  setText($("said"), said);
  setText($("running"), running);
  $("answer").className = tone;
}, 100);

/** @param {{ name: string, outcome: string }} answer */
const acceptedBy = ({ name, outcome }) => (outcome === "accepted" ? name : `${name} (${outcome})`);

// With several vehicles: which one the two buttons are for, and one for all of them.
function several(vehicle) {
  ours = `${vehicle}: `;
  document.title = `${vehicle}: emergency`;
  const button = $("land-all"),
    said = button.lastElementChild,
    before = said.textContent;
  document.body.classList.add("several");
  button.hidden = false;
  button.addEventListener("click", async () => {
    setText(said, "◌ sent, not acknowledged");
    try {
      const { vehicles } = await request("POST", "/api/fleet/land", {});
      const failed = vehicles.filter(({ outcome }) => outcome === "failed");
      setText(
        said,
        failed.length
          ? `⚠ ${failed.map(({ name, reason }) => `${name}: ${reason}`).join("; ")}. Press again.`
          : `✓ accepted: ${vehicles.map(acceptedBy).join(", ")}`,
      );
    } catch (error) {
      setText(said, `⚠ failed: ${error.message}. Press again.`);
    }
    setTimeout(() => {
      if (said.textContent.startsWith("✓")) setText(said, before);
    }, 60_000);
  });
}
