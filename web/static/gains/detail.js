// What a parameter's row shows when its name is pressed: meaning, bounds, how to change what cannot
// be changed here, and its own history.

import { element } from "../core/dom.js";
import { exact } from "../core/format.js";
import { TimeLine } from "./timeline.js";

export function unfold(gains, row, place) {
  const {
    name,
    description,
    unit,
    default: initial,
    minimum,
    maximum,
    flight_step: step,
    read_only: isFixed,
  } = row.description;
  const withUnit = (text) => (unit ? `${text} ${unit}` : text);
  const facts = [`default ${exact(initial)}`];
  if (minimum !== null || maximum !== null)
    facts.push(
      withUnit(
        `${minimum === null ? "any" : exact(minimum)} to ${maximum === null ? "any" : exact(maximum)}`,
      ),
    );
  if (step) facts.push(`${withUnit(`in flight at most ${exact(step)}`)} at once`);
  place.append(
    element("code", {}, name),
    element("p", {}, description),
    element("p", { className: "facts" }, facts.join(" · ")),
  );
  if (isFixed)
    place.append(
      element(
        "p",
        { className: "facts" },
        `Read at start-up only. To change it, start quadlab with --set ${name}=…`,
      ),
    );
  else if (!gains.isOperator)
    place.append(element("p", { className: "facts" }, "You are a viewer; an operator can change this."));
  const line = new TimeLine(gains, element("div"), { name, limit: 60 });
  place.append(line.place);
  line.start();
}
