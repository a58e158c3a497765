// All vehicles one after the other: each is up, or down, before the next one begins. Another button ends the
// order; so does a refusal, with the vehicle's name, and those that were not their turn stay as they are.

import { request } from "/static/core/api.js";

const LOOK = 200, // ms
  PATIENCE = 40_000; // ms for a vehicle

const start = (name, behavior, given = {}) =>
  request("POST", `/v/${name}/api/commands/start_behavior`, { name: behavior, arguments: given });

export class InOrder {
  // states: the newest states of all vehicles; say: told a line.
  constructor(names, states, say) {
    this.names = names;
    this.states = states;
    this.say = say;
    this.turn = 0;
  }

  stateOf(name) {
    return this.states().find((one) => one.name === name) ?? {};
  }

  // Arm and take off, in the order of the names, to these heights (m) in turn.
  takeOff(heights) {
    return this.each(this.names, "up", async (name, turn) => {
      if (this.stateOf(name).airborne) return;
      if (!this.stateOf(name).armed) await request("POST", `/v/${name}/api/commands/arm`, {});
      await this.until(turn, () => this.stateOf(name).armed, "it did not arm");
      const height = heights[this.names.indexOf(name) % heights.length];
      await start(name, "take_off", { height });
      await this.until(turn, () => this.stateOf(name).behavior === "hover", "it does not hover");
    });
  }

  // Land, the last one first.
  land() {
    return this.each([...this.names].reverse(), "down", async (name, turn) => {
      if (!this.stateOf(name).airborne) return;
      await start(name, "land");
      await this.until(turn, () => !this.stateOf(name).armed, "its motors are still on");
    });
  }

  // One behavior of all that fly, at once.
  async all(behavior, done) {
    this.turn++;
    const flying = this.names.filter((name) => this.stateOf(name).airborne);
    const answers = await Promise.all(
      flying.map((name) =>
        start(name, behavior).then(
          () => "",
          ({ message }) => `${name}: ${message}`,
        ),
      ),
    );
    const refused = answers.filter(Boolean);
    if (!flying.length) this.say("no vehicle is in the air");
    else this.say(refused.length ? `⚠ ${refused.join("; ")}` : `${flying.join(", ")} ${done}`);
  }

  async each(names, done, act) {
    const turn = ++this.turn;
    for (const name of names) {
      this.say(`${name} …`);
      try {
        await act(name, turn);
      } catch (error) {
        if (turn === this.turn) this.say(`⚠ ${name}: ${error.message}`);
        return;
      }
      if (turn !== this.turn) return;
    }
    this.say(`all are ${done}`);
  }

  async until(turn, isSo, otherwise) {
    const since = performance.now();
    while (!isSo()) {
      if (turn !== this.turn) return;
      if (performance.now() - since > PATIENCE) throw new Error(otherwise);
      await new Promise((resolve) => setTimeout(resolve, LOOK));
    }
  }
}
