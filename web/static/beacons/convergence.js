// How far the estimator in parallel is on its way to a hand-over, of the vehicle's status.

import { element, setText } from "../core/dom.js";
import { fixed } from "../core/format.js";

const LACKS = ["nothing runs in parallel", "no measurement in time", "converging", "too far away"];
const NOTHING = 4; // vehicle.estimators.readiness.Lack

const millimetres = (metres) => (metres === null ? null : `${fixed(1000 * metres, 0)} mm`);

// {lack: "" when it may be flown on, share: 0 to 1, text}; null without such an estimator
export function convergenceOf(status) {
  const lacks = status?.shadow_lack ?? 0;
  if (!lacks) return null;
  const lack = lacks === NOTHING ? "" : LACKS[lacks],
    sigma = millimetres(status.shadow_deviation),
    distance = millimetres(status.shadow_distance);
  const figures = lacks === 1 ? [] : [sigma && `σ ${sigma}`, distance && `${distance} apart`];
  const told = lack || `ready for ${fixed(status.shadow_ready, 0)} s`;
  return { lack, share: status.shadow_share, text: [...figures, told].filter(Boolean).join(" · ") };
}

export class ConvergenceBar {
  constructor() {
    this.fill = element("i");
    this.figures = element("output");
    this.figures.dataset.topic = "status";
    const track = element("div", { className: "track" }, this.fill);
    this.place = element("li", { className: "convergence", hidden: true }, track, this.figures);
  }

  show(convergence) {
    this.place.hidden = !convergence;
    if (!convergence) return;
    this.fill.style.width = `${(100 * convergence.share).toFixed(0)}%`;
    this.place.classList.toggle("done", !convergence.lack);
    setText(this.figures, convergence.text);
  }
}
