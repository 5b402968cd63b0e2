// The page's panel: frames, survivors, levels and reasons. DATA comes from data.py; all text that a
// file gave is set as text, never as HTML. scene.js draws what is chosen here.
"use strict";
const page = (() => {
  const state = { frame: 0, survivor: 0, scale: null, sort: { key: "number", down: false } };
  const listeners = [];
  const byId = (id) => document.getElementById(id);
  const frame = () => DATA.frames[state.frame];
  const words = (name) => name.replaceAll(/[_.]/g, " ");
  const css = (colour) => "#" + colour.toString(16).padStart(6, "0");
  const plural = (count, one, many) => `${count.toLocaleString("en")} ${count === 1 ? one : many}`;

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
    if (value === null || value === undefined) return "–";
    const scaled = value * scale, size = Math.abs(scaled);
    if (size !== 0 && size < 0.001) return scaled.toExponential(0);
    return scaled.toFixed(size !== 0 && size < 0.1 ? 3 : size < 100 ? 1 : 0);
  }

  function percent(share) {
    if (share > 0 && share < 0.0005) return "< 0.1 %";
    return `${(100 * share).toFixed(1)} %`;
  }

  function likeliest() {
    const { probability } = frame();
    return probability?.length ? probability.indexOf(Math.max(...probability)) : 0;
  }

  // Chooses a frame; the survivor with the same near-far choices stays chosen where it is there too, else the likeliest.
  function chooseFrame(index) {
    const code = frame().branches?.[state.survivor];
    state.frame = Math.min(Math.max(index, 0), DATA.frames.length - 1);
    const same = frame().branches?.indexOf(code) ?? -1;
    state.survivor = same < 0 ? likeliest() : same;
    state.scale = null;
    byId("frame").value = state.frame;
    showTime();
    showSurvivors();
    showLevels();
    showRejected();
    showInferred();
    showSeen();
    changed();
  }

  function chooseSurvivor(index) {
    if (!(index in frame().points)) return;
    state.survivor = index;
    state.scale = null;
    for (const made of byId("survivors-body").rows) {
      const chosen = Number(made.dataset.survivor) === index;
      made.setAttribute("aria-selected", chosen);
      if (chosen) made.scrollIntoView({ block: "nearest" });
    }
    showLevels();
    showInferred();
    changed();
  }

  // Draws the chosen posture at another scale; null is its own.
  function chooseScale(s) {
    state.scale = s;
    changed();
  }

  function changed() {
    listeners.forEach((listener) => listener());
    showMargins();
  }

  // Margins are judged at the scale that a posture was recovered at, wherever the slider is.
  function showMargins() {
    const { family } = frame(), own = family && lift.scaleOf(family, state.survivor);
    const away = Boolean(family) && state.scale !== null && Math.abs(state.scale / own - 1) > 1e-9;
    byId("survivors").classList.toggle("elsewhere", away);
    byId("margins-of")?.replaceChildren(
      away ? ` – margins are those of the recovered scale, ${own.toPrecision(4)} px/m` : " – with the room left to each check's bound",
    );
  }

  function showTime() {
    const { number, time } = frame();
    const at = time === undefined ? "" : `, ${Number(time.toPrecision(4))} s`;
    byId("frame-text").textContent = `frame ${number} of ${DATA.frames[0].number} to ${DATA.frames.at(-1).number}${at}`;
  }

  function columns() {
    const found = [{ key: "number", title: "posture" }];
    if (frame().family?.scales.length > 1) found.push({ key: "scale", title: "s (px/m)" });
    if (frame().groups) found.push({ key: "group", title: "group" });
    if (frame().probability) found.push({ key: "probability", title: "probability" });
    for (const margin of DATA.margins) {
      found.push({ key: margin.name, title: words(margin.name) + (margin.unit ? ` (${margin.unit})` : ""), margin });
    }
    return found;
  }

  function sorted() {
    const { key, down } = state.sort, here = frame();
    const value = (index) =>
      key === "number" ? index : key === "scale" ? lift.scaleOf(here.family, index) : key === "group" ? here.groups[index] : key === "probability" ? here.probability[index] : here.margins[key][index] ?? -Infinity;
    const order = here.points.map((_, index) => index);
    return order.sort((a, b) => (value(a) - value(b) || 0) * (down ? -1 : 1) || a - b);
  }

  function showSurvivors() {
    const here = frame(), head = byId("survivors-head"), body = byId("survivors-body");
    head.replaceChildren();
    body.replaceChildren();
    const count = here.points.length;
    byId("answer").replaceChildren(...(here.answer ?? []).map((line) => element("p", line)));
    const groups = here.groups ? `, in ${plural(new Set(here.groups).size, "group", "groups")}` : "";
    byId("survivors-title").textContent =
      count === 0
        ? "No posture survived in this frame"
        : DATA.kind === "result"
          ? `${plural(count, "posture survives", "postures survive")}${groups}`
          : plural(count, "posture", "postures");
    if (count && DATA.margins.length) {
      const made = element("span", undefined, "soft");
      made.id = "margins-of";
      byId("survivors-title").append(made);
      showMargins();
    }
    row(
      head,
      columns().map((column) => {
        const mark = state.sort.key === column.key ? (state.sort.down ? "\u00a0▾" : "\u00a0▴") : "";
        const made = element("th", column.title + mark, "sort");
        made.onclick = () => {
          const again = state.sort.key === column.key;
          state.sort = { key: column.key, down: again ? !state.sort.down : column.key === "probability" };
          showSurvivors();
        };
        return made;
      }),
    );
    for (const index of sorted()) {
      const cells = columns().map((column) => {
        if (column.key === "number") return element("td", index);
        if (column.key === "scale") return element("td", lift.scaleOf(here.family, index).toPrecision(4));
        if (column.key === "group") {
          const made = element("td"), chip = element("span", undefined, "chip");
          chip.style.background = css(groupColour(index));
          made.append(chip, here.groups[index]);
          return made;
        }
        if (column.key === "probability") return element("td", percent(here.probability[index]));
        const value = here.margins[column.margin.name][index];
        return element("td", shown(value, column.margin.scale), value < 0 ? "low" : "");
      });
      const made = row(body, cells);
      made.dataset.survivor = index;
      made.tabIndex = 0;
      made.setAttribute("aria-selected", index === state.survivor);
      made.onclick = () => chooseSurvivor(index);
      made.onkeydown = (event) => event.key === "Enter" && chooseSurvivor(index);
    }
  }

  function groupColour(index) {
    return DATA.groupColours[(frame().groups?.[index] ?? 0) % DATA.groupColours.length];
  }

  function showLevels() {
    if (DATA.kind !== "result") return;
    const { levels, branches } = frame(), section = byId("levels");
    const [head, body] = [section.querySelector("thead"), section.querySelector("tbody")];
    const motion = levels.motion.some((count, level) => count !== levels.physical[level]);
    const top = Math.log2(1 + Math.max(1, ...levels.physical));
    section.querySelector("p").textContent =
      "Each joint may be nearer to the camera or farther: the tree doubles at every level, and checks prune it. " +
      "Shown are the branches that survive, and what the chosen posture took.";
    head.replaceChildren();
    body.replaceChildren();
    const titles = ["joint", "physical checks", ...(motion ? ["and motion model"] : []), "chosen"];
    row(head, titles.map((title) => element("th", title, "text")));
    const code = branches[state.survivor];
    levels.joint.forEach((joint, level) => {
      const bars = [["physical", levels.physical[level]], ...(motion ? [["motion", levels.motion[level]]] : [])];
      const cells = bars.map(([stage, count]) => {
        const made = element("td", undefined, "bars"), bar = element("span", undefined, `bar ${stage}`);
        bar.style.width = `${(Math.log2(1 + count) / top) * 60}%`;
        made.append(bar, count.toLocaleString("en"));
        return made;
      });
      const choice = level === 0 ? "start" : code === undefined ? "–" : code[level - 1] === "1" ? "farther" : "nearer";
      row(body, [element("td", words(joint), "text"), ...cells, element("td", choice, "text")]);
    });
  }

  function showRejected() {
    if (DATA.kind !== "result") return;
    const here = frame(), section = byId("rejected");
    const [head, body] = [section.querySelector("thead"), section.querySelector("tbody")];
    const lost = here.rejected.reduce((sum, entry) => sum + entry[2], 0);
    section.querySelector("p").textContent =
      `${plural(lost + here.points.length, "possible posture", "possible postures")}: ${plural(lost, "was", "were")} ` +
      `rejected, ${here.points.length.toLocaleString("en")} survived. A posture counts where it broke its first check.`;
    head.replaceChildren();
    body.replaceChildren();
    row(head, [element("th", "check", "text"), element("th", "where", "text"), element("th", "postures", "text")]);
    const top = Math.max(1, ...here.rejected.map((entry) => entry[2]));
    for (const [check, where, leaves] of here.rejected) {
      const count = element("td", undefined, "bars"), bar = element("span", undefined, "bar");
      bar.style.width = `${(leaves / top) * 55}%`;
      count.append(bar, leaves.toLocaleString("en"));
      row(body, [element("td", words(check), "text"), element("td", words(where), "text wrap"), count]);
    }
  }

  // Joints that the image does not show: where they can be, from where they are drawn.
  function showInferred() {
    const here = frame().inferred?.[state.survivor] ?? {}, section = byId("unseen"), note = byId("survivors-note");
    const names = Object.keys(here).map((joint) => DATA.points[joint]);
    const [head, body] = [section.querySelector("thead"), section.querySelector("tbody")];
    note.hidden = !names.length;
    note.textContent = `Inferred: ${names.map(words).join(", ")}.`;
    section.querySelector("p").textContent = names.length
      ? "No image point places these joints. They are drawn hollow, in the middle of all positions that lengths, ranges and neighbours allow; a box holds them all. Here it is counted from the joint. All other joints are exact."
      : "The image places all joints of this posture.";
    head.replaceChildren();
    body.replaceChildren();
    if (!names.length) return;
    row(head, ["joint", "right (cm)", "down (cm)", "deeper (cm)", "within"].map((title, k) => element("th", title, k ? "" : "text")));
    const cm = (value, digits) => (100 * value).toFixed(digits).replace(/^-(0(\.0)?)$/, "$1").replace("-", "−");
    for (const [joint, one] of Object.entries(here)) {
      const share = one.fraction < 1 ? `, ${(100 * one.fraction).toPrecision(2)} %` : "";
      const name = element("td", words(DATA.points[joint]), "text");
      name.append(element("div", words(one.kind) + share, "soft"));
      const cells = [name];
      for (const k of [0, 1, 2]) {
        const [low, high] = [one.lower[k], one.upper[k]], digits = high - low < 0.1 ? 1 : 0;
        cells.push(element("td", high - low < 1e-4 ? cm(low, digits) : `${cm(low, digits)}…${cm(high, digits)}`));
      }
      row(body, [...cells, element("td", cm(one.radius, one.radius < 0.1 ? 1 : 0))]);
    }
  }

  function showSettings() {
    const body = byId("settings").querySelector("tbody");
    for (const [name, value] of DATA.settings) {
      row(body, [element("td", words(name), "text"), element("td", value, "text wrap")]);
    }
  }

  function showSeen() {
    const here = frame(), drawing = byId("seen-image");
    byId("seen").hidden = !here.image;
    drawing.replaceChildren();
    if (!here.image) return;
    const all = DATA.frames.flatMap((one) => one.image ?? []).filter((point) => point);
    const [us, vs] = [all.map((point) => point[0]), all.map((point) => point[1])];
    const [left, top] = [Math.min(...us), Math.min(...vs)];
    const [width, height] = [Math.max(...us) - left || 1, Math.max(...vs) - top || 1];
    const size = Math.max(width, height);
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
    for (const point of here.image) {
      if (point) add("circle", { cx: point[0], cy: point[1], r: 0.011 * size, fill: "#1d2329" });
    }
  }

  function play() {
    const button = byId("play");
    if (state.timer) {
      clearTimeout(state.timer);
      state.timer = undefined;
    } else {
      const step = () => {
        const next = (state.frame + 1) % DATA.frames.length;
        const apart = (DATA.frames[next].time - frame().time) * 1000;
        chooseFrame(next);
        state.timer = setTimeout(step, apart >= 20 && apart <= 1000 ? apart : 400);
      };
      state.timer = setTimeout(step, 0);
    }
    button.textContent = state.timer ? "⏸" : "▶";
    button.setAttribute("aria-label", state.timer ? "stop" : "play");
  }

  function chooseTab(name) {
    for (const tab of document.querySelectorAll("#tabs button")) {
      tab.setAttribute("aria-selected", tab.dataset.tab === name);
      byId(tab.dataset.tab).hidden = tab.dataset.tab !== name;
    }
  }

  function keys(event) {
    if (event.target instanceof HTMLInputElement || event.ctrlKey || event.altKey || event.metaKey) return;
    const order = sorted(), place = order.indexOf(state.survivor);
    const moves = {
      ArrowDown: () => chooseSurvivor(order[place + 1]),
      ArrowUp: () => chooseSurvivor(order[place - 1]),
      ArrowRight: () => chooseFrame(state.frame + 1),
      ArrowLeft: () => chooseFrame(state.frame - 1),
    };
    if (event.key in moves) {
      event.preventDefault();
      moves[event.key]();
    }
  }

  byId("title").textContent = DATA.title;
  byId("lead").textContent =
    DATA.kind === "result"
      ? "Every posture in the list gives exactly the same image. Choose one, and look at it from the camera, then from the side."
      : "Choose a posture from the list.";
  byId("key-right").style.background = css(DATA.colours.right);
  byId("key-left").style.background = css(DATA.colours.left);
  byId("truth-box").hidden = !DATA.frames.some((one) => one.truth?.some((step) => step !== null));
  byId("look-camera").hidden = byId("rays-box").hidden = DATA.kind !== "result";
  byId("unseen-tab").hidden = !DATA.frames.some((one) => one.inferred?.some((joints) => Object.keys(joints).length));
  if (DATA.level) byId("hint").textContent += " – upright as if the camera was held level";
  byId("time").hidden = DATA.frames.length < 2;
  byId("tabs").hidden = byId("levels").hidden = DATA.kind !== "result";
  byId("frame").max = DATA.frames.length - 1;
  byId("frame").oninput = (event) => chooseFrame(Number(event.target.value));
  byId("play").onclick = play;
  for (const tab of document.querySelectorAll("#tabs button")) tab.onclick = () => chooseTab(tab.dataset.tab);
  document.addEventListener("keydown", keys);
  state.survivor = likeliest();
  showSettings();
  // Without WebGL meshcat's viewer throws when it is made, and scene.js is never reached.
  window.addEventListener("error", () => {
    if (state.drawn) return;
    byId("meshcat-pane").replaceChildren(
      element("p", "The scene cannot be drawn: this browser has no WebGL. The tables work without it.", "failed"),
    );
  });

  return { state, frame, chooseFrame, chooseSurvivor, chooseScale, groupColour, onChange: (listener) => listeners.push(listener) };
})();
