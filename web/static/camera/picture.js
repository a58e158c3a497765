// A camera's picture as it comes, with the tags marked in it, and how well the camera sees.
// The socket is open only while the picture is on the screen: else no picture is made.

import { element, hide, setText, showNote } from "../core/dom.js";
import { Socket } from "../core/sockets.js";

const PERIOD = 500; // ms
const QUIET = 3; // s without a picture, until it is status
const SILENT = 1.5; // s without a status of the camera's process

export class CameraPicture {
  /** @type {Socket | null} */
  socket = null;
  painted = -Infinity; // ms
  opened = 0; // ms

  // camera: "tracker" or "camera", as the summary and the topics call it; number: of the tracker's, from 0.
  constructor(place, events, camera, words, number = 0) {
    this.place = place;
    this.events = events;
    this.camera = camera;
    this.number = number;
    this.words = words;
    this.canvas = element("canvas", { width: 640, height: 480 });
    this.canvas.setAttribute("role", "img");
    this.quiet = element("p", { className: "quiet", hidden: true });
    this.sees = element("figcaption", {});
    this.problem = element("p", { className: "reason", hidden: true });
    place.append(
      element("figure", { className: "picture" }, this.canvas, this.quiet, this.sees),
      this.problem,
    );
    document.addEventListener("visibilitychange", () => this.draw());
    setInterval(() => this.draw(), PERIOD);
    this.draw();
  }

  get isSeen() {
    const { top, bottom, height } = this.place.getBoundingClientRect(); // no height in a tab that is closed
    return !document.hidden && height > 0 && bottom > 0 && top < innerHeight;
  }

  draw() {
    const status = this.events.summary[this.camera],
      sees = status?.sees[this.number],
      isCamera = Boolean(sees);
    hide(this.place, !isCamera);
    if (isCamera && this.isSeen) this.open();
    else this.close();
    if (!this.socket) return;
    const silent = !(this.events.age(`${this.camera}_status`) < SILENT);
    const waited = (performance.now() - Math.max(this.painted, this.opened)) / 1e3,
      isQuiet = waited > QUIET;
    setText(
      this.sees,
      silent ? "No data from the camera's process: start quadlab tracker, or check its output." : sees,
    );
    showNote(this.problem, silent || this.camera === "tracker" ? "" : status.problem); // the tracker's is shown above
    showNote(this.quiet, isQuiet ? `No picture for ${Math.floor(waited)} s` : (this.refused ?? ""));
    this.place.classList.toggle("stale", isQuiet || silent);
    this.canvas.ariaLabel = `picture of ${this.words}, tags marked: ${isQuiet ? this.quiet.textContent : sees}`;
  }

  open() {
    if (this.socket) return;
    this.opened = performance.now();
    this.socket = new Socket(`/ws/picture/${this.camera}${this.number ? `_${this.number + 1}` : ""}`, {
      binary: true,
    });
    this.socket.addEventListener("message", ({ data }) => this.take(data));
  }

  close() {
    this.socket?.close();
    this.socket = null;
  }

  // A JPEG, or why there is none.
  async take(data) {
    this.refused = typeof data === "string" ? data : "";
    if (this.refused) return;
    await paint(this.canvas, data);
    this.painted = performance.now();
  }
}

/** @param {HTMLCanvasElement} canvas @param {ArrayBuffer} jpeg */
export async function paint(canvas, jpeg) {
  const picture = await createImageBitmap(new Blob([jpeg], { type: "image/jpeg" }));
  const { width, height } = picture;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  canvas.getContext("2d")?.drawImage(picture, 0, 0);
  picture.close();
}
