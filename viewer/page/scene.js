// 3D view of the page, drawn on a 2D canvas: the selected posture as a body, and other selected objects. A figure of a
// dozen capsules needs no WebGL; a 2D canvas is fast even without a graphics card.
"use strict";
const scene = (() => {
  const canvas = document.getElementById("picture");
  // An opaque canvas in main memory is several times faster without a graphics card.
  const pen = canvas.getContext("2d", { alpha: false, willReadFrequently: true });
  const { dot, minus, along, cross, unit } = sight.vectors;
  const IMAGE_DEPTH = 0.6, MOST_OTHERS = 400, FINGER = 16, camera = DATA.camera;
  const people = DATA.kind === "postures";
  const shownNow = { bodies: true, others: people, rays: false, truth: false };
  const css = (colour, alpha = 1) => `rgba(${colour >> 16},${(colour >> 8) & 255},${colour & 255},${alpha})`;
  const mixed = (colour, other, t) => [16, 8, 0].reduce((sum, bit) => sum | (Math.round(((colour >> bit) & 255) * (1 - t) + ((other >> bit) & 255) * t) << bit), 0);
  const shades = Object.fromEntries(Object.entries(DATA.colours ?? {}).map(([side, colour]) => [side, { light: mixed(colour, 0xffffff, 0.5), plain: colour, dark: mixed(colour, 0x10202c, 0.42) }]));
  let chosenNow = null, places = [];

  function chosen() {
    const { survivor, path, frame } = page.state;
    if (path !== null) return pack.path(frame, path);
    return survivor >= 0 && survivor < page.frame().held ? pack.points(page.frame(), survivor) : null;
  }

  function mean(all, indices) {
    const some = indices.map((index) => all[index]);
    return some.some((point) => !point) ? null : [0, 1, 2].map((axis) => some.reduce((sum, point) => sum + point[axis], 0) / some.length);
  }

  // Outline of a capsule: the convex hull of two circles.
  function outline([ax, ay, , , ra], [bx, by, , , rb]) {
    const length = Math.hypot(bx - ax, by - ay), path = new Path2D();
    if (length <= Math.abs(ra - rb) + 1e-6) {
      path.arc(...(ra > rb ? [ax, ay, ra] : [bx, by, rb]), 0, 2 * Math.PI);
      return path;
    }
    const turn = Math.atan2(by - ay, bx - ax), open = Math.acos((ra - rb) / length);
    path.arc(ax, ay, ra, turn + open, turn - open);
    path.arc(bx, by, rb, turn - open, turn + open);
    path.closePath();
    return path;
  }

  function drawCapsule({ from, to, side, guessed }) {
    const path = outline(from, to), shade = shades[side], wide = Math.max(from[4], to[4]);
    if (guessed) {
      pen.fillStyle = css(shade.plain, 0.16);
      pen.setLineDash([5, 4]);
      pen.strokeStyle = css(shade.dark, 0.8);
    } else {
      const [x, y] = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2];
      let [nx, ny] = unit([from[1] - to[1], to[0] - from[0], 0]);
      if (nx + 1.7 * ny > 0) [nx, ny] = [-nx, -ny]; // light comes from above, and a little from the left
      if (!nx && !ny) [nx, ny] = [-0.5, -0.86];
      const light = pen.createLinearGradient(x + wide * nx, y + wide * ny, x - wide * nx, y - wide * ny);
      light.addColorStop(0, css(shade.light));
      light.addColorStop(0.45, css(shade.plain));
      light.addColorStop(1, css(shade.dark));
      pen.fillStyle = light;
      pen.strokeStyle = css(shade.dark, 0.7);
    }
    pen.lineWidth = 1;
    pen.fill(path);
    pen.stroke(path);
    pen.setLineDash([]);
  }

  // If the head is unknown, an outline is drawn above the neck, because a figure without a head is hard to recognise.
  function withHead(all) {
    const [neck, pelvis] = [all[0], all[3]], head = all.slice(DATA.joints);
    if (!DATA.figure || !neck || !pelvis || head.every((point) => point)) return { all, made: false };
    const top = along(neck, 0.17, unit(minus(neck, pelvis)));
    return { all: [...all.slice(0, DATA.joints), ...head.map(() => top)], made: true };
  }

  function capsulesOf(given, unseen) {
    const found = [], { all, made } = withHead(given);
    for (const capsule of DATA.capsules) {
      const [start, end] = [mean(all, capsule.start), mean(all, capsule.end)];
      if (!start || !end) continue;
      const axis = minus(end, start), ends = [-1, 1].map((way) => along(start, capsule.center + way * capsule.half, axis));
      const [from, to] = ends.map(sight.project);
      if (!from || !to) continue;
      [from, to].forEach((place) => place.push(place[3] * capsule.radius));
      const guessed = [...capsule.start, ...capsule.end].some((index) => unseen(index) || (made && index >= DATA.joints));
      found.push({ from, to, ends, side: capsule.side, radius: capsule.radius, guessed, depth: (from[2] + to[2]) / 2 });
    }
    return found.sort((a, b) => b.depth - a.depth);
  }

  function polyline(ends, colour, width, dash = []) {
    pen.beginPath();
    for (const [a, b] of ends) {
      const cut = sight.segment(a, b);
      if (!cut) continue;
      pen.moveTo(cut[0][0], cut[0][1]);
      pen.lineTo(cut[1][0], cut[1][1]);
    }
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.setLineDash(dash);
    pen.stroke();
    pen.setLineDash([]);
  }

  const stick = (all, side) => DATA.segments.flatMap(([a, b, of]) => (all[a] && all[b] && (!side || of === side) ? [[all[a], all[b]]] : []));

  function drawGround(index) {
    if (sight.state.elevation < -0.02 || (camera?.parallel && sight.state.look === "camera")) return;
    const [x, y] = sight.middle(index).map((value) => Math.round(value * 2) / 2), wide = 3;
    for (let k = -2 * wide; k <= 2 * wide; k++) {
      const fade = 0.34 * (1 - Math.abs(k) / (2 * wide + 1)), reach = Math.sqrt(Math.max(0, wide * wide - (k * k) / 4));
      polyline([[[x + k / 2, y - reach, 0], [x + k / 2, y + reach, 0]], [[x - reach, y + k / 2, 0], [x + reach, y + k / 2, 0]]], `rgba(96,112,128,${fade})`, 1);
    }
    if (!camera || sight.state.look === "camera") return;
    // An arrow on the ground shows where the camera is.
    const [cx, cy] = sight.middle(index), towards = unit([-camera.forward[0], -camera.forward[1], 0]), side = [-towards[1], towards[0], 0];
    const foot = along([cx, cy, 0], 0.45 * sight.reach, towards);
    const corners = [along(foot, 0.22, towards), along(foot, 0.1, side), along(foot, -0.1, side)].map(sight.project);
    if (corners.some((corner) => !corner)) return;
    pen.beginPath();
    corners.forEach(([px, py], k) => (k ? pen.lineTo(px, py) : pen.moveTo(px, py)));
    pen.fillStyle = "rgba(60,74,88,.75)";
    pen.fill();
    pen.font = "12px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.fillText("camera", corners[0][0], Math.max(...corners.map((corner) => corner[1])) + 15);
  }

  function drawShadow(parts) {
    if (sight.state.elevation < -0.02 || sight.state.look === "camera") return;
    pen.beginPath();
    let wide = 4;
    for (const { ends, radius } of parts) {
      const cut = sight.segment(...ends.map(([x, y]) => [x, y, 0]));
      if (!cut) continue;
      wide = Math.max(wide, 1.1 * radius * cut[0][3]);
      pen.moveTo(cut[0][0], cut[0][1]);
      pen.lineTo(cut[1][0] + 0.01, cut[1][1]);
    }
    pen.lineCap = "round";
    pen.lineWidth = Math.min(wide, 60);
    pen.strokeStyle = "rgba(40,52,64,.13)";
    pen.stroke();
    pen.lineCap = "butt";
  }

  function drawBody(all) {
    const unseen = page.unseen, parts = capsulesOf(all, unseen);
    drawShadow(parts);
    if (shownNow.bodies) {
      if (DATA.figure) polyline(stick(all, "middle"), css(shades.middle.dark, 0.75), Math.max(2, 0.014 * (parts[0]?.from[3] ?? 0)));
      parts.forEach(drawCapsule);
    } else for (const side of ["middle", "right", "left"]) polyline(stick(all, side), css(DATA.colours[side]), 5);
    places = all.map((point) => point && sight.project(point));
    places.forEach((place, joint) => {
      if (!place || !DATA.figure) return;
      const shade = shades[DATA.pointSides[joint]], own = joint < DATA.joints;
      pen.beginPath();
      pen.arc(place[0], place[1], Math.max(own ? 2.5 : 1.2, place[3] * (own ? 0.017 : 0.008)), 0, 2 * Math.PI);
      pen.fillStyle = unseen(joint) ? "#fff" : css(shade.dark);
      pen.strokeStyle = unseen(joint) ? css(shade.dark) : "rgba(255,255,255,.85)";
      pen.lineWidth = unseen(joint) ? 2 : 1.2;
      pen.fill();
      pen.stroke();
    });
    for (const joint of new Set(page.findings().flatMap((one) => one.joints))) ring(places[joint]);
  }

  // A finding is marked by a ring and a sign, not only by colour.
  function ring(place) {
    if (!place) return;
    const radius = Math.max(9, 0.045 * place[3]);
    pen.beginPath();
    pen.arc(place[0], place[1], radius, 0, 2 * Math.PI);
    pen.strokeStyle = pen.fillStyle = css(DATA.colours.alarm);
    pen.lineWidth = 2.5;
    pen.stroke();
    pen.font = "bold 14px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.fillText("!", place[0] + radius + 5, place[1] - radius + 6);
  }

  // Other postures as lines in the colour of their group; more probable postures are more opaque.
  function drawOthers() {
    const frame = page.frame(), most = Math.min(frame.held, MOST_OTHERS), best = pack.probability(frame, 0);
    for (let index = most - 1; index >= 0; index--) {
      if (index === page.state.survivor) continue;
      const share = best ? Math.sqrt(Math.min((pack.probability(frame, index) ?? 0) / best, 1)) : 0.5;
      polyline(stick(pack.points(frame, index)), css(page.groupColour(index), 0.12 + 0.68 * share), 1.2 + 1.6 * share);
    }
  }

  // View frustum of the camera, rays to the joints, and image points on a plane in front of the camera.
  function drawRays(every) {
    const { position: eye, forward, right, down, parallel } = camera, seen = page.frame().image;
    const all = every.slice(0, DATA.joints).map((point, k) => (seen && !seen[k] ? null : point)), known = all.filter((point) => point);
    if (!known.length) return;
    const depths = known.map((point) => dot(minus(point, eye), forward));
    const depth = parallel ? Math.min(...depths) - IMAGE_DEPTH : Math.min(IMAGE_DEPTH, 0.5 * Math.min(...depths));
    const image = all.map((point) => {
      if (!point) return null;
      const from = minus(point, eye), far = dot(from, forward);
      return parallel ? along(point, depth - far, forward) : along(eye, depth / far, from);
    });
    polyline(all.flatMap((point, k) => (point ? [[parallel ? image[k] : eye, point]] : [])), "rgba(110,124,138,.55)", 1);
    for (const side of ["middle", "right", "left"]) polyline(stick(image, side), css(DATA.colours[side]), 2);
    const flat = image.filter((point) => point).map((point) => minus(point, eye));
    const [[west, east], [north, south]] = [right, down].map((axis) => flat.map((from) => dot(from, axis))).map((values) => {
      const [low, high] = [Math.min(...values), Math.max(...values)], border = 0.15 * (high - low) + 0.02;
      return [low - border, high + border];
    });
    const corner = (x, y) => along(along(along(eye, depth, forward), x, right), y, down);
    const corners = [corner(west, north), corner(east, north), corner(east, south), corner(west, south)];
    polyline(corners.flatMap((place, k) => [[place, corners[(k + 1) % 4]], ...(parallel ? [] : [[eye, place]])]), "#303030", 1.3);
  }

  function draw() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2), { width, height } = sight.size();
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const sky = pen.createLinearGradient(0, 0, 0, height);
    sky.addColorStop(0, "#f8fafb");
    sky.addColorStop(1, "#e3e8ed");
    pen.fillStyle = sky;
    pen.fillRect(0, 0, width, height);
    const index = page.state.frame;
    sight.prepare(index);
    drawGround(index);
    chosenNow = chosen();
    places = [];
    const truth = shownNow.truth && pack.truth(index);
    if (shownNow.others) drawOthers();
    if (shownNow.rays && camera && chosenNow) drawRays(chosenNow);
    if (chosenNow) drawBody(chosenNow);
    if (truth) polyline(stick(truth), "#111", 2.2, [7, 4]);
    scene.pictures += 1;
  }

  // Draw once per screen refresh, after all changes.
  let waiting = false;
  function soon() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      draw();
    });
  }

  const press = () => document.querySelectorAll("#looks button").forEach((button) => button.setAttribute("aria-pressed", button.dataset.look === sight.state.look));

  function look(name) {
    sight.look(name);
    press();
    draw();
  }

  function show(name, on) {
    const box = document.querySelector(`[data-show=${name}]`);
    if (box.closest("label").hidden) return;
    box.checked = on ?? !box.checked;
    shownNow[name] = box.checked;
    draw();
  }

  function jointAt(x, y) {
    let best = null, least = FINGER;
    places.forEach((place, joint) => {
      const away = place && joint < DATA.joints ? Math.hypot(place[0] - x, place[1] - y) : Infinity;
      if (away < least) [best, least] = [joint, away];
    });
    return best;
  }

  function turned(change) {
    change();
    press();
    soon();
  }

  function tell(joint, x, y) {
    const tip = document.getElementById("tip");
    tip.hidden = joint === null;
    if (joint === null) return;
    tip.replaceChildren(...page.about(joint).map((line, k) => page.tools.element(k ? "div" : "strong", line)));
    tip.style.left = `${Math.max(4, Math.min(x + 14, sight.size().width - tip.offsetWidth - 8))}px`;
    tip.style.top = `${Math.max(4, y - tip.offsetHeight - 8)}px`;
  }

  const fingers = new Map();
  let apart = 0;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
    apart = 0;
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId), now = [event.offsetX, event.offsetY];
    if (!before) return tell(jointAt(...now), ...now);
    tell(null);
    fingers.set(event.pointerId, now);
    const [x, y] = [now[0] - before[0], now[1] - before[1]];
    if (fingers.size > 1) {
      const [p, q] = [...fingers.values()], wide = Math.hypot(p[0] - q[0], p[1] - q[1]);
      if (apart) turned(() => sight.zoom(apart / Math.max(wide, 1)));
      apart = wide;
    } else if (event.buttons & 2 || event.shiftKey) turned(() => sight.move(x, y));
    else turned(() => sight.turn(0.008 * x, 0.008 * y));
  });
  canvas.addEventListener("pointerleave", () => tell(null));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    turned(() => sight.zoom(Math.exp(0.0012 * event.deltaY)));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const step = 0.12, moves = {
      ArrowLeft: () => sight.turn(-step, 0), ArrowRight: () => sight.turn(step, 0), ArrowUp: () => sight.turn(0, step), ArrowDown: () => sight.turn(0, -step),
      "+": () => sight.zoom(0.88), "=": () => sight.zoom(0.88), "-": () => sight.zoom(1.14),
    };
    if (!(event.key in moves)) return;
    event.preventDefault();
    event.stopPropagation();
    turned(moves[event.key]);
  });

  for (const button of document.querySelectorAll("#looks button")) button.onclick = () => look(button.dataset.look);
  for (const box of document.querySelectorAll("#shown input")) box.onchange = () => show(box.dataset.show, box.checked);
  document.querySelector("[data-show=others]").checked = people;
  if (FIGURED) {
    sight.look("free");
    press();
    new ResizeObserver(() => {
      if (sight.state.look) sight.look(sight.state.look);
      draw();
    }).observe(canvas);
    page.onChange(soon);
  }

  return {
    look, show, draw, pictures: 0,
    // Positions of the displayed joints on the canvas, pixels; for tests and for the console.
    places: () => { draw(); return places.slice(0, DATA.joints).map((place) => place && place.slice(0, 2)); },
    points: () => chosen(),
  };
})();
