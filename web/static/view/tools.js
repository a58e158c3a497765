// The tools of a 3D view, live and in replay: its camera, what it shows, and what the path's colour means.

import { element, optionsOf } from "../core/dom.js";
import { legend } from "./path_color.js";

const CAMERAS = [
  ["free", "Free camera"],
  ["follow", "Follow"],
  ["top", "Top"],
  ["side", "Side"],
  ["first", "First person"],
];
const LAYERS = [
  ["flown", "Flown path"],
  ["reference", "Reference"],
  ["truth", "Truth"],
  ["volume", "Flight volume"],
  ["ground", "Ground"],
  ["error", "Error vector"],
];
const COLORS = [
  ["none", "one colour"],
  ["error", "error"],
  ["speed", "speed"],
  ["thrust", "thrust"],
];
export const SHOWN = {
  flown: true,
  reference: true,
  truth: true,
  volume: true,
  ground: true,
  error: false,
  magnified: 10,
  color: "none",
};

export class ViewTools {
  /**
   * place: gets the camera's select, the layers and the keys; more: what stands with the layers.
   * @param {HTMLElement} place
   * @param {{ camera: string, onCamera: (camera: string) => void, onView: (change: Record<string, any>) => void,
   *   isEnabled?: boolean, note?: string, more?: HTMLElement[] }} options
   */
  constructor(place, { camera, onCamera, onView, isEnabled = true, note = "", more = [] }) {
    const disabled = !isEnabled;
    this.camera = element(
      "select",
      {
        id: "view-camera",
        ariaLabel: "camera",
        title: "how the camera moves with the vehicle",
        onchange: () => onCamera(this.camera.value),
      },
      ...optionsOf(CAMERAS, camera),
    );
    this.boxes = new Map(
      LAYERS.map(([name]) => {
        const box = element("input", {
          type: "checkbox",
          disabled,
          onchange: () => onView({ [name]: box.checked }),
        });
        box.dataset.layer = name;
        return [name, box];
      }),
    );
    this.magnified = element(
      "select",
      {
        disabled,
        ariaLabel: "magnification of the error vector",
        onchange: () => onView({ magnified: Number(this.magnified.value) }),
      },
      ...optionsOf(["1", "10", "50"].map((one) => [one, `× ${one}`])),
    );
    this.color = element(
      "select",
      {
        disabled,
        ariaLabel: "colour of the flown path",
        onchange: () => onView({ color: this.color.value }),
      },
      ...optionsOf(COLORS),
    );
    const layers = LAYERS.map(([name, words]) =>
      element(
        "label",
        {},
        /** @type {HTMLElement} */ (this.boxes.get(name)),
        words,
        ...(name === "error" ? [this.magnified] : []),
      ),
    );
    const panel = element(
      "div",
      { className: "layers" },
      ...layers,
      element("label", {}, "Path by", this.color),
      ...more,
      ...(note ? [element("small", {}, note)] : []),
    );
    this.key = element("span", { className: "key flown" });
    this.wanted = element("span", { className: "key wanted" }, "reference");
    place.prepend(
      this.camera,
      element("details", {}, element("summary", {}, "Layers"), panel),
      this.key,
      this.wanted,
    );
    this.show(SHOWN);
  }

  /** @param {Record<string, any>} view */
  show(view) {
    for (const [name, box] of this.boxes) box.checked = view[name];
    this.magnified.value = String(view.magnified);
    this.color.value = view.color;
    this.key.replaceChildren(view.color === "none" ? "flown" : legend(view.color));
    this.key.classList.toggle("ramped", view.color !== "none");
    this.key.hidden = !view.flown;
    this.wanted.hidden = !view.reference;
  }
}
