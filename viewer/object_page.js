// The frames of an object and the postures of each: one is drawn, or the first of the frame in each other.
const objectPage = (() => {
  const get = (id) => document.getElementById(id);
  const state = { frame: 0, posture: 0, all: false };
  const { frames, segments, joint, segment, slots } = OBJECT;

  const place = (path, matrix) => {
    posekit.show(path, matrix !== null);
    if (matrix !== null) viewer.handle_command({ type: "set_transform", path, matrix });
  };

  // A ball of the unit's radius at a point; a cylinder of the unit's radius and height, along y, from one to another.
  const ball = (p) => p && [joint, 0, 0, 0, 0, joint, 0, 0, 0, 0, joint, 0, ...p, 1];
  function tube(a, b) {
    if (!a || !b) return null;
    const along = b.map((x, k) => x - a[k]), length = Math.hypot(...along);
    if (!length) return null;
    const d = along.map((x) => x / length), least = d.map(Math.abs).indexOf(Math.min(...d.map(Math.abs)));
    const other = [0, 1, 2].map((k) => Number(k === least));
    const cross = (u, v) => [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const across = cross(d, other), size = Math.hypot(...across), u = across.map((x) => x / size), w = cross(u, d);
    const column = (axis, scale) => [...axis.map((x) => scale * x), 0];
    return [...column(u, segment), ...column(along, 1), ...column(w, segment), ...a.map((x, k) => (x + b[k]) / 2), 1];
  }

  function fill(slot, posture) {
    posekit.show(`/meshcat/slot-${slot}`, Boolean(posture));
    if (!posture) return;
    posture.points.forEach((p, k) => place(`/meshcat/slot-${slot}/joint-${k}`, ball(p)));
    segments.forEach(([a, b], k) => place(`/meshcat/slot-${slot}/segment-${k}`, tube(posture.points[a], posture.points[b])));
  }

  function draw() {
    const here = frames[state.frame], many = here.postures.length, chosen = here.postures[state.posture];
    for (let k = 0; k < slots; k++) fill(k, state.all ? here.postures[k] : k ? undefined : chosen);
    viewer.set_dirty();
    get("frame-said").textContent = `${here.number} (${here.time.toFixed(3)} s)`;
    get("posture-row").hidden = get("all").hidden = many < 2;
    get("posture").max = many - 1;
    get("posture").value = state.posture;
    get("all").textContent = many > slots ? `the first ${slots} at once` : "all at once";
    get("all").setAttribute("aria-pressed", state.all);
    get("number").textContent = chosen ? `${chosen.number}${here.count > many ? `, of the first ${many.toLocaleString("en")} of ${here.count.toLocaleString("en")}` : ""}` : "";
    get("posture-said").textContent = state.all ? "postures of the frame, in each other" : chosen ? `posture ${chosen.number}: ${chosen.said}` : here.none;
  }

  function chooseFrame(frame) {
    Object.assign(state, { frame, posture: 0 });
    draw();
  }

  get("frame-row").hidden = frames.length < 2;
  get("frame").oninput = () => chooseFrame(Number(get("frame").value));
  get("posture").oninput = () => {
    Object.assign(state, { posture: Number(get("posture").value), all: false });
    draw();
  };
  get("all").onclick = () => {
    state.all = !state.all;
    draw();
  };
  if (innerWidth < innerHeight) { // the eye stands for a square window
    viewer.camera.position.sub(viewer.controls.target).multiplyScalar(innerHeight / innerWidth).add(viewer.controls.target);
    viewer.controls.update();
  }
  chooseFrame(0);
  return { state, chooseFrame };
})();
