// A stick figure of joints in millimetres, z up, that turns about the vertical when it is dragged.

const SVG = "http://www.w3.org/2000/svg";

function svgElement(name, attributes, parent) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (parent) parent.append(element);
  return element;
}

const SIDE_COLOURS = { right: "#e69f00", left: "#0072b2", trunk: "#333333" };

function seenFrom(point, yaw) {
  const [x, y, z] = point;
  return [x * Math.cos(yaw) + y * Math.sin(yaw), -z];
}

// Three quarters from the front, where the hips say which way that is.
function startYaw(points, skeleton) {
  const at = name => points[skeleton.joints.indexOf(name)];
  const right = at("right_hip"), left = at("left_hip");
  if (!right || !left) return 0.5;
  const across = [left[0] - right[0], left[1] - right[1]];
  return Math.atan2(across[1], across[0]) + 0.6;
}

function stickFigure(still, marked, skeleton) {
  const [points, before] = still;
  const picture = svgElement("svg", { viewBox: "0 0 240 260", role: "img", "aria-label": "the frame, as a stick figure; drag to turn it" });
  let yaw = startYaw(points, skeleton);
  const known = [...points, ...(before || [])].filter(Boolean);
  const reach = Math.max(1, ...points.filter(Boolean).flatMap(p => [Math.hypot(p[0], p[1]), Math.abs(p[2])]));
  const wide = Math.max(1, ...known.flatMap(p => [Math.hypot(p[0], p[1]), Math.abs(p[2])]));
  const scale = 112 / Math.min(wide, 2.5 * reach);
  const place = p => { const [u, v] = seenFrom(p, yaw); return [120 + scale * u, 130 + scale * v]; };
  function bones(body, options) {
    for (const [a, b, side] of skeleton.segments) {
      if (!body[a] || !body[b]) continue;
      const [x1, y1] = place(body[a]), [x2, y2] = place(body[b]);
      svgElement("line", { x1, y1, x2, y2, stroke: options.colour || SIDE_COLOURS[side], "stroke-width": options.width, "stroke-linecap": "round" }, picture);
    }
    const head = body.slice(14).filter(Boolean);
    if (head.length && body[0]) {
      const middle = [0, 1, 2].map(k => head.reduce((sum, p) => sum + p[k], 0) / head.length);
      const [x1, y1] = place(body[0]), [x2, y2] = place(middle);
      svgElement("line", { x1, y1, x2, y2, stroke: options.colour || SIDE_COLOURS.trunk, "stroke-width": options.width }, picture);
      svgElement("circle", { cx: x2, cy: y2, r: 0.09 * 1000 * scale, fill: "none", stroke: options.colour || SIDE_COLOURS.trunk, "stroke-width": options.width }, picture);
    }
  }
  function draw() {
    picture.replaceChildren();
    if (before) bones(before, { colour: "#c4cad0", width: 1.5 });
    bones(points, { width: 3 });
    for (const joint of marked) {
      if (!points[joint]) continue;
      const [cx, cy] = place(points[joint]);
      svgElement("circle", { cx, cy, r: 9, fill: "none", stroke: "#d4006a", "stroke-width": 3, class: "mark" }, picture);
    }
  }
  let from = null;
  picture.addEventListener("pointerdown", event => { from = event.clientX; picture.setPointerCapture(event.pointerId); });
  picture.addEventListener("pointerup", () => { from = null; });
  picture.addEventListener("pointermove", event => {
    if (from === null) return;
    yaw += (event.clientX - from) / 90;
    from = event.clientX;
    draw();
  });
  draw();
  return picture;
}
