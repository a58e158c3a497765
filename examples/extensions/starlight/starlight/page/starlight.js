// The tab of the extension: it shows what its route returns. Modules of the page are below /static/.

import { get } from "/static/core/api.js";
import { element } from "/static/core/dom.js";

// place: the tab's element; events: what the page hears of the vehicle.
export function show(place, { events }) {
  const line = element("p", { className: "starlight" });
  place.append(line);
  events.on("hello", async () => {
    const { vehicle } = await get("/api/starlight");
    line.textContent = `Starlight tracks ${vehicle}`;
  });
}
