// The cameras' recorded pictures in step with the play-head: of each the newest one at its instant.

import { paint } from "/static/camera/picture.js";
import { element, hide, setText } from "/static/core/dom.js";
import { here } from "/static/core/vehicle_path.js";

const WORDS = {
  tracker: "Tracker's camera",
  tracker_2: "Tracker's camera 2",
  tracker_3: "Tracker's camera 3",
  tracker_4: "Tracker's camera 4",
  camera: "Camera on board",
};
const OLD = 3; // s, until a picture is told to be old

export class ReplayPictures {
  constructor(place, clock) {
    this.place = element("div", { className: "pictures" });
    this.clock = clock;
    this.pictures = [];
    place.append(this.place);
    clock.addEventListener("time", () => {
      for (const one of this.pictures) one.ask();
    });
  }

  // Of the first run alone, as the 3D view's beacons are.
  setRuns([run]) {
    const cameras = Object.keys(WORDS).filter((camera) => `${camera}_picture` in run.description.topics);
    this.pictures = cameras.map((camera) => new Picture(run, camera, this.clock));
    this.place.replaceChildren(...this.pictures.map(({ figure }) => figure));
  }
}

class Picture {
  /** @type {number | undefined} */
  asked;

  constructor(run, camera, clock) {
    this.run = run;
    this.camera = camera;
    this.clock = clock;
    this.taken = "";
    this.canvas = element("canvas", { width: 640, height: 480 });
    this.canvas.setAttribute("role", "img");
    this.quiet = element("p", { className: "quiet", hidden: true });
    this.words = element("figcaption", {}, WORDS[camera]);
    this.figure = element("figure", { className: "picture" }, this.canvas, this.quiet, this.words);
    this.figure.dataset.camera = camera;
    this.ask();
  }

  // One question at a time, the newest instant next.
  async ask() {
    if (this.isAsking) return;
    this.isAsking = true;
    while (this.asked !== this.clock.t) {
      this.asked = this.clock.t;
      await this.show(this.asked).catch((error) => this.say(error.message, true));
    }
    this.isAsking = false;
  }

  async show(t) {
    const answer = await fetch(
      here(`${this.run.base}/picture?camera=${this.camera}&t=${t + this.run.shift}`),
    );
    if (!answer.ok)
      throw new Error((await answer.json().catch(() => ({}))).error ?? `error ${answer.status}`);
    const taken = answer.headers.get("x-time");
    if (taken === null) {
      this.say("No picture yet", true);
      return;
    }
    if (taken !== this.taken) await paint(this.canvas, await answer.arrayBuffer());
    this.taken = taken;
    const age = t + this.run.shift - Number(taken);
    this.say(age > OLD ? `No picture for ${Math.floor(age)} s` : "", age > OLD);
    this.figure.dataset.shown = t.toFixed(3);
    this.canvas.ariaLabel = `${WORDS[this.camera]}, ${age.toFixed(2)} s before`;
  }

  say(text, isOld) {
    setText(this.quiet, text);
    hide(this.quiet, !text);
    this.figure.classList.toggle("old", isOld);
  }
}
