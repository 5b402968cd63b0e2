// The slider over s of an uncalibrated picture. It runs over the angle at which the segment that sets the bound leans
// out of the image plane, s = bound / cos(angle): from the bound to infinity, and nothing jumps near the bound.
"use strict";
const scale = (() => {
  const byId = (id) => document.getElementById(id), slider = byId("scale");
  const WIDE = 400, HIGH = 46, FARTHEST = 80, LAST = 89.9;
  const degrees = (angle) => (angle * 180) / Math.PI;
  const words = (segment) => segment.replaceAll("_", " ").replaceAll("-", " – ");
  const pixels = (s) => `${Number(s.toPrecision(s >= 1000 ? 5 : 4)).toLocaleString("en")} px/m`;
  const angleOf = (family, s) => degrees(Math.acos(Math.min(1, family.bound / s)));
  let lastFrame;

  function element(tag, attributes, text) {
    const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    if (text) {
      const title = document.createElementNS("http://www.w3.org/2000/svg", "title");
      title.textContent = text;
      made.append(title);
    }
    return made;
  }

  // As far as marks are, or 80 degrees: almost six times the bound.
  function farthest(family) {
    const marks = [...family.scales, ...family.minima.map((one) => one[0])].map((s) => angleOf(family, s) + 2);
    return Math.min(LAST, Math.max(FARTHEST, ...marks));
  }

  const shownSurvivor = () => Math.max(page.state.survivor, 0); // a path may have none in a frame
  const recoveredScale = () => lift.scaleOf(page.frame().family, shownSurvivor());
  const now = () => page.state.scale ?? recoveredScale();
  const elsewhere = () => page.state.scale !== null && Math.abs(page.state.scale / recoveredScale() - 1) > 1e-9;

  function choose(s) {
    const { family } = page.frame();
    page.chooseScale(s === null || !family ? null : Math.max(s, family.bound));
  }

  // The curve's residual at s, between its samples; infinite beyond them.
  function envelope(curve, s) {
    const k = curve.findIndex((one) => one[0] >= s), [after, before] = [curve[k], curve[k - 1]];
    if (!after || (!before && after[0] > s)) return Infinity;
    return before ? before[1] + ((s - before[0]) / (after[0] - before[0])) * (after[1] - before[1]) : after[1];
  }

  // Marks of the bound, the recovered scales and the minima, and the curve of the residual, the least over all flips.
  function drawMarks(family) {
    const drawing = byId("scale-marks"), top = farthest(family), place = (s) => (angleOf(family, s) / top) * WIDE;
    drawing.replaceChildren();
    drawing.classList.toggle("low", family.curve.length < 2 && !family.minima.length);
    // Minima of the least are its corners; others belong to flips that are worse there.
    const lowest = family.minima.filter(([s, residual]) => residual <= envelope(family.curve, s));
    const curve = [...family.curve, ...lowest].sort((a, b) => a[0] - b[0]).filter(([s]) => angleOf(family, s) <= top);
    const most = Math.max(...[...curve, ...family.minima].map((one) => one[1]), 1e-12);
    // The square root shows how sharp minima are that end at zero.
    const height = (residual) => HIGH - 4 - Math.sqrt(residual / most) * (HIGH - 8);
    const line = (s, name, low, high, text) => {
      const x = place(s);
      drawing.append(element("line", { x1: x, x2: x, y1: low, y2: high, class: name }, text));
    };
    if (curve.length > 1) {
      const points = curve.map(([s, residual]) => `${place(s)},${height(residual)}`);
      drawing.append(element("polyline", { points: points.join(" "), class: "curve" }, `residual of ${family.how}, at most ${most.toPrecision(2)}`));
    }
    line(family.bound, "bound", 0, HIGH, `bound: ${pixels(family.bound)}`);
    for (const s of family.scales) line(s, "chosen", 0, HIGH, `recovered at ${pixels(s)}`);
    for (const [s, residual] of family.minima) line(s, "minimum", height(residual) - 4, height(residual) + 4, `minimum: ${pixels(s)}, residual ${residual.toPrecision(2)}`);
    const listed = family.minima.slice(0, 8).map(([s]) => pixels(s)).join(", ");
    drawing.setAttribute("aria-label", `bound ${pixels(family.bound)}, recovered at ${family.scales.map(pixels).join(", ")}` + (listed ? `, minima of ${family.how} at ${listed}` : ""));
  }

  function drawButtons(family) {
    const row = byId("scale-minima");
    row.replaceChildren();
    family.minima.slice(0, 6).forEach(([s], index) => {
      const made = document.createElement("button");
      made.type = "button";
      made.textContent = pixels(s).replace(" px/m", "");
      made.setAttribute("aria-label", `minimum ${index + 1}: ${pixels(s)}`);
      made.onclick = () => choose(s);
      row.append(made);
    });
    byId("scale-minima-box").hidden = !family.minima.length;
  }

  function nodeOf(name) {
    const point = DATA.points.indexOf(name), middle = DATA.tree.middles.findIndex((one) => one[0] === name);
    return point >= 0 ? point : middle >= 0 ? DATA.points.length + middle : -1;
  }

  const apart = (a, b) => (a && b ? Math.hypot(...a.map((value, k) => value - b[k])) : NaN);

  function extent(all) {
    const depths = all.slice(0, DATA.joints).filter((point) => point).map((point) => point[2]);
    return Math.max(...depths) - Math.min(...depths);
  }

  // By how much distances change that the tree does not lift, inside torso and hips: they fit at the true scale alone.
  function broken(all, old) {
    const lifted = new Set(DATA.tree.steps.map(([a, b]) => `${Math.min(a, b)}-${Math.max(a, b)}`));
    if (!lifted.has("0-3")) return 0; // Taylor's tree has none
    const changes = DATA.segments.filter(([a, b]) => !lifted.has(`${Math.min(a, b)}-${Math.max(a, b)}`)).map(([a, b]) => Math.abs(apart(all[a], all[b]) - apart(old[a], old[b])));
    return Math.max(0, ...changes.filter((change) => !Number.isNaN(change)));
  }

  function describe(family) {
    const s = now(), all = lift.posture(page.frame(), shownSurvivor(), s), old = lift.recovered(page.frame(), shownSurvivor());
    slider.value = angleOf(family, s);
    slider.setAttribute("aria-valuetext", pixels(s).replace("px/m", "pixels a metre"));
    byId("scale-text").textContent = `${pixels(s)}, ${(s / family.bound).toFixed(3)} × the bound`;
    const said = [`${words(family.segment)} sets the bound, ${pixels(family.bound)}`];
    const [a, b] = family.segment.split("-").map(nodeOf), length = apart(all[a], all[b]);
    const lean = degrees(Math.asin(Math.min(1, Math.abs(all[a]?.[2] - all[b]?.[2]) / length)));
    const isLifted = DATA.tree.steps.some(([c, p]) => (c === a && p === b) || (c === b && p === a)) || a >= DATA.points.length || DATA.tree.root !== 0;
    if (!isLifted) said[0] += " (its ends are lifted from other joints)";
    if (!Number.isNaN(lean)) said[0] += lean < 0.05 ? "; here it lies in the image plane" : `; here it leans ${lean.toFixed(1)}° out of the image plane`;
    const deep = extent(all), was = extent(old);
    said.push(`From the nearest joint to the farthest ${deep.toFixed(2)} m` + (elsewhere() ? `, recovered ${was.toFixed(2)} m` : ""));
    const off = broken(all, old);
    if (elsewhere() && off > 5e-4) said.push(`Distances inside torso and hips are off by up to ${(100 * off).toFixed(1)} cm`);
    byId("scale-note").textContent = `${said.join(". ")}.`;
    byId("scale-back").disabled = !elsewhere();
  }

  function show() {
    const { family } = page.frame();
    byId("family").hidden = !family;
    if (!family) return;
    if (lastFrame !== page.frame()) {
      lastFrame = page.frame();
      slider.max = farthest(family);
      drawMarks(family);
      drawButtons(family);
    }
    describe(family);
  }

  slider.oninput = () => choose(page.frame().family.bound / Math.cos((Number(slider.value) * Math.PI) / 180));
  byId("scale-back").onclick = () => choose(null);
  byId("scale-bound").onclick = () => choose(page.frame().family.bound);
  page.onChange(show);
  show();

  return { choose, now, elsewhere };
})();
