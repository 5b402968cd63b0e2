// Numbers of the page, from their binary text: points are whole steps from the origin of their frame.
"use strict";
const DATA = JSON.parse(document.getElementById("data").textContent);
const pack = (() => {
  const KINDS = { int16: Int16Array, uint16: Uint16Array, int32: Int32Array, uint32: Uint32Array, float32: Float32Array };
  const UNKNOWN = -32768, arrays = {};
  for (const [name, { type, base64 }] of Object.entries(DATA.packed)) {
    const text = atob(base64), bytes = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
    arrays[name] = new KINDS[type](bytes.buffer);
  }
  const count = DATA.points.length, paths = DATA.paths?.probability.length ?? 0;

  // The points of a row of an array, metres in the world; null where unknown.
  function row(name, index, { origin }) {
    const values = arrays[name], found = [];
    for (let k = 0, at = 3 * count * index; k < count; k++, at += 3) {
      found.push(values[at] === UNKNOWN ? null : [0, 1, 2].map((axis) => origin[axis] + values[at + axis] * DATA.step));
    }
    return found;
  }

  const value = (name, frame, survivor) => arrays[name]?.[frame.first + survivor];
  return {
    has: (name) => name in arrays,
    points: (frame, survivor) => row("points", frame.first + survivor, frame),
    truth: (index) => ("truth" in arrays ? row("truth", index, DATA.frames[index]) : null),
    rejected: (frame, example) => row("rejected", frame.firstExample + example, frame),
    path: (index, path) => row("paths", index * paths + path, DATA.frames[index]),
    // The survivor that a path has in a frame, or -1; and the joints of it that no image point placed.
    onPath: (index, path) => arrays.pathSurvivor[index * paths + path],
    bridged: (index, path, joint) => Boolean(arrays.pathBridged[index * paths + path] & (1 << joint)),
    number: (frame, survivor) => value("number", frame, survivor),
    probability: (frame, survivor) => value("probability", frame, survivor),
    group: (frame, survivor) => value("groups", frame, survivor),
    // A pruned branch of an uncalibrated frame: its choices, the number of its reason, what was found, and the bound.
    pruned: (frame, index) => ["Branch", "Reason", "Value", "Bound"].map((name) => arrays[`pruned${name}`][frame.firstPruned + index]),
    margin: (frame, survivor, index) => value(`margin${index}`, frame, survivor),
    // Near (0) or far (1), segment by segment, as text; undefined where there is no such thing.
    branch: (frame, survivor) => value("branches", frame, survivor)?.toString(2).slice(1) || undefined,
  };
})();
