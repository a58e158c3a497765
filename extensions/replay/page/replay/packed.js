// Windows of signals as bytes, see extensions/replay/reader.py: Replay.window.

/** @typedef {{signals: string[], times: Float64Array, columns: Float32Array[]}} Group */

/** @param {number} length */
const padded = (length) => 8 * Math.ceil(length / 8);

/** @param {ArrayBuffer} buffer @returns {Group[]} */
export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = padded(4 + length);
  return head.groups.map((/** @type {{signals: string[], count: number}} */ { signals, count }) => {
    const times = new Float64Array(buffer, at, count);
    at += 8 * count;
    const columns = signals.map(() => {
      const column = new Float32Array(buffer, at, count);
      at += padded(4 * count);
      return column;
    });
    return { signals, times, columns };
  });
}

/** @param {Group[]} groups @returns {ArrayBuffer} */
export function pack(groups) {
  const text = new TextEncoder().encode(
    JSON.stringify({ groups: groups.map(({ signals, times }) => ({ signals, count: times.length })) }),
  );
  const size = groups.reduce(
    (sum, { times, columns }) => sum + 8 * times.length + columns.length * padded(4 * times.length),
    padded(4 + text.length),
  );
  const buffer = new ArrayBuffer(size);
  new DataView(buffer).setUint32(0, text.length, true);
  new Uint8Array(buffer, 4, text.length).set(text);
  let at = padded(4 + text.length);
  for (const { times, columns } of groups) {
    new Float64Array(buffer, at, times.length).set(times);
    at += 8 * times.length;
    for (const column of columns) {
      new Float32Array(buffer, at, column.length).set(column);
      at += padded(4 * column.length);
    }
  }
  return buffer;
}
