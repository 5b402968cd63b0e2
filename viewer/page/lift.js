// Lifts the chosen posture at another scale (Taylor 2000, eq. 1 and 2): x = u / s, y = v / s, and along each segment of
// the tree dZ = sqrt(l^2 - d^2 / s^2), nearer or farther as the posture has it.
"use strict";
const lift = (() => {
  const axes = [DATA.camera.right, DATA.camera.down, DATA.camera.forward];
  const minus = (a, b) => a.map((value, k) => value - b[k]);
  const along = (a, t, b) => a.map((value, k) => value + t * b[k]);
  const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);
  const cross = (a, b) => [0, 1, 2].map((k) => a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]);
  const size = (a) => Math.sqrt(dot(a, a));
  const middle = (a, b) => (a && b ? along(a, 1, b).map((value) => value / 2) : null);

  // The posture as it was recovered, camera axes, metres from the middle of the image; with the girdles' middles.
  function recovered(frame, survivor) {
    const { anchor } = frame.family;
    const found = pack.points(frame, survivor).map((point) => {
      const from = point && minus(point, anchor);
      return from && axes.map((axis) => dot(from, axis));
    });
    for (const [, a, b] of DATA.tree.middles) found.push(middle(found[a], found[b]));
    return found;
  }

  function seen(family, node) {
    if (node < DATA.joints) return family.image[node];
    const [, a, b] = DATA.tree.middles[node - DATA.points.length];
    return middle(family.image[a], family.image[b]);
  }

  // Where a step's child goes from its parent, at p.
  function end(family, step, choice, s, old, placed) {
    const [child, parent, other] = DATA.tree.steps[step], p = placed[parent];
    const at = seen(family, child)?.map((value) => value / s);
    if (!p) return null;
    if (other >= 0 && choice !== "r") return along(along(p, 1, p), -1, placed[other]);
    if (choice === "r") {
      if (!old[child] || !old[parent]) return null;
      const moved = along(p, 1, minus(old[child], old[parent]));
      return at ? [...at, moved[2]] : moved;
    }
    const apart = Math.hypot(at[0] - p[0], at[1] - p[1]), length = family.lengths[step];
    const deep = Math.sqrt(Math.max((length - apart) * (length + apart), 0));
    return [...at, p[2] + (choice === "1" ? deep : -deep)];
  }

  // The axes of the torso: down the spine, from the right shoulder to the left, and forward.
  function torso(all) {
    const [right, left] = [all[1], all[2]], hips = DATA.tree.steps.some((step) => step[0] === 3) ? all[3] : all[DATA.points.length + 1];
    const top = middle(right, left);
    if (!top || !hips) return null;
    const down = minus(hips, top), across = minus(left, right), y = down.map((value) => value / size(down));
    const level = along(across, -dot(across, y), y), x = level.map((value) => value / size(level));
    return size(down) > 1e-6 && size(level) > 1e-6 ? { top, axes: [x, y, cross(x, y)] } : null;
  }

  // All points at scale s, camera axes, metres from the middle of the image; null where unknown.
  function posture(frame, survivor, s, signs = frame.family.signs[survivor]) {
    const { family } = frame, old = recovered(frame, survivor), placed = [];
    const root = DATA.tree.root;
    placed[root] = [...family.image[root].map((value) => value / s), family.roots[survivor]];
    [...signs].forEach((choice, step) => {
      placed[DATA.tree.steps[step][0]] = end(family, step, choice, s, old, placed);
    });
    return followed(old, placed);
  }

  // The posture at its own scale, with some segments turned the other way: the depth along them changes its sign.
  function flipped(frame, survivor, signs) {
    const { family } = frame, old = recovered(frame, survivor), placed = [];
    placed[DATA.tree.root] = old[DATA.tree.root];
    DATA.tree.steps.forEach(([child, parent], step) => {
      const from = old[child] && old[parent] && minus(old[child], old[parent]);
      if (from && signs[step] !== family.signs[survivor][step]) from[2] = -from[2];
      placed[child] = from && placed[parent] ? along(placed[parent], 1, from) : null;
    });
    return followed(old, placed);
  }

  // The head, and joints that are no part of the tree, follow the torso.
  function followed(old, placed) {
    const [before, now] = [torso(old), torso(placed)];
    return old.map((point, node) => {
      if (placed[node] !== undefined) return placed[node];
      if (!point || !before || !now) return null;
      const from = minus(point, before.top);
      return before.axes.reduce((sum, axis, k) => along(sum, dot(from, axis), now.axes[k]), now.top);
    });
  }

  // The same in the page's world, without the middles.
  function world(frame, survivor, s, signs) {
    const { anchor } = frame.family;
    const place = (point) => point && axes.reduce((sum, axis, k) => along(sum, point[k], axis), anchor);
    return (s === null ? flipped(frame, survivor, signs) : posture(frame, survivor, s, signs)).slice(0, DATA.points.length).map(place);
  }

  return { posture, recovered, world, scaleOf: (family, survivor) => family.scales[family.at[survivor]] };
})();
