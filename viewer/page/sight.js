// Where one looks from, and where a point of the world falls in the picture: x, y, depth, and pixels a metre there.
"use strict";
const sight = (() => {
  const canvas = document.getElementById("picture");
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const along = (a, t, b) => [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => a.map((value) => value / (Math.hypot(...a) || 1));
  const NEAR = 0.05, ANGLE = (28 * Math.PI) / 180;
  const { position: eye, forward, right, down, parallel } = DATA.camera;
  const back = unit([-forward[0], -forward[1], 0]), level = Math.hypot(forward[0], forward[1]) > 1e-6;
  const toCamera = level ? Math.atan2(back[1], back[0]) : Math.PI;

  // The likeliest posture of each frame says where the body is; its place is smoothed, so that the eye is calm.
  const known = (points) => points.slice(0, DATA.joints).filter((point) => point);
  const first = DATA.frames.map((frame, index) => (DATA.paths ? pack.path(index, 0) : frame.held ? pack.points(frame, 0) : []));
  const bounds = first.map((points) => {
    const all = known(points);
    if (!all.length) return null;
    return [0, 1, 2].map((axis) => [Math.min(...all.map((point) => point[axis])), Math.max(...all.map((point) => point[axis]))]);
  });
  const whole = bounds.filter((one) => one);
  const middles = smooth(bounds.map((one) => one && one.map(([low, high]) => (low + high) / 2)));
  const spans = whole.map((one) => Math.hypot(...one.map(([low, high]) => high - low))).sort((a, b) => a - b);
  const reach = Math.max(0.5, spans[Math.floor(0.9 * (spans.length - 1))] ?? 1);
  const state = { look: "free", azimuth: 0, elevation: 0.2, distance: 4, target: [0, 0, 1], moved: [0, 0, 0] };
  let shown;

  function smooth(places) {
    const filled = [];
    let last = places.find((place) => place) ?? [0, 0, 1];
    for (const place of places) filled.push((last = place ?? last));
    return filled.map((_, k) => {
      const near = filled.slice(Math.max(0, k - 7), k + 8);
      return [0, 1, 2].map((axis) => near.reduce((sum, one) => sum + one[axis], 0) / near.length);
    });
  }

  const size = () => ({ width: canvas.clientWidth || 1, height: canvas.clientHeight || 1 });

  function look(name) {
    state.look = name;
    state.moved = [0, 0, 0];
    const { width, height } = size();
    state.distance = (0.71 * reach) / Math.tan(ANGLE / 2) / Math.min(1, width / height);
    const turn = { free: 0.75, camera: 0, side: Math.PI / 2, above: 0 }[name];
    state.azimuth = toCamera + turn;
    state.elevation = { free: 0.26, camera: 0, side: 0.06, above: 1.5 }[name];
    if (name === "camera" && parallel && !page.frame().family) state.look = "side";
  }

  // The axes of the picture, for this frame.
  function prepare(index) {
    const { width, height } = size(), centre = { x: width / 2, y: height / 2 + Math.min(0.06 * height, 34) }; // buttons are above
    if (state.look === "camera" && parallel && page.frame().family) return (shown = alongTheRays(width, height));
    if (state.look === "camera" && DATA.kind === "result" && !parallel) {
      const focal = 0.94 * Math.min(width / (2 * images.half[0]), height / (2 * images.half[1]));
      const shift = images.middle;
      return (shown = { parallel: false, eye, right, up: down.map((value) => -value), forward, focal, x: width / 2 - focal * shift[0], y: height / 2 - focal * shift[1] });
    }
    const target = along(along(middles[index], 1, state.moved), 1, [0, 0, 0]);
    const towards = [Math.cos(state.azimuth) * Math.cos(state.elevation), Math.sin(state.azimuth) * Math.cos(state.elevation), Math.sin(state.elevation)];
    const ahead = towards.map((value) => -value), across = unit(cross(ahead, [0, 0, 1]));
    const focal = height / 2 / Math.tan(ANGLE / 2);
    return (shown = { parallel: false, eye: along(target, state.distance, towards), right: across, up: cross(across, ahead), forward: ahead, focal, ...centre });
  }

  // Where the images of all frames are, on a plane at depth one.
  const images = (() => {
    const flat = first.flatMap((points) => known(points).map((point) => minus(point, eye)).filter((from) => dot(from, forward) > NEAR));
    const [us, vs] = [right, down].map((axis) => flat.map((from) => dot(from, axis) / dot(from, forward)).sort((a, b) => a - b));
    if (!us.length) return { middle: [0, 0], half: [0.5, 0.5] };
    const ends = [us, vs].map((all) => [all[0], all.at(-1)]);
    return { middle: ends.map(([low, high]) => (low + high) / 2), half: ends.map(([low, high]) => Math.max(0.6 * (high - low), 1e-3)) };
  })();

  // Looks with the uncalibrated camera: the images of all frames fill the picture, at whatever scale is chosen.
  const pixels = (() => {
    const all = DATA.frames.flatMap(({ family }) => (family ? family.image.flatMap((point) => (point ? [[point[0] + family.middle[0], point[1] + family.middle[1]]] : [])) : []));
    const ends = [0, 1].map((axis) => [Math.min(...all.map((point) => point[axis])), Math.max(...all.map((point) => point[axis]))]);
    return { middle: ends.map(([low, high]) => (low + high) / 2), half: ends.map(([low, high]) => Math.max(0.62 * (high - low), 1)) };
  })();

  function alongTheRays(width, height) {
    const { family } = page.frame(), s = scale.now();
    let target = family.anchor;
    [right, down].forEach((axis, k) => (target = along(target, (pixels.middle[k] - family.middle[k]) / s, axis)));
    const focal = s * Math.min(width / (2 * pixels.half[0]), height / (2 * pixels.half[1]));
    return { parallel: true, eye: along(target, -50, forward), right, up: down.map((value) => -value), forward, focal, x: width / 2, y: height / 2 };
  }

  function project(point) {
    const from = minus(point, shown.eye), depth = dot(from, shown.forward);
    if (depth < NEAR) return null;
    const each = shown.parallel ? shown.focal : shown.focal / depth;
    return [shown.x + each * dot(from, shown.right), shown.y - each * dot(from, shown.up), depth, each];
  }

  // The ends of a segment in the picture, cut where it goes behind the eye.
  function segment(a, b) {
    const [da, db] = [a, b].map((point) => dot(minus(point, shown.eye), shown.forward));
    const least = NEAR * 1.01;
    if (da < least && db < least) return null;
    const cut = (p, dp, q, dq) => (dp >= least ? p : along(p, (least - dp) / (dq - dp), minus(q, p)));
    return [project(cut(a, da, b, db)), project(cut(b, db, a, da))];
  }

  const free = () => {
    if (state.look === "camera") state.elevation = Math.asin(Math.max(-1, Math.min(1, -forward[2])));
    state.look = "";
  };
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

  return { state, look, prepare, project, segment, turn, move, zoom, size, middle: (index) => middles[index], reach, back, toCamera, vectors: { dot, minus, along, cross, unit } };
})();
