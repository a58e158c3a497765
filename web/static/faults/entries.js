// The texts of faults, free of the page: which parameter has which, and how an entry comes and goes.

// Parameters with texts of faults, as the page names them, by the name of the table.
/** @type {Record<string, string>} */
export const TEXTS = {
  "simulator.faults": "simulator.faults",
  "tracker.faults": "station.tracker.faults",
  "bearings.faults": "station.bearings.faults",
};

const CALM = new RegExp(
  "^simulator\\.(wind_|push_|gust$|payload$|motor_gain_|failed_motor$|missing_motor$|vibration|lost_samples$|" +
    "corrupted_bytes$|unplugged_port$|served\\.)",
);
const ALIGNED = new RegExp(
  "^station\\.(tracker\\.(drop_out|stamp_error|outliers|delay)|" +
    "bearings\\.(bias_[xyz]|beacon_bias|lost|swap|drop_out|occlusion|stamp_error))$",
);

/**
 * @param {string} text
 * @returns {string[]}
 */
export const entriesOf = (text) =>
  text
    .split(";")
    .map((one) => one.trim().replace(/\s+/g, " "))
    .filter(Boolean);

/**
 * The entry of a fault: its name, all words of its own, and those of its schedule that differ from their defaults.
 * @param {string} name
 * @param {{ name: string, default: any }[]} words
 * @param {{ name: string, default: any }[]} schedule
 * @param {Record<string, any>} values
 */
export function entryOf(name, words, schedule, values) {
  const given = (/** @type {{ name: string }} */ one) =>
    values[one.name] !== undefined && values[one.name] !== "";
  const said = [
    ...words.filter(given),
    ...schedule.filter((one) => given(one) && values[one.name] !== one.default),
  ];
  return [name, ...said.map((one) => `${one.name}=${values[one.name]}`)].join(" ");
}

/**
 * The parameters that a schedule can move, as faults of their own: each with its value.
 * @param {Iterable<any>} parameters
 */
export function movable(parameters) {
  const found = [];
  for (const one of parameters) {
    const name = one.name.replace(/^station\./, ""),
      home = `${name.split(".")[0]}.faults`,
      short = name.slice(name.indexOf(".") + 1);
    if (
      one.name !== TEXTS[home]?.replace("faults", short) ||
      one.read_only ||
      short === "seed" ||
      (one.type === "str" && !one.choices.length)
    )
      continue;
    found.push({
      name,
      home,
      physics: one.description,
      words: [{ ...one, name: "value", default: one.value }],
    });
  }
  return found;
}

/** @param {string} text @param {string} entry */
export const withEntry = (text, entry) => [...entriesOf(text), entry].join("; ");

/** @param {string} text @param {number} index */
export const withoutEntry = (text, index) =>
  entriesOf(text)
    .filter((_, k) => k !== index)
    .join("; ");

/**
 * The values that take back wind, load, faults and misalignment: those of them that differ from their defaults.
 * @param {Iterable<{ name: string, value: any, default: any }>} parameters
 */
export function calm(parameters) {
  const texts = new Set(Object.values(TEXTS));
  return Object.fromEntries(
    [...parameters]
      .filter(
        ({ name, value, default: initial }) =>
          value !== initial && (texts.has(name) || CALM.test(name) || ALIGNED.test(name)),
      )
      .map(({ name, default: initial }) => [name, initial]),
  );
}
