// Parameters of vehicle, station and simulator, as these have confirmed them.

import { get, request } from "../core/api.js";

// Fires `read` when all have been read, and `confirmed` (detail: {name, before}) for each newer value.
export class Parameters extends EventTarget {
  constructor(events, isOperator) {
    super();
    this.isOperator = isOperator;
    this.known = new Map(); // name → description, with value, generation and revision
    events.on("hello", () => this.load());
    events.on("parameters", () => this.load());
    events.on("parameter", (news) => this.confirm(news));
  }

  async load() {
    const read = await get("/api/parameters").catch(() => null);
    if (read === null) return; // the server is away; its next hello loads again
    const before = this.known;
    this.known = new Map(read.parameters.map((one) => [one.name, { ...one, generation: read.generation }]));
    // Received while this was under way. What was read counts more than a value of the same revision: the
    // change in between may have been lost.
    for (const one of before.values()) if (isNewer(one, this.known.get(one.name))) this.update(one);
    this.dispatchEvent(new Event("read"));
  }

  // An answer and the news of it overtake each other: what is older than the known value does not count.
  update({ name, value, generation, revision }) {
    const one = this.known.get(name);
    if (!one || isNewer(one, { generation, revision })) return false;
    Object.assign(one, { value, generation, revision });
    return true;
  }

  confirm(news) {
    const before = this.value(news.name);
    if (this.update(news))
      this.dispatchEvent(new CustomEvent("confirmed", { detail: { name: news.name, before } }));
  }

  // The confirmed value, undefined when there is no such parameter.
  value(name) {
    return this.known.get(name)?.value;
  }

  // Several at once, all or nothing; in flight in steps where one is too large, if `walks`. An error's
  // message is the reason.
  async set(values, walks = false) {
    const { applied, revisions, generation } = await request("PUT", "/api/parameters", { values, walks });
    for (const [name, value] of Object.entries(applied))
      this.confirm({ name, value, generation, revision: revisions[name] });
    return applied;
  }
}

// Whether a value was confirmed after another one, which may be unknown.
function isNewer(one, other) {
  return (
    other !== undefined &&
    (one.generation > other.generation ||
      (one.generation === other.generation && one.revision > other.revision))
  );
}
