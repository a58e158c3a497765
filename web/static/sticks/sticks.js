// Gamepad, keyboard or fingers → /ws/stick at 50 Hz while the dead-man button is held. It counts from a
// press with all sticks centred, and after any drop (blur, hidden tab, page left or stalled, pad
// unplugged or silent, answers late, refused) only when it was released and pressed again. Quadlab
// web, the station and the vehicle have watchdogs of their own.

import { StickKeys } from "./keyboard.js";
import { StickLink } from "./socket.js";
import { mappingOf, readPad } from "./mapping.js";
import { Pads, SILENT } from "./pads.js";
import { TouchSticks } from "./touch.js";

const STALLED = 250; // ms between two ticks
const LATE = 500; // ms a frame may wait for its answer
const CUT_HOLD = 500; // ms
const CENTRE = [0, 0, 0, 0];
const DROPS = {
  blur: "the window lost focus",
  hidden: "the tab was hidden",
  unplugged: "the pad was unplugged",
  stalled: "this page froze",
  late: "no reply from the station",
  left: "this page was closed",
  editing: "the pad is being set up",
  silent: "the pad sent nothing for 0.5 s",
};

export class Sticks {
  link;

  since;

  // emergency: {press(action)}; newLink(): where the frames go.
  constructor(emergency, newLink = () => new StickLink()) {
    this.emergency = emergency;
    this.newLink = newLink;
    this.keys = new StickKeys();
    this.touch = new TouchSticks();
    this.link = null; // made at the first sign of use
    this.on = false;
    this.why = "release the button first"; // while held and not on; "" once it was released
    this.dropped = ""; // why they were dropped last, until they are on again
    this.note = ""; // what keeps them from moving the vehicle while they are on
    this.editing = false;
    this.mapping = null;
    this.pads = new Pads();
    this.padWaits = ""; // "new" or "silent": until the pad is seen at rest only land and cut of it count
    this.held = false; // these two also of a pad that waits
    this.centred = true;
    this.raw = CENTRE;
    this.sent = CENTRE;
    this.ticked = performance.now();
    this.cutSince = null;
    this.landSeen = true; // until seen released
    for (const [type, cause] of [
      ["blur", "blur"],
      ["pagehide", "left"],
      ["gamepaddisconnected", "unplugged"],
    ])
      addEventListener(type, () => this.drop(cause));
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

  get pad() {
    return this.pads.pad;
  }

  // What keeps a held button from counting, "" for nothing.
  get refusal() {
    if (this.why || !this.padWaits) return this.why;
    return this.padWaits === "silent"
      ? DROPS.silent
      : `${this.centred ? "" : "centre all sticks and "}release the button first`;
  }

  // The pad as it is now, or null. Another one than before must be at rest first, and so must one that
  // is deflected, or alone holds the button for deflected keys, and has sent nothing for too long.
  readPad(now, others) {
    const before = this.pad,
      wasSilent = this.pads.silence(now) > SILENT;
    if (this.pads.look(now, this.on)) {
      if (before && this.on) this.drop(wasSilent ? "silent" : "unplugged");
      this.mapping = this.pad && mappingOf(this.pad);
      this.padWaits = "new";
      this.landSeen = true;
      this.cutSince = null;
    }
    if (!this.pad || !this.mapping) return null;
    const read = readPad(this.pad, this.mapping),
      isCentred = read.axes.every((value) => value === 0);
    if (isCentred && !read.deadMan) this.padWaits = "";
    else if (
      !this.padWaits &&
      this.pads.silence(now) > SILENT &&
      !(isCentred && (others.held || others.centred))
    ) {
      this.padWaits = "silent";
      if (this.on) this.drop("silent");
    }
    return { ...read, isCentred };
  }

  // {raw, axes, held, centred} of pad, keys and fingers together.
  read(now, dt) {
    const { touch } = this,
      sum = (...all) =>
        all[0].map((_, i) =>
          Math.max(
            -1,
            Math.min(
              1,
              all.reduce((total, one) => total + one[i], 0),
            ),
          ),
        );
    this.keys.step(dt);
    const others = {
      held: this.keys.deadMan || touch.deadMan,
      centred: this.keys.centred && touch.axes.every((value) => value === 0),
    };
    const pad = this.readPad(now, others),
      counts = pad && !this.padWaits;
    if (this.editing)
      this.landSeen = true; // pressed to be chosen: must be released first
    else if (pad) this.watchEmergency(pad);
    this.held = others.held || Boolean(pad?.deadMan);
    this.centred = others.centred && (pad?.isCentred ?? true);
    this.raw = sum(this.keys.axes, touch.rawAxes, pad?.raw ?? CENTRE);
    return {
      axes: sum(this.keys.axes, touch.axes, counts ? pad.axes : CENTRE),
      held: this.keys.deadMan || touch.deadMan || Boolean(counts && pad.deadMan),
      centred: others.centred && (counts ? pad.isCentred : true),
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
    const now = performance.now(),
      gap = now - this.ticked;
    this.ticked = now;
    if (gap > STALLED && this.on) this.drop("stalled");
    const { axes, held, centred } = this.read(now, Math.min(gap, 100) / 1e3),
      wasOn = this.on;
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
      this.sent = wasOn ? axes : CENTRE; // a press begins at zero
      this.link.send(this.sent, true);
    }
  }

  // A press of the button: whether it counts.
  begin(centred) {
    const why = this.editing
      ? "close the set-up of the pad first"
      : document.hidden || !document.hasFocus()
        ? "this page does not have focus: click on it first"
        : !centred
          ? this.keys.moving
            ? "release all keys, hold Shift, then steer"
            : "centre all sticks, then press again"
          : "";
    if (why) {
      this.refuse(why);
      return;
    }
    this.on = true;
    this.keys.restart();
    this.dropped = "";
    // The other side wants to see a release after each silence. We saw one; a page that stood
    // still with the button held did not, and so stays without sticks.
    this.since = this.link.send(CENTRE, false);
  }

  connect() {
    this.link = this.newLink();
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
