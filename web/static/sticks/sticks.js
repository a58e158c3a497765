// Gamepad, keyboard or fingers → /ws/stick at 50 Hz while the dead-man button is held. It counts from a
// press with all sticks centred, and after any drop (blur, hidden tab, page left or stalled, pad
// unplugged, answers late, refused) only when it was released and pressed again. Quadlab web,
// the station and the vehicle have watchdogs of their own.

import { StickKeys } from "./keyboard.js";
import { StickLink } from "./socket.js";
import { mappingOf, readPad } from "./mapping.js";
import { TouchSticks } from "./touch.js";

const STALLED = 250; // ms between two ticks
const LATE = 500; // ms a frame may wait for its answer
const CUT_HOLD = 500; // ms
const CENTRE = [0, 0, 0, 0];
const DROPS = {
  blur: "the window lost focus", hidden: "the tab was hidden", unplugged: "the pad was unplugged",
  stalled: "this page froze", late: "no reply from the station", left: "this page was closed", editing: "the pad is being set up",
};

export class Sticks {
  link;

  since;

  // emergency: {press(action)}
  constructor(emergency) {
    this.emergency = emergency;
    this.keys = new StickKeys();
    this.touch = new TouchSticks();
    this.link = null; // made at the first sign of use
    this.on = false;
    this.why = "release the button first"; // while held and not on; "" once it was released
    this.dropped = ""; // why they were dropped last, until they are on again
    this.note = ""; // what keeps them from moving the vehicle while they are on
    this.editing = false;
    this.mapping = null;
    this.pad = null;
    this.centred = true;
    this.raw = CENTRE;
    this.sent = CENTRE;
    this.ticked = performance.now();
    this.cutSince = null;
    this.landSeen = true; // until seen released
    for (const [type, cause] of [["blur", "blur"], ["pagehide", "left"], ["gamepaddisconnected", "unplugged"]]) addEventListener(type, () => this.drop(cause));
    document.addEventListener("visibilitychange", () => document.hidden && this.drop("hidden"));
    document.addEventListener("freeze", () => this.drop("hidden"));
    this.clock = new Worker("/static/sticks/clock.js");
    this.clock.onmessage = () => this.tick();
  }

  drop(cause) {
    this.keys.clear();
    this.touch.clear();
    this.cutSince = null;
    if (this.on) {
      this.link.send(CENTRE, false, cause);
      this.dropped = DROPS[cause];
    }
    this.refuse(DROPS[cause]);
  }

  refuse(why) {
    this.on = false;
    this.why = why;
    this.sent = CENTRE;
    this.link?.forget();
  }

  // {raw, axes, held, centred} of pad and keys together.
  read(dt) {
    const pad = [...(navigator.getGamepads?.() ?? [])].find((one) => one?.connected) ?? null;
    if (this.pad !== null && pad?.id !== this.pad.id) this.drop("unplugged");
    if (pad !== null && (this.pad === null || pad.id !== this.pad.id)) {
      this.mapping = mappingOf(pad);
      this.landSeen = true;
      this.cutSince = null;
      if (!this.on) this.why = "release the button first"; // one held while it is plugged in
    }
    this.pad = pad; // a new object each time in some browsers
    const keys = this.keys.step(dt), read = pad && this.mapping ? readPad(pad, this.mapping) : null;
    if (this.editing) this.landSeen = true; // pressed to be chosen: must be released first
    else if (read) this.watchEmergency(read);
    const { touch } = this, sum = (...all) => all[0].map((_, i) => Math.max(-1, Math.min(1, all.reduce((total, one) => total + one[i], 0))));
    const axes = sum(keys, touch.axes, read?.axes ?? CENTRE);
    return {
      raw: sum(keys, touch.rawAxes, read?.raw ?? CENTRE), axes,
      held: this.keys.deadMan || touch.deadMan || Boolean(read?.deadMan),
      centred: !this.keys.moving && [keys, touch.axes, read?.axes ?? CENTRE].flat().every((value) => value === 0),
    };
  }

  // The pad's own buttons: land at a press, cut when held; neither by one held since before.
  watchEmergency({ land, cut }) {
    if (land && !this.landSeen) this.emergency.press("land");
    this.landSeen = land;
    if (!cut) this.cutSince = 0;
    else if (this.cutSince === 0) this.cutSince = performance.now();
    else if (this.cutSince !== null && performance.now() - this.cutSince >= CUT_HOLD) {
      this.cutSince = null; // once a press
      this.emergency.press("cut");
    }
  }

  tick() {
    const now = performance.now(), gap = now - this.ticked;
    this.ticked = now;
    if (gap > STALLED && this.on) this.drop("stalled");
    const { raw, axes, held, centred } = this.read(Math.min(gap, 100) / 1e3);
    this.raw = raw;
    this.held = held;
    this.centred = centred;
    if (!this.link && (held || this.pad)) this.connect();
    if (!held) {
      if (this.on) this.link.send(CENTRE, false);
      if (this.on || this.why) this.refuse("");
    } else if (this.on) {
      if (this.link.overdue > LATE) this.drop("late");
    } else if (!this.why && this.link?.connected) {
      this.begin(centred);
    }
    if (this.on) {
      this.sent = axes;
      this.link.send(axes, true);
    }
  }

  // A press of the button: whether it counts.
  begin(centred) {
    const why = this.editing ? "close the set-up of the pad first"
      : document.hidden || !document.hasFocus() ? "this page does not have focus: click on it first"
      : !centred ? "centre all sticks and keys, then press again" : "";
    if (why) { this.refuse(why); return; }
    this.on = true;
    this.dropped = "";
    // The other side wants to see a release after each silence. We saw one; a page that stood
    // still with the button held did not, and so stays without sticks.
    this.since = this.link.send(CENTRE, false);
  }

  connect() {
    this.link = new StickLink();
    this.link.addEventListener("answer", ({ detail }) => {
      if (!this.on || detail.n <= this.since) return;
      this.note = detail.why;
      if (detail.on) return;
      this.link.send(CENTRE, false);
      this.dropped = detail.why;
      this.refuse(detail.why);
    });
    this.link.addEventListener("lost", () => {
      if (this.on) this.dropped = "the connection was lost";
      this.refuse("no connection to this page's server; release and press again");
    });
  }
}
