// Unpacked arrays of the page, and its virtual camera: projects world points to x, y, depth, and pixels per metre.
"use strict";
const DATA = JSON.parse(document.getElementById("data").textContent);
const FIGURED = DATA.frames.length > 0;
const pack = (() => {
  const KINDS = { int16: Int16Array, uint16: Uint16Array, int32: Int32Array, uint32: Uint32Array, float32: Float32Array };
  const UNKNOWN = -32768, arrays = {}, count = DATA.points?.length ?? 0, paths = DATA.paths?.probability.length ?? 0;
  for (const [name, { type, base64 }] of Object.entries(DATA.packed ?? {})) {
    const text = atob(base64), bytes = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
    arrays[name] = new KINDS[type](bytes.buffer);
  }

  // Points of a row of an array, world frame, metres; null if unknown.
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
    path: (index, path) => row("paths", index * paths + path, DATA.frames[index]),
    number: (frame, survivor) => value("number", frame, survivor) ?? survivor,
    probability: (frame, survivor) => value("probability", frame, survivor),
    group: (frame, survivor) => value("groups", frame, survivor),
    margin: (frame, survivor, index) => value(`margin${index}`, frame, survivor),
    inferred: (frame, survivor, joint) => Boolean(((value("inferred", frame, survivor) ?? 0) >> joint) & 1),
    radius: (frame, survivor, joint) => (arrays.radius ? arrays.radius[(frame.first + survivor) * DATA.joints + joint] / 1000 : 0),
  };
})();

const sight = (() => {
  const canvas = document.getElementById("picture");
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const along = (a, t, b) => [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => a.map((value) => value / (Math.hypot(...a) || 1));
  const NEAR = 0.05, ANGLE = (28 * Math.PI) / 180, camera = DATA.camera;
  const known = (points) => points.slice(0, DATA.joints).filter((point) => point);

  // The camera follows the smoothed position of one posture per frame.
  const first = DATA.frames.map((frame, index) => (DATA.paths ? pack.path(index, 0) : frame.held ? pack.points(frame, frame.best ?? 0) : []));
  const bounds = first.map((points) => {
    const all = known(points);
    return all.length ? [0, 1, 2].map((axis) => [Math.min(...all.map((point) => point[axis])), Math.max(...all.map((point) => point[axis]))]) : null;
  });
  const spans = bounds.filter((one) => one).map((one) => Math.hypot(...one.map(([low, high]) => high - low))).sort((a, b) => a - b);
  const reach = Math.max(0.5, spans[Math.floor(0.9 * (spans.length - 1))] ?? 1);
  const middles = smooth(bounds.map((one) => one && one.map(([low, high]) => (low + high) / 2)));
  const state = { look: "free", azimuth: 0, elevation: 0.2, distance: 4, moved: [0, 0, 0] };
  let shown;

  function smooth(places) {
    const filled = [];
    let last = places.find((place) => place) ?? [0, 0, 1];
    for (const place of places) filled.push((last = place ?? last));
    const clip = (k) => DATA.frames[k].clip;
    return filled.map((_, k) => {
      const near = [];
      for (let j = Math.max(0, k - 7); j < Math.min(filled.length, k + 8); j++) if (clip(j) === clip(k)) near.push(filled[j]);
      return [0, 1, 2].map((axis) => near.reduce((sum, one) => sum + one[axis], 0) / near.length);
    });
  }

  // Bounds of the image points of all frames, on the plane at depth 1.
  const images = (() => {
    if (!camera || camera.parallel) return null;
    const flat = first.flatMap((points) => known(points).map((point) => minus(point, camera.position)).filter((from) => dot(from, camera.forward) > NEAR));
    const ends = [camera.right, camera.down].map((axis) => {
      const all = flat.map((from) => dot(from, axis) / dot(from, camera.forward)).sort((a, b) => a - b);
      return all.length ? [all[0], all.at(-1)] : [-0.5, 0.5];
    });
    return { middle: ends.map(([low, high]) => (low + high) / 2), half: ends.map(([low, high]) => Math.max(0.6 * (high - low), 1e-3)) };
  })();

  const size = () => ({ width: canvas.clientWidth || 1, height: canvas.clientHeight || 1 });

  function look(name) {
    state.look = name;
    state.moved = [0, 0, 0];
    const { width, height } = size();
    state.distance = (0.71 * reach) / Math.tan(ANGLE / 2) / Math.min(1, width / height);
    state.azimuth = (DATA.front ?? 0) + { free: 0.65, camera: 0, side: Math.PI / 2, above: 0 }[name];
    state.elevation = { free: 0.26, camera: 0, side: 0.06, above: 1.5 }[name];
  }

  // Axes of the virtual camera for this frame.
  function prepare(index) {
    const { width, height } = size(), x = width / 2, y = height / 2 + Math.min(0.06 * height, 34); // buttons are above
    if (state.look === "camera" && camera) {
      const { position: eye, forward, right, down } = camera, up = down.map((value) => -value);
      if (camera.parallel) return (shown = { parallel: true, eye: along(middles[index], -50, forward), right, up, forward, focal: Math.min(width, height) / (1.25 * reach), x, y });
      const focal = 0.85 * Math.min(width / (2 * images.half[0]), height / (2 * images.half[1])), [u, v] = images.middle;
      return (shown = { parallel: false, eye, right, up, forward, focal, x: x - focal * u, y: y - focal * v });
    }
    const target = along(middles[index], 1, state.moved), level = Math.cos(state.elevation);
    const towards = [Math.cos(state.azimuth) * level, Math.sin(state.azimuth) * level, Math.sin(state.elevation)];
    const ahead = towards.map((value) => -value), across = unit(cross(ahead, [0, 0, 1]));
    return (shown = { parallel: false, eye: along(target, state.distance, towards), right: across, up: cross(across, ahead), forward: ahead, focal: height / 2 / Math.tan(ANGLE / 2), x, y });
  }

  function project(point) {
    const from = minus(point, shown.eye), depth = dot(from, shown.forward);
    if (depth < NEAR) return null;
    const each = shown.parallel ? shown.focal : shown.focal / depth;
    return [shown.x + each * dot(from, shown.right), shown.y - each * dot(from, shown.up), depth, each];
  }

  // End points of a segment on the canvas, clipped at the camera plane.
  function segment(a, b) {
    const [da, db] = [a, b].map((point) => dot(minus(point, shown.eye), shown.forward)), least = NEAR * 1.01;
    if (da < least && db < least) return null;
    const cut = (p, dp, q, dq) => (dp >= least ? p : along(p, (least - dp) / (dq - dp), minus(q, p)));
    return [project(cut(a, da, b, db)), project(cut(b, db, a, da))];
  }

  function free() {
    if (state.look === "camera" && camera) state.elevation = Math.asin(Math.max(-1, Math.min(1, -camera.forward[2])));
    state.look = "";
  }
  function turn(right, up) {
    free();
    state.azimuth -= right;
    state.elevation = Math.max(-1.5, Math.min(1.5, state.elevation + up));
  }
  function move(x, y) {
    const each = shown.parallel ? shown.focal : shown.focal / state.distance;
    free();
    state.moved = along(along(state.moved, -x / each, shown.right), y / each, shown.up);
  }
  function zoom(factor) {
    free();
    state.distance = Math.max(0.3, Math.min(100, state.distance * factor));
  }

  return { state, look, prepare, project, segment, turn, move, zoom, size, middle: (index) => middles[index], reach, vectors: { dot, minus, along, cross, unit } };
})();
