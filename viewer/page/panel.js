// The page's panel: frames, paths, survivors and what is said of them. DATA comes from data.py; all text that a file
// gave is set as text, never as HTML. scene.js draws what is chosen here; tables.js has the tabs.
"use strict";
const page = (() => {
  const state = { frame: 0, survivor: 0, path: DATA.paths ? 0 : null, scale: null, example: null, hand: null, sort: { key: "likeliest", down: false }, listed: 50, playing: false };
  const listeners = [];
  const byId = (id) => document.getElementById(id);
  const frame = () => DATA.frames[state.frame];
  const words = (name) => name.replaceAll(/[_.]/g, " ");
  const css = (colour) => "#" + colour.toString(16).padStart(6, "0");
  const plural = (count, one, many) => `${count.toLocaleString("en")} ${count === 1 ? one : many}`;
  const NEUTRAL = 0x5d5a88;
  let told = 0;

  function element(tag, text, className) {
    const made = document.createElement(tag);
    if (text !== undefined) made.textContent = text;
    if (className) made.className = className;
    return made;
  }

  function row(parent, cells) {
    const made = element("tr");
    for (const cell of cells) made.append(cell);
    parent.append(made);
    return made;
  }

  function shown(value, scale) {
    if (value === null || value === undefined || Number.isNaN(value)) return "–";
    const scaled = value * scale, size = Math.abs(scaled);
    if (size !== 0 && size < 0.001) return scaled.toExponential(0);
    return scaled.toFixed(size !== 0 && size < 0.1 ? 3 : size < 100 ? 1 : 0);
  }

  // Certain and impossible are said of nothing else.
  function percent(share) {
    if (share > 0 && share < 0.0005) return "< 0.1 %";
    if (share < 1 && share > 0.9995) return "> 99.9 %";
    return `${(100 * share).toFixed((share > 0 && share < 0.0995) || (share > 0.99 && share < 1) ? 1 : 0)} %`;
  }

  const sureOf = (share) => (share === null ? "the only one in the result" : percent(share));

  // The survivor that is shown where nobody chose one: the path's, else the likeliest, which comes first.
  const usual = () => (state.path === null ? 0 : pack.onPath(state.frame, state.path));

  function chooseFrame(index) {
    state.frame = Math.min(Math.max(index, 0), DATA.frames.length - 1);
    if (state.path === null && DATA.paths) state.path = state.left ?? null;
    state.survivor = usual();
    state.scale = state.example = state.hand = null;
    byId("frame").value = state.frame;
    refresh();
  }

  function chooseSurvivor(index) {
    if (!(index >= 0 && index < frame().held)) return;
    if (state.path !== null) state.left = state.path;
    state.path = null;
    state.survivor = index;
    state.scale = state.example = state.hand = null;
    for (const made of byId("survivors-body").rows) {
      const chosen = Number(made.dataset.survivor) === index;
      made.setAttribute("aria-selected", chosen);
      if (chosen) made.scrollIntoView({ block: "nearest" });
    }
    markAnswer();
    changed();
  }

  // Follows a path through all frames, or takes the likeliest of each frame (null).
  function choosePath(path) {
    state.path = state.left = path;
    byId("path").value = path ?? "";
    chooseFrame(state.frame);
  }

  // Draws the chosen posture at another scale; null is its own.
  function chooseScale(s) {
    if (s !== null && state.path !== null && state.survivor >= 0) [state.left, state.path] = [state.path, null];
    state.scale = s;
    changed();
  }

  // Draws the chosen posture with its segments nearer (0) or farther (1) as these letters say.
  function chooseFlips(signs) {
    if (state.path !== null) [state.left, state.path] = [state.path, null];
    state.hand = signs;
    state.example = null;
    document.querySelectorAll("#survivors-body tr").forEach((made) => made.setAttribute("aria-selected", false));
    markAnswer();
    changed();
  }

  function chooseExample(example) {
    state.example = state.example === example ? null : example;
    changed();
  }

  // While it plays, words and tables follow a few times a second.
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
    listeners.forEach((listener) => listener());
    showMargins();
    showCaption();
  }

  // Margins are judged at the scale that a posture was recovered at, wherever the slider is.
  function showMargins() {
    const { family } = frame(), own = family && lift.scaleOf(family, Math.max(state.survivor, 0));
    const away = Boolean(family) && state.scale !== null && Math.abs(state.scale / own - 1) > 1e-9;
    byId("survivors").classList.toggle("elsewhere", away);
    byId("margins-of")?.replaceChildren(
      away ? ` – margins are those of the recovered scale, ${own.toPrecision(4)} px/m` : " – with the room left to each check's bound",
    );
  }

  function showTime() {
    const { number, time } = frame();
    const at = time === undefined ? "" : `, ${Number(time.toFixed(3))} s`;
    byId("frame-text").textContent = `frame ${number} of ${DATA.frames[0].number} to ${DATA.frames.at(-1).number}${at}`;
    byId("frame").setAttribute("aria-valuetext", `frame ${number}${at}`);
  }

  // What is drawn, in a line.
  function showCaption() {
    const here = frame(), { survivor, path } = state;
    let said = here.held ? "" : "no posture in this frame";
    if (path !== null) {
      const bridged = survivor < 0;
      said = `path ${path} (${sureOf(DATA.paths.probability[path])})` + (bridged ? ", bridged in this frame" : `, posture ${pack.number(here, survivor)}`);
    } else if (here.held) {
      const share = pack.probability(here, survivor);
      said = DATA.kind === "motion" ? DATA.clips?.[here.clip] ?? "" : `posture ${pack.number(here, survivor)}` + (share === undefined ? "" : `, ${percent(share)}` + (survivor ? "" : ": the likeliest" + (here.answer ? `, ${percent(here.answer.sure)} sure to 5 cm` : "")));
    }
    if (state.hand !== null) said = hand.said();
    if (state.example !== null) said += " – dashed: a rejected branch";
    byId("caption").textContent = said;
  }

  function showAnswer() {
    const here = frame(), { answer } = here, box = byId("answer");
    box.hidden = !answer && !DATA.judged;
    if (DATA.judged) return showVerdict(box, here);
    if (!answer) return;
    const [first, ...rest] = answer.lines, sure = element("p"), said = first.match(/^likeliest: (.* %) sure(, .*)$/);
    if (said) sure.append(element("strong", said[1], "sure"), ` sure of the likeliest posture${said[2]}`);
    else sure.textContent = first;
    // What the buttons say is not said twice.
    const short = answer.representatives.length > 1 ? rest.map((line) => line.replace(/ \([^)]*\);.*$/, ", each with what is within 5 cm of it:")) : rest;
    box.replaceChildren(sure, ...short.map((line) => element("p", line)));
    if (answer.representatives.length > 1) {
      const list = element("div", undefined, "others");
      list.setAttribute("role", "group");
      list.setAttribute("aria-label", "the likeliest posture, and what else it can be");
      for (const { at, p, how } of answer.representatives) {
        const made = element("button");
        made.type = "button";
        made.dataset.at = at;
        made.append(element("b", percent(p)), ` ${how || "the likeliest"}`);
        made.onclick = () => chooseSurvivor(at);
        list.append(made);
      }
      if (answer.more) list.append(element("span", `and ${plural(answer.more, "other", "others")}`, "soft"));
      box.append(list);
    }
    markAnswer();
  }

  function markAnswer() {
    for (const made of document.querySelectorAll("#answer button")) made.setAttribute("aria-pressed", state.path === null && state.hand === null && Number(made.dataset.at) === state.survivor);
  }

  function showVerdict(box, here) {
    const all = findings(), bad = DATA.frames.filter((one) => one.findings).length;
    const line = element("p", all.length ? `${plural(all.length, "check finds", "checks find")} something in this posture:` : "No check finds anything in this posture.");
    const list = element("ul");
    for (const one of all) list.append(element("li", one.text));
    box.replaceChildren(line, list);
    if (DATA.frames.length > 1) box.append(element("p", bad ? `${bad} of ${plural(DATA.frames.length, "frame has", "frames have")} findings: red marks above the time line.` : `Nor in any of ${plural(DATA.frames.length, "frame", "frames")}.`, "soft"));
  }

  // What the checks find in the posture that is drawn.
  function findings() {
    const here = frame().findings?.[state.survivor] ?? [];
    return here.map(([place, value, bound]) => {
      const { check, where, unit, joints } = DATA.findings[place];
      return { joints, text: `${words(check)}, ${words(where)}: ${value}${unit && " "}${unit} (bound ${bound}${unit && " "}${unit})` };
    });
  }

  // Which end of each segment is nearer, by the joint that ends it.
  function depth(joint) {
    const { answer } = frame(), k = DATA.answerSegments?.findIndex((pair) => pair[1] === joint) ?? -1;
    if (!answer || k < 0 || answer.near[k] === null) return null;
    return { start: DATA.answerSegments[k][0], near: answer.near[k], far: answer.far[k] };
  }

  const unseen = (joint) => (state.path === null ? joint in (frame().inferred?.[state.survivor] ?? {}) : joint < DATA.joints && pack.bridged(state.frame, state.path, joint));

  // What is told of a joint under the pointer; the first line is its name.
  function about(joint) {
    const lines = [words(DATA.points[joint])], sides = depth(joint);
    if (sides) lines.push(`nearer than the ${words(DATA.points[sides.start])}: ${percent(sides.near)}, farther: ${percent(sides.far)}`);
    if (unseen(joint)) lines.push(state.path === null ? "not seen: inferred" : "bridged between frames");
    lines.push(...findings().filter((one) => one.joints.includes(joint)).map((one) => `! ${one.text}`));
    const rejected = example();
    if (rejected?.joints.includes(joint)) lines.push(`rejected branch: ${rejected.text}`);
    return lines;
  }

  // The rejected branch that is drawn, with its reason.
  function example() {
    const here = frame(), k = state.example;
    if (k === null || !(k in here.examples)) return null;
    const [check, where] = DATA.reasons[here.examples[k]], points = pack.rejected(here, k);
    const joints = DATA.points.flatMap((name, joint) => (joint < DATA.joints && where.split(/[.-]/).includes(name) ? [joint] : []));
    return { points, joints, text: `${words(check)}, ${words(where)}` };
  }

  function columns() {
    const found = [{ key: "number", title: "posture" }];
    if (frame().family?.scales.length > 1) found.push({ key: "scale", title: "s (px/m)" });
    if (pack.has("groups")) found.push({ key: "group", title: "group" });
    if (pack.has("probability")) found.push({ key: "probability", title: "probability" });
    DATA.margins.forEach((margin, index) => found.push({ key: `margin${index}`, title: words(margin.name) + (margin.unit ? ` (${margin.unit})` : ""), margin, index }));
    return found;
  }

  function sorted() {
    const { key, down } = state.sort, here = frame();
    const order = Array.from({ length: here.held }, (_, index) => index);
    if (key === "likeliest") return order;
    const value = (index) => {
      if (key === "number") return pack.number(here, index);
      if (key === "scale") return lift.scaleOf(here.family, index);
      if (key === "group") return pack.group(here, index);
      if (key === "probability") return pack.probability(here, index);
      const margin = pack.margin(here, index, Number(key.slice(6)));
      return Number.isNaN(margin) ? -Infinity : margin;
    };
    return order.sort((a, b) => (value(a) - value(b) || 0) * (down ? -1 : 1) || a - b);
  }

  function cell(column, index) {
    const here = frame();
    if (column.key === "number") return element("td", pack.number(here, index));
    if (column.key === "scale") return element("td", lift.scaleOf(here.family, index).toPrecision(4));
    if (column.key === "group") {
      const made = element("td"), chip = element("span", undefined, "chip");
      chip.style.background = css(groupColour(index));
      made.append(chip, pack.group(here, index));
      return made;
    }
    if (column.key === "probability") return element("td", percent(pack.probability(here, index)));
    const value = pack.margin(here, index, column.index);
    return element("td", (value < 0 ? "▼ " : "") + shown(value, column.margin.scale), value < 0 ? "low" : "");
  }

  function showSurvivors() {
    const here = frame(), head = byId("survivors-head"), body = byId("survivors-body");
    head.replaceChildren();
    body.replaceChildren();
    byId("survivors").hidden = DATA.kind === "motion";
    if (DATA.kind === "motion") return;
    const groups = here.held && pack.has("groups") ? new Set(Array.from({ length: here.held }, (_, index) => pack.group(here, index))).size : 0;
    byId("survivors-title").textContent =
      here.count === 0
        ? "No posture survived in this frame"
        : DATA.kind === "result"
          ? `${plural(here.count, "posture survives", "postures survive")}${groups ? `, in ${plural(groups, "group", "groups")}` : ""}`
          : plural(here.count, "posture", "postures");
    if (here.held && DATA.margins.length) {
      const made = element("span", undefined, "soft");
      made.id = "margins-of";
      byId("survivors-title").append(made);
      showMargins();
    }
    row(head, columns().map((column) => {
      const on = state.sort.key === column.key, made = element("th"), button = element("button", column.title + (on ? (state.sort.down ? "\u00a0▾" : "\u00a0▴") : ""));
      button.type = "button";
      made.setAttribute("aria-sort", on ? (state.sort.down ? "descending" : "ascending") : "none");
      button.onclick = () => {
        state.sort = { key: column.key, down: on ? !state.sort.down : column.key === "probability" };
        showSurvivors();
        byId("survivors-head").querySelectorAll("button")[columns().findIndex((one) => one.key === column.key)].focus();
      };
      made.append(button);
      return made;
    }));
    const order = sorted();
    for (const index of order.slice(0, state.listed)) {
      const made = row(body, columns().map((column) => cell(column, index)));
      made.dataset.survivor = index;
      made.tabIndex = 0;
      made.setAttribute("aria-selected", index === state.survivor);
      made.onclick = () => chooseSurvivor(index);
      made.onkeydown = (event) => event.key === "Enter" && chooseSurvivor(index);
    }
    showRest(order.length);
  }

  function linked(address, words) {
    const made = element("a", words);
    made.href = address;
    return made;
  }

  // What is not in the table, and what is not in the page.
  function showRest(held) {
    const here = frame(), box = byId("rest"), lines = [];
    if (held > state.listed) {
      const made = element("button", `show ${Math.min(held - state.listed, 200)} more of ${held.toLocaleString("en")}`);
      made.type = "button";
      made.onclick = () => {
        state.listed += 200;
        showSurvivors();
      };
      lines.push(made);
    }
    if (here.count > here.held) {
      const told = `This page holds the ${here.held.toLocaleString("en")} likeliest of the ${here.count.toLocaleString("en")} postures of this frame.`;
      if (DATA.served) lines.push(element("p", told), linked(`/frame/${here.number}`, `this frame alone, with as many as fit`));
      else lines.push(element("p", `${told} For more of them, a page of this frame alone:`), element("code", `posekit render RESULT --frame ${here.number} -o frame-${here.number}.html`));
    }
    if (DATA.served && DATA.frames.length < (DATA.flips?.frames ?? 0)) lines.push(linked("/", "all frames"));
    if (here.unlisted > 0.0005) lines.push(element("p", `Further postures, which the result does not list, hold ${percent(here.unlisted)} at most.`));
    box.replaceChildren(...lines);
    box.hidden = !lines.length;
  }

  const groupColour = (index) => (pack.has("groups") ? DATA.groupColours[(pack.group(frame(), index) ?? 0) % DATA.groupColours.length] : NEUTRAL);

  function showSeen() {
    const here = frame(), drawing = byId("seen-image");
    byId("seen").hidden = !here.image?.some((point) => point);
    drawing.replaceChildren();
    byId("seen-name").textContent = here.picture ?? "what the camera saw";
    if (!here.image?.some((point) => point)) return;
    const [left, top, size, width, height] = seenWindow(here.image);
    drawing.setAttribute("viewBox", `${left - 0.05 * size} ${top - 0.05 * size} ${width + 0.1 * size} ${height + 0.1 * size}`);
    const add = (tag, attributes) => {
      const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
      for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
      drawing.append(made);
    };
    for (const [a, b, side] of DATA.segments) {
      const [p, q] = [here.image[a], here.image[b]];
      if (!p || !q) continue;
      add("line", {
        x1: p[0], y1: p[1], x2: q[0], y2: q[1], stroke: css(DATA.colours[side]), "stroke-width": 0.016 * size,
        "stroke-linecap": "round", ...(side === "left" ? { "stroke-dasharray": `${0.03 * size} ${0.03 * size}` } : {}),
      });
    }
    for (const point of here.image) if (point) add("circle", { cx: point[0], cy: point[1], r: 0.011 * size, fill: "#1d2329" });
  }

  function seenWindow(image) {
    const [us, vs] = [0, 1].map((axis) => image.flatMap((point) => (point ? [point[axis]] : [])));
    const [left, top] = [Math.min(...us), Math.min(...vs)], [width, height] = [Math.max(...us) - left || 1, Math.max(...vs) - top || 1];
    return [left, top, Math.max(width, height), width, height];
  }

  // What is true of the postures and the picture: exact ones give the same image, refined ones nearly.
  function lead() {
    if (DATA.kind === "motion") return "A motion, frame by frame. Play it, turn it, point at a joint.";
    if (DATA.kind !== "result") return "Choose a posture from the list.";
    const off = DATA.frames.flatMap((one) => (one.off ? [one.off] : [])), px = (value) => Number(value.toPrecision(2));
    const half = off.map((one) => one[0]).sort((a, b) => a - b)[Math.floor(off.length / 2)], most = Math.max(...off.map((one) => one[1]));
    const measured = off.length ? ` Those of the likeliest are ${px(half)} px from the picture's points in the median joint, ${px(most)} at most.` : "";
    if (!DATA.refined) return "Every posture in the list gives the same image, but for tolerances. Choose one, and look at it from the camera, then from the side." + (half >= 0.1 ? measured : "");
    const noise = DATA.deviation === null ? "" : ` (${px(DATA.deviation)} px)`;
    return `The postures fit the picture's points to within their noise${noise}, not exactly.${measured}`;
  }

  byId("title").textContent = DATA.title;
  byId("lead").textContent = lead();
  byId("key-right").style.background = css(DATA.colours.right);
  byId("key-left").style.background = css(DATA.colours.left);
  byId("truth-box").hidden = !pack.has("truth") || !DATA.frames.some((_, index) => pack.truth(index).some((point) => point));
  byId("look-camera").hidden = byId("rays-box").hidden = DATA.kind !== "result";
  byId("others-box").hidden = DATA.kind === "motion";
  byId("path-box").hidden = !DATA.paths;
  if (DATA.paths) {
    byId("path").append(...DATA.paths.probability.map((share, path) => Object.assign(element("option", `path ${path} (${sureOf(share)})`), { value: path })), Object.assign(element("option", "each frame's likeliest"), { value: "" }));
    byId("path").title = DATA.paths.words;
    byId("path").onchange = (event) => choosePath(event.target.value === "" ? null : Number(event.target.value));
  }
  byId("hint").textContent += { level: " – upright as if the camera was held level", trunks: " – upright as the trunks are on average: the camera's tilt is not known" }[DATA.upright] ?? "";
  if (DATA.left) byId("lead").textContent += ` The page holds the likeliest postures; ${DATA.left.toLocaleString("en")} more are in the file.`;

  return {
    state, frame, chooseFrame, chooseSurvivor, choosePath, chooseScale, chooseExample, chooseFlips, groupColour, findings, depth, unseen, about, example, sorted, refresh,
    tools: { byId, element, row, words, percent, plural }, onChange: (listener) => listeners.push(listener),
  };
})();
