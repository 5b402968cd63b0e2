// Side panel of the page: frames, paths, survivors and their properties. DATA comes from data.py. Text from files is
// always inserted as text, never as HTML. scene.js draws the selected posture; tables.js fills the tabs.
"use strict";
const page = (() => {
  const state = { frame: 0, survivor: 0, path: DATA.paths ? 0 : null, sort: { key: "likeliest", down: false }, listed: 50, playing: false };
  const listeners = [], NEUTRAL = 0x5d5a88, DOUBT = 0.005;
  const byId = (id) => document.getElementById(id);
  const frame = () => DATA.frames[state.frame];
  const words = (name) => name.replaceAll(/[_.]/g, " ");
  const css = (colour) => "#" + colour.toString(16).padStart(6, "0");
  const plural = (count, one, many = `${one}s`) => `${count.toLocaleString("en")} ${count === 1 ? one : many}`;
  let told = 0;

  function element(tag, text, className) {
    const made = document.createElement(tag);
    if (text !== undefined) made.textContent = text;
    if (className) made.className = className;
    return made;
  }

  function button(text, action, className) {
    const made = element("button", text, className);
    made.type = "button";
    made.onclick = action;
    return made;
  }

  function row(parent, cells) {
    const made = element("tr");
    made.append(...cells);
    parent.append(made);
    return made;
  }

  function shown(value, scale) {
    if (value === null || value === undefined || Number.isNaN(value)) return "–";
    const scaled = value * scale, size = Math.abs(scaled);
    if (size < 0.0005) return "0";
    return scaled.toFixed(size !== 0 && size < 0.1 ? 3 : size < 100 ? 1 : 0);
  }

  // 0 % and 100 % are shown for exact values only, not for rounded ones.
  function percent(share) {
    if (share === undefined || Number.isNaN(share)) return "–";
    if (share > 0 && share < 0.0005) return "< 0.1 %";
    if (share < 1 && share > 0.9995) return "> 99.9 %";
    return `${(100 * share).toFixed((share > 0 && share < 0.0995) || (share > 0.99 && share < 1) ? 1 : 0)} %`;
  }

  // Default posture of a frame: the survivor nearest to the answer.
  const usual = () => frame().best ?? 0;

  function chooseFrame(index) {
    state.frame = Math.min(Math.max(index, 0), DATA.frames.length - 1);
    if (state.path === null && DATA.paths) state.path = state.left ?? null;
    state.survivor = usual();
    byId("frame").value = state.frame;
    refresh();
  }

  function chooseSurvivor(index) {
    if (!(index >= 0 && index < frame().held)) return;
    if (state.path !== null) state.left = state.path;
    state.path = null;
    state.survivor = index;
    for (const made of byId("survivors-body").rows) {
      const chosen = Number(made.dataset.survivor) === index;
      made.setAttribute("aria-selected", chosen);
      if (chosen && state.drawn) made.scrollIntoView({ block: "nearest" });
    }
    changed();
  }

  // Show a path through all frames, or the answer of each frame (null).
  function choosePath(path) {
    state.path = state.left = path;
    byId("path").value = path ?? "";
    chooseFrame(state.frame);
  }

  // While the motion plays, text and tables are updated a few times per second.
  function refresh() {
    showTime();
    if (state.playing && performance.now() - told < 700) return listeners.forEach((listener) => listener());
    told = performance.now();
    showAnswer();
    showSurvivors();
    showSeen();
    changed();
  }

  function changed() {
    for (const made of document.querySelectorAll("#answer button")) made.setAttribute("aria-pressed", state.path === null && Number(made.dataset.at) === state.survivor);
    listeners.forEach((listener) => listener());
    showCaption();
  }

  function showTime() {
    const { number, time } = frame(), at = time === undefined ? "" : `, ${Number(time.toFixed(3))} s`;
    byId("frame-text").textContent = `frame ${number} of ${DATA.frames[0].number} to ${DATA.frames.at(-1).number}${at}`;
    byId("frame").setAttribute("aria-valuetext", `frame ${number}${at}`);
  }

  function showCaption() {
    const here = frame(), { survivor, path } = state;
    let text = here.held ? "" : "This frame has no posture.";
    if (path !== null) text = `path ${path}, probability ${percent(DATA.paths.probability[path])}` + (DATA.paths.survivor[state.frame][path] < 0 ? ", interpolated in this frame" : "");
    else if (DATA.kind === "result" && here.held) text = `posture ${pack.number(here, survivor)}, probability ${percent(pack.probability(here, survivor))}` + (survivor === here.best ? "; nearest to the answer" : "");
    else if (here.held) text = [clipOf(here)?.name, here.held > 1 ? `posture ${survivor}` : ""].filter((part) => part).join(": ");
    byId("caption").textContent = text;
  }

  const clipOf = (here) => DATA.clips?.find((one) => one.clip === here.clip);

  function showAnswer() {
    const here = frame(), box = byId("answer");
    box.hidden = here.sure === undefined && !DATA.judged;
    if (DATA.judged) return showVerdict(box, here);
    if (here.sure === undefined) return;
    const line = element("p");
    line.append(element("strong", percent(here.sure), "sure"), ` probability that every joint of the answer is within 5 cm of the true joint${here.sureOf === "position" ? "" : `, ${here.sureOf}`}.`);
    if (here.sure < 0.5 && here.representatives?.length > 1) line.append(" Several postures fit the image.");
    box.replaceChildren(line);
    if (here.representatives?.length > 1) {
      box.append(element("p", "Each of these postures represents all postures within 5 cm:"));
      const list = element("div", undefined, "others");
      list.setAttribute("role", "group");
      list.setAttribute("aria-label", "the most probable posture and its alternatives");
      here.representatives.forEach(({ at, p, how }, k) => {
        const made = button(undefined, () => chooseSurvivor(at));
        made.dataset.at = at;
        made.append(element("b", percent(p)), ` ${how || (k ? "similar" : "most probable")}`);
        list.append(made);
      });
      if (here.moreRepresentatives) list.append(element("span", `and ${plural(here.moreRepresentatives, "other")}`, "soft"));
      box.append(list);
    }
  }

  function showVerdict(box, here) {
    const all = findings(), clip = clipOf(here);
    const list = element("ul");
    for (const one of all) list.append(element("li", one.text));
    box.replaceChildren(element("p", all.length ? `${plural(all.length, "finding")} in this posture:` : "All checks accept this posture."), list);
    if (clip && clip.frames > 1) box.append(element("p", clip.bad ? `${clip.bad.toLocaleString("en")} of ${plural(clip.frames, "frame")} of this clip are not valid; they have red marks above the time line.` : `All ${plural(clip.frames, "frame")} of this clip are valid.`, "soft"));
  }

  // Findings of the checks in the displayed posture.
  function findings() {
    return (frame().findings?.[state.survivor] ?? []).map(([place, value, bound]) => {
      const { check, where, joints } = DATA.places[place];
      return { joints, text: `${check}${where && ` ${words(where)}`}: ${value}${bound && ` (bound ${bound})`}` };
    });
  }

  // Whether a joint is nearer to the camera than its parent, and the probability.
  function depth(joint) {
    const here = frame(), k = DATA.treeSegments?.findIndex((pair) => pair[1] === joint) ?? -1;
    if (k < 0 || !here.nearer || here.nearerSure[k] === null) return null;
    const way = here.nearer[k] > 0 ? "nearer than" : here.nearer[k] < 0 ? "farther than" : "as deep as";
    return { way: `${way} the ${words(DATA.points[DATA.treeSegments[k][0]])}`, sure: here.nearerSure[k] };
  }

  const unseen = (joint) => state.path === null && joint < DATA.joints && pack.inferred(frame(), state.survivor, joint);
  const radius = (joint) => (state.path === null && DATA.kind === "result" && frame().held ? pack.radius(frame(), state.survivor, joint) : NaN);

  // Lines of the tooltip of a joint; the first line is its name.
  function about(joint) {
    const lines = [words(DATA.points[joint])], side = depth(joint);
    if (side) lines.push(`${side.way}: ${percent(side.sure)}`);
    if (radius(joint) > DOUBT) lines.push(`± ${shown(radius(joint), 100)} cm with 95 % probability, if the posture is right`);
    if (unseen(joint)) lines.push("not seen; position inferred");
    return [...lines, ...findings().filter((one) => one.joints.includes(joint)).map((one) => `! ${one.text}`)];
  }

  function groupColour(index) {
    return pack.has("groups") ? DATA.groupColours[Math.max(pack.group(frame(), index), 0) % DATA.groupColours.length] : NEUTRAL;
  }

  function columns() {
    const found = [{ key: "number", title: "posture", value: (k) => pack.number(frame(), k) }];
    if (pack.has("groups")) found.push({ key: "group", title: "group", value: (k) => pack.group(frame(), k) });
    if (pack.has("probability")) found.push({ key: "probability", title: "probability", value: (k) => pack.probability(frame(), k), text: percent });
    (DATA.margins ?? []).forEach(({ name, unit, scale }, index) => found.push({
      key: `margin${index}`, title: name + (unit ? ` (${unit})` : ""), value: (k) => pack.margin(frame(), k, index),
      text: (value) => (value < 0 ? "▼ " : "") + shown(value, scale), low: (value) => value < 0,
    }));
    return found;
  }

  function sorted() {
    const { key, down } = state.sort, order = Array.from({ length: frame().held }, (_, index) => index);
    const column = columns().find((one) => one.key === key);
    if (!column) return order;
    const value = (index) => { const held = column.value(index); return Number.isNaN(held) ? -Infinity : held; };
    return order.sort((a, b) => (value(a) - value(b) || 0) * (down ? -1 : 1) || a - b);
  }

  function showSurvivors() {
    const here = frame(), head = byId("survivors-head"), body = byId("survivors-body"), all = columns();
    head.replaceChildren();
    body.replaceChildren();
    byId("survivors").hidden = DATA.kind === "motion" || (DATA.kind === "postures" && here.held < 2);
    if (byId("survivors").hidden) return;
    const groups = pack.has("groups") ? new Set(sorted().map((k) => pack.group(here, k))).size : 0;
    byId("survivors-title").textContent = here.count === 0
      ? `No posture in this frame${here.reason ? `: ${here.reason}` : ""}`
      : `${plural(here.count, DATA.kind === "result" ? "posture passes" : "posture", DATA.kind === "result" ? "postures pass" : "postures")}${groups > 1 ? `, in ${groups} groups` : ""}`;
    if (DATA.margins?.length) byId("survivors-title").append(element("span", " – with the margin of each check", "soft"));
    row(head, all.map((column) => {
      const on = state.sort.key === column.key, made = element("th");
      made.setAttribute("aria-sort", on ? (state.sort.down ? "descending" : "ascending") : "none");
      made.append(button(column.title + (on ? (state.sort.down ? "\u00a0▾" : "\u00a0▴") : ""), () => {
        state.sort = { key: column.key, down: on ? !state.sort.down : column.key === "probability" };
        showSurvivors();
        head.querySelectorAll("button")[all.indexOf(column)]?.focus();
      }));
      return made;
    }));
    const order = sorted();
    for (const index of order.slice(0, state.listed)) {
      const made = row(body, all.map((column) => {
        const value = column.value(index), cell = element("td", (column.text ?? String)(value), column.low?.(value) ? "low" : "");
        if (column.key === "group") {
          const chip = element("span", undefined, "chip");
          chip.style.background = css(groupColour(index));
          cell.prepend(chip);
        }
        return cell;
      }));
      made.dataset.survivor = index;
      made.tabIndex = 0;
      made.setAttribute("aria-selected", index === state.survivor);
      made.onclick = () => chooseSurvivor(index);
      made.onkeydown = (event) => event.key === "Enter" && chooseSurvivor(index);
    }
    showRest(here, order.length);
  }

  // Number of postures that are not in the table, and not in the page.
  function showRest(here, held) {
    const rest = byId("rest"), lines = [];
    rest.replaceChildren();
    if (held > state.listed) rest.append(button(`show ${Math.min(200, held - state.listed)} more`, () => { state.listed += 200; showSurvivors(); }), " ");
    if (here.count > held) lines.push(`${plural(here.count - held, "posture is", "postures are")} in the result but not in this page.`);
    if (here.unlistedCount) lines.push(`${plural(here.unlistedCount, "further posture")} with a total probability of ${percent(here.unlisted)} ${here.unlistedCount === 1 ? "is" : "are"} not listed.`);
    rest.append(lines.join(" "));
    rest.hidden = !rest.textContent;
  }

  function showSeen() {
    const here = frame(), { image } = here, known = (image ?? []).filter((point) => point);
    byId("seen").hidden = !known.length;
    if (!known.length) return;
    byId("seen-name").textContent = here.picture ?? "image points";
    const svg = byId("seen-image"), ends = [0, 1].map((axis) => [Math.min(...known.map((point) => point[axis])), Math.max(...known.map((point) => point[axis]))]);
    const wide = Math.max(...ends.map(([low, high]) => high - low), 1e-9), border = 0.08 * wide;
    svg.setAttribute("viewBox", [ends[0][0] - border, ends[1][0] - border, ends[0][1] - ends[0][0] + 2 * border, ends[1][1] - ends[1][0] + 2 * border].join(" "));
    const add = (tag, attributes) => {
      const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
      for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
      svg.append(made);
    };
    svg.replaceChildren();
    for (const [a, b, side] of DATA.segments) if (image[a] && image[b]) add("line", { x1: image[a][0], y1: image[a][1], x2: image[b][0], y2: image[b][1], stroke: css(DATA.colours[side]), "stroke-width": 0.018 * wide, "stroke-linecap": "round" });
    image.forEach((point, k) => point && add("circle", { cx: point[0], cy: point[1], r: 0.014 * wide, fill: css(DATA.colours[DATA.pointSides[k]]) }));
  }

  function showLead() {
    const counts = DATA.frames.map((one) => one.count), total = counts.reduce((sum, one) => sum + one, 0), parts = [];
    if (DATA.judged) parts.push(`${DATA.decision}. ${DATA.valid.toLocaleString("en")} of ${plural(DATA.asked, "frame")} valid.`);
    else if (DATA.kind === "result") parts.push(`${plural(total, "posture")} in ${plural(counts.length, "frame")}: all that fit the image and pass the checks.`);
    else parts.push(`${plural(counts.length, "frame")}, ${plural(total, "posture")}.`);
    if (DATA.left) parts.push(`${plural(DATA.left, "posture is", "postures are")} not in this page.`);
    byId("lead").textContent = parts.join(" ");
  }

  byId("title").textContent = DATA.title;
  showLead();
  document.body.classList.toggle("table", !FIGURED);
  byId("look-camera").hidden = byId("rays-box").hidden = !DATA.camera;
  byId("others-box").hidden = DATA.kind === "motion" || !DATA.frames.some((one) => one.held > 1);
  byId("truth-box").hidden = !pack.has("truth");
  if (!FIGURED) for (const id of ["answer", "survivors"]) byId(id).hidden = true;
  for (const side of ["right", "left"]) if (DATA.colours) byId(`key-${side}`).style.background = css(DATA.colours[side]);
  byId("path-box").hidden = !DATA.paths;
  if (DATA.paths) {
    const option = (value, text) => { const made = element("option", text); made.value = value; byId("path").append(made); };
    DATA.paths.probability.forEach((p, k) => option(k, `path ${k}: ${percent(p)}`));
    option("", "answer of each frame");
    byId("path").onchange = (event) => choosePath(event.target.value === "" ? null : Number(event.target.value));
  }

  return {
    state, frame, findings, depth, unseen, radius, about, sorted, groupColour, chooseFrame, chooseSurvivor, choosePath, refresh,
    onChange: (listener) => listeners.push(listener),
    tools: { byId, element, button, row, words, shown, percent, plural },
  };
})();
