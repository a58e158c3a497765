// Layouts of the charts: those built in, one's own by name in this browser, and as a file.

import { remember } from "../core/dom.js";
import { isDerived } from "./derived.js";
import { LONGEST, SHORTEST } from "./time_axis.js";
import { MOST, MOST_UNITS } from "./signal_menu.js";

export const MOST_CHARTS = 4;
const MOST_LAYOUTS = 40,
  LONGEST_NAME = 40;
const VIEWS = ["xy", "spectrum", "spectrogram"]; // beside that over time
const OWN = "charts.layouts",
  NOW = "charts.now",
  FORMAT = "quadlab chart layouts, 1";

const xyz = (prefix) => ["x", "y", "z"].map((axis) => `${prefix}.${axis}`);
const motors = (prefix) => ["front", "left", "rear", "right"].map((motor) => `${prefix}.${motor}`);
const layout = (...charts) => ({ window: 30, charts: charts.map((signals) => ({ signals, scales: {} })) });

export const BUILT_IN = {
  Tracking: layout([...xyz("state.position"), ...xyz("reference.position")], xyz("error.position")),
  Attitude: layout(["state.roll", "state.pitch", "state.yaw"], xyz("state.rate")),
  Motors: layout(motors("thrust"), motors("motor"), ["thrust", "scaling"]),
  Estimator: layout(
    ["innovation.position", "innovation.attitude", "measurement.age"],
    [...xyz("bias.accelerometer"), ...xyz("bias.gyroscope")],
    ["mass", "nis"],
    ["noise.accelerometer", "noise.gyroscope", "noise.measurement"],
  ),
  Link: layout(["link.round_trip", "link.jitter", "link.age"], ["link.loss", "link.rate"]),
};

// { window, charts: [{ signals, scales }] } of what came from outside; throws what is wrong with it.
export function checked(given, signals) {
  const fail = (text) => {
    throw new Error(text);
  };
  const charts = given?.charts;
  if (!Array.isArray(charts) || !charts.length || charts.length > MOST_CHARTS)
    fail(`a layout has 1 to ${MOST_CHARTS} charts`);
  if (!(given.window >= SHORTEST && given.window <= LONGEST))
    fail(`window is ${given.window}; allowed ${SHORTEST} to ${LONGEST} s`);
  return {
    window: given.window,
    charts: charts.map((chart) => {
      // A derived signal that was forgotten, or that cannot be computed here, is left out.
      const names = Array.isArray(chart?.signals)
        ? chart.signals.filter((name) => signals.has(name) || !isDerived(String(name)))
        : null;
      if (!names || names.length > MOST) fail(`a chart has at most ${MOST} signals`);
      const unknown = names.find((name) => !signals.has(name));
      if (unknown !== undefined) fail(`there is no signal ${String(unknown).slice(0, 60)} here`);
      const units = new Set(names.map((name) => signals.get(name).unit));
      if (units.size > MOST_UNITS) fail(`a chart has at most ${MOST_UNITS} units`);
      const scales = {};
      for (const [unit, [low, high]] of Object.entries(chart.scales ?? {}).filter(([, ends]) =>
        Array.isArray(ends),
      )) {
        if (units.has(unit) && low < high) scales[unit] = [Number(low), Number(high)];
      }
      const limits = Object.entries(chart.limits ?? {}).filter(
        ([unit, value]) => units.has(unit) && Number.isFinite(value),
      );
      return {
        signals: [...new Set(names)],
        scales,
        ...(VIEWS.includes(chart.view) ? { view: chart.view } : {}),
        ...(limits.length ? { limits: Object.fromEntries(limits) } : {}),
        ...(chart.hasFigures === true ? { hasFigures: true } : {}),
        ...(chart.hasEvents === true ? { hasEvents: true } : {}),
      };
    }),
  };
}

function parsed(text) {
  let given;
  try {
    given = JSON.parse(text);
  } catch {
    throw new Error("this is not a JSON file");
  }
  if (given?.format !== FORMAT) throw new Error(`this is not a file of ${FORMAT.split(",")[0]}`);
  return given;
}

export class Layouts {
  constructor(signals) {
    this.signals = signals;
    this.own = this.read(OWN, (all) => this.checkedAll(all)) ?? {};
  }

  get names() {
    return Object.keys(this.own).sort((a, b) => a.localeCompare(b));
  }
  of(name) {
    return Object.hasOwn(BUILT_IN, name)
      ? BUILT_IN[name]
      : Object.hasOwn(this.own, name)
        ? this.own[name]
        : undefined;
  }

  // What this page showed last: { name, layout }; name "" when it was changed since.
  get last() {
    return (
      this.read(NOW, ({ name, layout: shown }) => ({
        name: this.of(name) ? name : "",
        layout: checked(shown, this.signals),
      })) ?? { name: "Tracking", layout: BUILT_IN.Tracking }
    );
  }

  keep(name, shown) {
    remember(NOW, { name, layout: shown });
  }

  save(name, shown) {
    if (Object.hasOwn(BUILT_IN, name))
      throw new Error(`${name} is built in; save it under a name of your own`);
    this.put({ ...this.own, [this.nameOf(name)]: shown });
  }

  remove(name) {
    const { [name]: _, ...rest } = this.own;
    this.put(rest);
  }

  get file() {
    return JSON.stringify({ format: FORMAT, layouts: this.own }, null, 1);
  }

  // The names that came; layouts of the same name are replaced.
  take(text) {
    const given = parsed(text),
      came = this.checkedAll(given.layouts);
    this.put({ ...this.own, ...came });
    return Object.keys(came);
  }

  // The derived signals that a file's charts show and that are not known here.
  derivedOf(text) {
    const all = Object.values(parsed(text).layouts ?? {}),
      names = all.flatMap((one) => one?.charts ?? []).flatMap((one) => one?.signals ?? []);
    return [...new Set(names.map(String))].filter((name) => isDerived(name) && !this.signals.has(name));
  }

  put(own) {
    if (Object.keys(own).length > MOST_LAYOUTS)
      throw new Error(`${Object.keys(own).length} layouts; at most ${MOST_LAYOUTS} are kept`);
    localStorage.setItem(OWN, JSON.stringify(own));
    this.own = own;
  }

  nameOf(name) {
    const short = String(name).trim();
    if (!short || short.length > LONGEST_NAME || Object.hasOwn(BUILT_IN, short) || short === "__proto__")
      throw new Error(
        `a layout's name has 1 to ${LONGEST_NAME} characters and cannot be one of ${Object.keys(BUILT_IN).join(", ")}`,
      );
    return short;
  }

  checkedAll(all) {
    return Object.fromEntries(
      Object.entries(all ?? {}).map(([name, shown]) => {
        try {
          return [this.nameOf(name), checked(shown, this.signals)];
        } catch (error) {
          throw new Error(`${name.slice(0, LONGEST_NAME)}: ${error.message}`);
        }
      }),
    );
  }

  // What another version left there is not worth an error.
  read(key, make) {
    try {
      const text = localStorage.getItem(key);
      return text === null ? null : make(JSON.parse(text));
    } catch {
      return null;
    }
  }
}
