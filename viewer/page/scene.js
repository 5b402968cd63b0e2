// The page's scene: the chosen survivor's body is moved, not made again; positions are whole steps of DATA.steps
// a metre, in a world whose z is up. It runs after meshcat's viewer was made; `page` is panel.js.
"use strict";
const scene = (() => {
  const T = MeshCat.THREE;
  const UP = new T.Vector3(0, 1, 0);
  const JOINT_RADIUS = 0.03, BONE_RADIUS = 0.009, IMAGE_DEPTH = 0.6, SOLID = 0.55, HOLLOW = 0.32, FADED = 0.2, FAR = 50;
  const shownNow = { bodies: true, others: false, rays: false, truth: false };
  const ball = new T.SphereGeometry(1, 24, 16), dome = new T.SphereGeometry(1, 24, 8, 0, 2 * Math.PI, 0, Math.PI / 2), tube = new T.CylinderGeometry(1, 1, 1, 20, 1, true);
  const layers = {};
  for (const name of ["bodies", "joints", "regions", "others", "rays", "truth"]) {
    layers[name] = new T.Group();
    viewer.set_object(["posekit", name], layers[name]);
  }
  const eye = new T.Vector3(...DATA.camera.position), forward = new T.Vector3(...DATA.camera.forward);
  const right = new T.Vector3(...DATA.camera.right), down = new T.Vector3(...DATA.camera.down), axes = [right, down, forward];
  const perspective = viewer.camera, parallel = new T.OrthographicCamera(-1, 1, 1, -1, 0.1, 200);
  let following = false; // the parallel camera shows the image at the same place, whatever the scale

  function points(row) {
    const found = [];
    for (let k = 0; k < row.length; k += 3) {
      found.push(row[k] === null ? null : new T.Vector3(row[k], row[k + 1], row[k + 2]).divideScalar(DATA.steps));
    }
    return found;
  }

  // The chosen survivor: as it was recovered, or at the slider's scale.
  function chosen() {
    const frame = page.frame(), { survivor, scale: s } = page.state, row = frame.points[survivor];
    if (!row) return null;
    if (s === null || !frame.family) return points(row);
    return lift.world(frame, survivor, s).map((point) => point && new T.Vector3(...point));
  }

  const material = (colour, options) => new T.MeshLambertMaterial({ color: colour, ...options });

  // A tube from a to b: made once, laid anew for every posture.
  function lay(mesh, a, b, radius) {
    mesh.visible = a !== null && b !== null;
    if (!mesh.visible) return;
    const axis = b.clone().sub(a), length = axis.length();
    mesh.position.copy(a).addScaledVector(axis, 0.5);
    mesh.scale.set(radius, Math.max(length, 1e-6), radius);
    if (length > 0) mesh.quaternion.setFromUnitVectors(UP, axis.divideScalar(length));
  }

  function mean(all, indices) {
    const chosen = indices.map((index) => all[index]);
    if (chosen.some((point) => !point)) return null;
    return chosen.reduce((sum, point) => sum.add(point), new T.Vector3()).divideScalar(chosen.length);
  }

  const capsules = DATA.capsules.map((capsule) => {
    const skin = material(DATA.colours[capsule.side], { transparent: true, opacity: SOLID, depthWrite: false });
    const parts = [new T.Mesh(tube, skin), new T.Mesh(dome, skin), new T.Mesh(dome, skin)];
    layers.bodies.add(...parts);
    return { ...capsule, parts };
  });
  const joints = DATA.points.map((name, index) => {
    const mesh = new T.Mesh(ball, material(DATA.colours[DATA.pointSides[index]]));
    mesh.scale.setScalar(index < DATA.joints ? JOINT_RADIUS : 0.4 * JOINT_RADIUS);
    mesh.name = name;
    layers.joints.add(mesh);
    return mesh;
  });
  const bones = DATA.segments.map(([, , side]) => {
    const mesh = new T.Mesh(tube, material(DATA.colours[side]));
    layers.joints.add(mesh);
    return mesh;
  });

  // What follows from a joint that was not seen is hollow.
  function hollow(mesh, unseen) {
    if (mesh.material.transparent === unseen) return;
    mesh.material.transparent = unseen;
    mesh.material.opacity = unseen ? HOLLOW : 1;
    mesh.material.depthWrite = !unseen;
    mesh.material.needsUpdate = true;
  }

  function drawBody(all) {
    const unseen = page.frame().inferred?.[page.state.survivor] ?? {};
    joints.forEach((mesh, index) => {
      mesh.visible = Boolean(all?.[index]);
      if (mesh.visible) mesh.position.copy(all[index]);
      hollow(mesh, index in unseen);
    });
    bones.forEach((mesh, index) => {
      const [a, b] = DATA.segments[index];
      lay(mesh, all?.[a] ?? null, all?.[b] ?? null, BONE_RADIUS);
      hollow(mesh, a in unseen || b in unseen);
    });
    for (const capsule of capsules) {
      const [start, end] = all ? [mean(all, capsule.start), mean(all, capsule.end)] : [null, null];
      const known = start !== null && end !== null;
      capsule.parts.forEach((part) => (part.visible = known));
      if (!known) continue;
      const guessed = [...capsule.start, ...capsule.end].some((index) => index in unseen);
      capsule.parts[0].material.opacity = guessed ? FADED : SOLID;
      const axis = end.clone().sub(start);
      const [low, high] = [-1, 1].map((end) => start.clone().addScaledVector(axis, capsule.center + end * capsule.half));
      lay(capsule.parts[0], low, high, capsule.radius);
      [low, high].forEach((place, k) => {
        capsule.parts[1 + k].position.copy(place);
        capsule.parts[1 + k].scale.setScalar(capsule.radius);
        capsule.parts[1 + k].quaternion.setFromUnitVectors(UP, axis.clone().normalize().multiplyScalar(k ? 1 : -1));
      });
    }
  }

  function lines(layer, ends, colour, options) {
    const shape = new T.BufferGeometry().setFromPoints(ends);
    layer.add(new T.LineSegments(shape, new T.LineBasicMaterial({ color: colour, ...options })));
  }

  function clear(layer) {
    for (const made of [...layer.children]) {
      if (made.geometry !== tube) made.geometry.dispose();
      made.material.dispose();
      layer.remove(made);
    }
  }

  function stick(all) {
    return DATA.segments.flatMap(([a, b]) => (all[a] && all[b] ? [all[a], all[b]] : []));
  }

  // One mesh for the bones of all: hundreds of their own would be slow without a graphics card.
  function drawOthers() {
    clear(layers.others);
    if (!shownNow.others) return;
    const bones = page.frame().points.flatMap((row, index) => {
      const ends = index === page.state.survivor ? [] : stick(points(row));
      return ends.flatMap((end, k) => (k % 2 ? [] : [[end, ends[k + 1], page.groupColour(index)]]));
    });
    if (!bones.length) return;
    const mesh = new T.InstancedMesh(tube, new T.MeshLambertMaterial({ color: 0xffffff }), bones.length);
    const one = new T.Object3D();
    bones.forEach(([a, b, colour], k) => {
      lay(one, a, b, 0.5 * BONE_RADIUS);
      one.updateMatrix();
      mesh.setMatrixAt(k, one.matrix);
      mesh.setColorAt(k, new T.Color(colour));
    });
    mesh.frustumCulled = false;
    layers.others.add(mesh);
  }

  function drawTruth() {
    clear(layers.truth);
    const row = page.frame().truth;
    if (shownNow.truth && row) lines(layers.truth, stick(points(row)), 0x111111);
  }

  // The boxes that hold all positions of joints that were not seen, at the recovered scale.
  function drawRegions(all) {
    clear(layers.regions);
    if (!all || scale.elsewhere()) return;
    for (const [joint, one] of Object.entries(page.frame().inferred?.[page.state.survivor] ?? {})) {
      const size = one.upper.map((high, k) => high - one.lower[k]);
      if (!all[joint] || Math.max(...size) < 1e-4) continue;
      const centre = all[joint].clone();
      axes.forEach((axis, k) => centre.addScaledVector(axis, (one.upper[k] + one.lower[k]) / 2));
      const box = new T.BoxGeometry(...size.map((width) => Math.max(width, 0.003)));
      const colour = DATA.colours[DATA.pointSides[joint]];
      const faces = new T.Mesh(box, new T.MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.09, depthWrite: false }));
      const edges = new T.LineSegments(new T.EdgesGeometry(box), new T.LineBasicMaterial({ color: colour }));
      for (const made of [faces, edges]) {
        made.position.copy(centre);
        made.quaternion.setFromRotationMatrix(new T.Matrix4().makeBasis(...axes));
        made.name = DATA.points[joint];
        layers.regions.add(made);
      }
    }
  }

  // The camera's pyramid, the rays to the joints, and the image that they make on a plane in front of it.
  function drawRays(every) {
    clear(layers.rays);
    if (!shownNow.rays || !every) return;
    const { image: onPicture, inferred } = page.frame(), unseen = inferred?.[page.state.survivor] ?? {};
    const all = every.map((point, k) => (k in unseen && !onPicture?.[k] ? null : point));
    if (DATA.camera.parallel) return drawParallel(all);
    const onImage = (point) => {
      const ray = point.clone().sub(eye), depth = ray.dot(forward);
      return depth > IMAGE_DEPTH ? eye.clone().addScaledVector(ray, IMAGE_DEPTH / depth) : null;
    };
    const image = all.map((point) => point && onImage(point));
    const seen = image.filter((point) => point);
    if (!seen.length) return;
    lines(layers.rays, all.slice(0, DATA.joints).flatMap((point) => (point ? [eye, point] : [])), 0x8a949e, { transparent: true, opacity: 0.6 });
    for (const side of ["middle", "right", "left"]) {
      const ends = DATA.segments.filter((one) => one[2] === side).flatMap(([a, b]) => (image[a] && image[b] ? [image[a], image[b]] : []));
      lines(layers.rays, ends, DATA.colours[side]);
    }
    const reach = (axis) => Math.max(...seen.map((point) => Math.abs(point.clone().sub(eye).dot(axis)))) * 1.15 + 0.01;
    const corner = (x, y) => eye.clone().addScaledVector(forward, IMAGE_DEPTH).addScaledVector(right, x * reach(right)).addScaledVector(down, y * reach(down));
    const corners = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
    lines(layers.rays, corners.flatMap((place, k) => [place, corners[(k + 1) % 4], eye, place]), 0x303030);
  }

  // A camera that is infinitely far: its image hangs before the body, its rays are parallel.
  function drawParallel(all) {
    const known = all.slice(0, DATA.joints).filter((point) => point);
    if (!known.length) return;
    const depth = Math.min(...known.map((point) => point.dot(forward))) - IMAGE_DEPTH;
    const image = all.map((point) => point && point.clone().addScaledVector(forward, depth - point.dot(forward)));
    lines(layers.rays, all.slice(0, DATA.joints).flatMap((point, k) => (point ? [image[k], point] : [])), 0x8a949e, { transparent: true, opacity: 0.6 });
    for (const side of ["middle", "right", "left"]) {
      const ends = DATA.segments.filter((one) => one[2] === side).flatMap(([a, b]) => (image[a] && image[b] ? [image[a], image[b]] : []));
      lines(layers.rays, ends, DATA.colours[side]);
    }
    const reach = (axis) => known.map((point) => point.dot(axis)).reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
    const [[west, east], [north, south]] = [reach(right), reach(down)], border = 0.08;
    const corner = (x, y) => new T.Vector3().addScaledVector(forward, depth).addScaledVector(right, x).addScaledVector(down, y);
    const corners = [corner(west - border, north - border), corner(east + border, north - border), corner(east + border, south + border), corner(west - border, south + border)];
    lines(layers.rays, corners.flatMap((place, k) => [place, corners[(k + 1) % 4]]), 0x303030);
  }

  function draw() {
    const all = chosen();
    drawBody(all);
    drawRegions(all);
    drawOthers();
    drawRays(all);
    drawTruth();
    layers.bodies.visible = shownNow.bodies;
    if (following) lookAlong();
    viewer.set_dirty();
  }

  // Where all postures are, for the points of view.
  const low = new T.Vector3(Infinity, Infinity, Infinity), high = low.clone().negate();
  for (const frame of DATA.frames) {
    for (const row of frame.points) {
      for (const point of points(row)) {
        if (point) {
          low.min(point);
          high.max(point);
        }
      }
    }
  }
  const middle = low.clone().add(high).multiplyScalar(0.5), extent = Math.max(0.5, low.distanceTo(high));

  function look(name) {
    const pane = document.getElementById("meshcat-pane"), narrow = Math.min(1, pane.offsetWidth / pane.offsetHeight);
    const back = new T.Vector3(-forward.x, -forward.y, 0).normalize();
    const across = new T.Vector3(-back.y, back.x, 0);
    const along = {
      camera: back,
      side: across,
      above: back.clone().multiplyScalar(0.02).add(new T.Vector3(0, 0, 1)),
      free: back.clone().add(across).add(new T.Vector3(0, 0, 0.45)),
    }[name];
    const fov = 30, distance = (0.68 * extent) / Math.tan((fov * Math.PI) / 360) / narrow;
    following = name === "camera" && DATA.camera.parallel;
    use(following ? parallel : perspective);
    press(name);
    if (following) return lookAlong();
    let position = middle.clone().addScaledVector(along.normalize(), distance), angle = fov;
    if (name === "camera") {
      position = eye;
      angle = (2 * Math.atan((0.68 * extent) / narrow / eye.distanceTo(middle)) * 180) / Math.PI;
    }
    posekit.look({ position: position.toArray(), target: middle.toArray(), fov: angle });
  }

  function press(name) {
    for (const button of document.querySelectorAll("#looks button")) {
      button.setAttribute("aria-pressed", button.dataset.look === name);
    }
  }

  function use(camera) {
    if (viewer.camera === camera) return;
    viewer.camera = camera;
    viewer.controls.object = camera;
    viewer.set_3d_pane_size();
  }

  // Looks with the uncalibrated camera: the images of all frames fill the picture, at the scale that is chosen.
  const frameOfImages = imageWindow();
  function imageWindow() {
    const all = DATA.frames.flatMap(({ family }) => (family ? family.image.flatMap((point) => (point ? [[point[0] + family.middle[0], point[1] + family.middle[1]]] : [])) : []));
    const [us, vs] = [0, 1].map((k) => all.map((point) => point[k]));
    const [low, high] = [[Math.min(...us), Math.min(...vs)], [Math.max(...us), Math.max(...vs)]];
    return { middle: low.map((value, k) => (value + high[k]) / 2), half: low.map((value, k) => 0.66 * (high[k] - value)) };
  }

  function lookAlong() {
    const { family } = page.frame();
    if (!family) return;
    const s = scale.now(), pane = document.getElementById("meshcat-pane"), aspect = pane.offsetWidth / pane.offsetHeight;
    const target = new T.Vector3(...family.anchor);
    [right, down].forEach((axis, k) => target.addScaledVector(axis, (frameOfImages.middle[k] - family.middle[k]) / s));
    const position = target.clone().addScaledVector(forward, -FAR), tall = Math.max(frameOfImages.half[1], frameOfImages.half[0] / aspect, 1) / s;
    Object.assign(parallel, { top: tall, bottom: -tall, left: -tall * aspect, right: tall * aspect, zoom: 1 });
    parallel.position.set(position.x, position.z, -position.y);
    viewer.controls.target.set(target.x, target.z, -target.y);
    viewer.controls.update();
    parallel.updateProjectionMatrix();
    viewer.set_dirty();
  }

  viewer.set_property(["Background"], "top_color", [0.97, 0.98, 0.99]);
  viewer.set_property(["Background"], "bottom_color", [0.88, 0.9, 0.93]);
  viewer.set_property(["Axes"], "visible", false);
  for (const button of document.querySelectorAll("#looks button")) button.onclick = () => look(button.dataset.look);
  for (const box of document.querySelectorAll("#shown input")) {
    box.onchange = () => {
      shownNow[box.dataset.show] = box.checked;
      draw();
    };
  }
  viewer.controls.addEventListener("start", () => (following = false));
  window.addEventListener("resize", () => following && lookAlong());
  page.onChange(draw);
  draw();
  look("free");
  page.state.drawn = true;

  // What is drawn now, metres; for tests and for the console.
  const drawn = () => joints.slice(0, DATA.joints).map((mesh) => (mesh.visible ? mesh.position.toArray() : null));
  return { drawn, look, layers };
})();
