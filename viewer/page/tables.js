// The tabs under the answer: joints, levels of the tree, reasons, joints that were not seen, settings, keys.
"use strict";
const tables = (() => {
  const { byId, element, row, words, percent, plural } = page.tools;
  const text = (value, kind = "text") => element("td", value, kind);
  const MOST_SPANS = 200, DOUBT = 0.05;
  let last = "", open = "joints";

  function parts(name) {
    const section = byId(name);
    const found = ["p", "thead", "tbody"].map((tag) => section.querySelector(tag));
    found.slice(1).forEach((part) => part?.replaceChildren());
    return found;
  }

  function bar(count, share, kind = "") {
    const made = element("td", undefined, "bars"), drawn = element("span", undefined, `bar ${kind}`);
    drawn.style.width = `${60 * share}%`;
    made.append(drawn, count.toLocaleString("en"));
    return made;
  }

  // All that is told of a joint under the pointer, for those who use none.
  function showJoints() {
    const [note, head, body] = parts("joints"), found = page.findings();
    const sides = Boolean(page.frame().answer);
    note.textContent = sides ? "How probable it is that a joint is nearer to the camera than the one that it hangs on, by 5 cm, or farther." : "The joints, and what the checks find at them.";
    row(head, ["joint", ...(sides ? ["nearer", "farther"] : []), ""].map((title, k) => element("th", title, k && k < 3 && sides ? "" : "text")));
    DATA.points.slice(0, DATA.joints).forEach((name, joint) => {
      const depth = page.depth(joint), said = found.filter((one) => one.joints.includes(joint)).map((one) => `! ${one.text}`);
      if (page.unseen(joint)) said.unshift("not seen");
      if (sides && !depth && !said.length) return;
      const cells = sides ? (depth ? [depth.near, depth.far] : [NaN, NaN]).map((share) => text(Number.isNaN(share) ? "–" : percent(share), share > 0.5 ? "strong" : "")) : [];
      row(body, [text(words(name)), ...cells, text(said.join("; "), "text wrap")]);
    });
  }

  // What the checks find in a motion: frames in a row are one line, which leads to the worst of them.
  function showFindings() {
    const [note, head, body] = parts("findings"), spans = new Map();
    DATA.frames.forEach((one, index) => {
      for (const [place, value, bound] of one.findings?.[0] ?? []) {
        const over = Math.abs(value - bound), list = spans.get(place) ?? spans.set(place, []).get(place), last = list.at(-1);
        if (!last || last.end < index - 1) list.push({ start: index, end: index, worst: index, value, bound, over });
        else {
          last.end = index;
          if (over > last.over) Object.assign(last, { worst: index, value, bound, over });
        }
      }
    });
    const all = [...spans].flatMap(([place, list]) => list.map((one) => ({ ...DATA.findings[place], ...one }))).sort((a, b) => b.end - b.start - a.end + a.start);
    note.textContent = all.length ? "What each check finds, the longest first; choose one to see its worst frame." : "No check finds anything.";
    if (!all.length) return;
    row(head, ["frames", "check", "where", "worst", "bound"].map((title) => element("th", title, "text")));
    const number = (index) => DATA.frames[index].number;
    for (const one of all.slice(0, MOST_SPANS)) {
      const button = element("button", one.start === one.end ? number(one.start) : `${number(one.start)}–${number(one.end)}`), place = text(undefined);
      button.type = "button";
      button.onclick = () => play.go(one.worst);
      place.append(button);
      row(body, [place, text(words(one.check), "text wrap"), text(words(one.where), "text wrap"), text(`${one.value} ${one.unit}`), text(`${one.bound} ${one.unit}`)]);
    }
    if (all.length > MOST_SPANS) note.textContent += ` Shown are ${MOST_SPANS} of ${all.length}.`;
  }

  // In which frames it is in doubt which end of a segment is nearer: frames in a row are one line, which leads to the worst.
  function doubts() {
    const all = [];
    DATA.answerSegments?.forEach(([start, end], k) => {
      let last;
      DATA.frames.forEach(({ answer }, index) => {
        const [near, far] = [answer?.near[k] ?? 0, answer?.far[k] ?? 0], odds = Math.min(near, far);
        if (odds < DOUBT) return;
        if (last?.to !== index - 1) all.push((last = { start, end, from: index, to: index, odds: 0 }));
        last.to = index;
        if (odds > last.odds) Object.assign(last, { odds, near, far, worst: index });
      });
    });
    return all.sort((a, b) => b.to - b.from - a.to + a.from);
  }

  function showDoubts(all) {
    const [note, head, body] = parts("findings"), number = (index) => DATA.frames[index].number;
    note.textContent = `Where either end of a segment is the nearer one with ${percent(DOUBT)} or more, the longest first; choose one to see its least sure frame.`;
    if (all.length > MOST_SPANS) note.textContent += ` Shown are ${MOST_SPANS} of ${all.length}.`;
    row(head, ["frames", "segment", "least sure"].map((title) => element("th", title, "text")));
    for (const one of all.slice(0, MOST_SPANS)) {
      const button = element("button", one.from === one.to ? number(one.from) : `${number(one.from)}–${number(one.to)}`), place = text(undefined);
      button.type = "button";
      button.onclick = () => play.go(one.worst);
      place.append(button);
      row(body, [place, text(`${words(DATA.points[one.start])} – ${words(DATA.points[one.end])}`, "text wrap"), text(`${words(DATA.points[one.end])} nearer ${percent(one.near)}, farther ${percent(one.far)}`, "text wrap")]);
    }
  }

  function showLevels() {
    const { levels } = page.frame(), [note, head, body] = parts("levels");
    const motion = levels.motion.some((count, level) => count !== levels.physical[level]);
    const top = Math.log2(1 + Math.max(1, ...levels.physical));
    note.textContent =
      "Each joint may be nearer to the camera or farther: the tree doubles at every level, and checks prune it. " +
      "Shown are the branches that survive, and what the chosen posture took.";
    row(head, ["joint", "physical checks", ...(motion ? [DATA.refined ? "and likely enough" : "and motion model"] : []), "chosen"].map((title) => element("th", title, "text")));
    const { survivor } = page.state, code = survivor >= 0 && survivor < page.frame().held ? pack.branch(page.frame(), survivor) : undefined;
    levels.joint.forEach((joint, level) => {
      const counts = [["physical", levels.physical[level]], ...(motion ? [["motion", levels.motion[level]]] : [])];
      const choice = level === 0 ? "start" : code === undefined ? "–" : code[level - 1] === "1" ? "farther" : "nearer";
      row(body, [text(words(joint)), ...counts.map(([stage, count]) => bar(count, Math.log2(1 + count) / top, stage)), text(choice)]);
    });
  }

  function showRejected() {
    const here = page.frame(), [note, head, body] = parts("rejected");
    const lost = here.rejected.reduce((sum, entry) => sum + entry[1], here.rejectedMore);
    note.textContent =
      `${plural(lost + here.count + here.notListed, "possible posture", "possible postures")}: ${plural(lost, "was", "were")} ` +
      `rejected, ${here.count.toLocaleString("en")} survived` +
      `${here.notListed ? `, ${here.notListed.toLocaleString("en")} more are possible and not listed` : ""}. A posture counts where it broke its first check.` +
      (here.examples.length ? " Choose a reason to see a branch that it rejected." : "");
    row(head, [element("th", "check", "text"), element("th", "where", "text"), element("th", "postures", "text")]);
    const top = Math.max(1, ...here.rejected.map((entry) => entry[1]));
    for (const [reason, leaves] of here.rejected) {
      const [check, where] = DATA.reasons[reason], example = here.examples.indexOf(reason), place = text(undefined, "text wrap");
      if (example >= 0) {
        const button = element("button", words(where) || "show");
        button.type = "button";
        button.setAttribute("aria-pressed", page.state.example === example);
        button.onclick = () => {
          page.chooseExample(example);
          body.querySelectorAll("button").forEach((one) => one.setAttribute("aria-pressed", one === button && page.state.example === example));
        };
        place.append(button);
      } else place.textContent = words(where);
      row(body, [text(words(check)), place, bar(leaves, (leaves / top) * 0.9)]);
    }
    if (here.rejectedMore) row(body, [text("others"), text(""), bar(here.rejectedMore, 0)]);
  }

  // Joints that the image does not show: where they can be, from where they are drawn.
  function showInferred() {
    const here = page.frame().inferred?.[page.state.survivor] ?? {}, above = byId("survivors-note");
    const names = Object.keys(here).map((joint) => DATA.points[joint]), [note, head, body] = parts("unseen");
    above.hidden = !names.length;
    above.textContent = `Inferred: ${names.map(words).join(", ")}.`;
    note.textContent = names.length
      ? "No image point places these joints. They are drawn hollow, in the middle of all positions that lengths, ranges and neighbours allow; a box holds them all. Here it is counted from the joint. All other joints follow from the image."
      : "The image places all joints of this posture.";
    if (!names.length) return;
    row(head, ["joint", "right (cm)", "down (cm)", "deeper (cm)", "within"].map((title, k) => element("th", title, k ? "" : "text")));
    const cm = (value, digits) => (100 * value).toFixed(digits).replace(/^-(0(\.0)?)$/, "$1").replace("-", "−");
    for (const [joint, one] of Object.entries(here)) {
      const share = one.fraction < 1 ? `, ${(100 * one.fraction).toPrecision(2)} %` : "", name = text(words(DATA.points[joint]));
      name.append(element("div", words(one.kind) + share, "soft"));
      const cells = [name];
      for (const k of [0, 1, 2]) {
        const [low, high] = [one.lower[k], one.upper[k]], digits = high - low < 0.1 ? 1 : 0;
        cells.push(element("td", high - low < 1e-4 ? cm(low, digits) : `${cm(low, digits)}…${cm(high, digits)}`));
      }
      row(body, [...cells, element("td", cm(one.radius, one.radius < 0.1 ? 1 : 0))]);
    }
  }

  const SHOW = { joints: showJoints, levels: showLevels, rejected: showRejected };

  // Only what is open is made anew, and only where something else is chosen.
  function show() {
    const { frame, survivor, path, playing } = page.state, now = `${open} ${frame} ${survivor} ${path}`;
    if (playing || now === last) return;
    last = now;
    SHOW[open]?.();
    showInferred();
  }

  function choose(name) {
    open = name;
    if (name === "flips") hand.show();
    for (const tab of document.querySelectorAll("#tabs button")) {
      const on = tab.dataset.tab === name;
      tab.setAttribute("aria-selected", on);
      tab.tabIndex = on ? 0 : -1;
      byId(tab.dataset.tab).hidden = !on;
    }
    show();
  }

  const tabs = [...document.querySelectorAll("#tabs button")];
  const usable = () => tabs.filter((tab) => !tab.hidden);
  for (const tab of tabs) {
    tab.onclick = () => choose(tab.dataset.tab);
    tab.onkeydown = (event) => {
      const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!way) return;
      event.preventDefault();
      event.stopPropagation();
      const some = usable(), next = some[(some.indexOf(tab) + way + some.length) % some.length];
      next.focus();
      choose(next.dataset.tab);
    };
  }
  for (const tab of tabs) if (["levels", "rejected", "settings"].includes(tab.dataset.tab)) tab.hidden = DATA.kind !== "result";
  const inDoubt = DATA.kind === "result" && DATA.frames.length > 1 ? doubts() : [];
  for (const tab of tabs) {
    if (tab.dataset.tab !== "findings") continue;
    tab.hidden = !inDoubt.length && (DATA.kind !== "motion" || !DATA.judged);
    if (inDoubt.length) tab.textContent = "In doubt";
  }
  if (inDoubt.length) showDoubts(inDoubt);
  byId("flips-tab").hidden = !DATA.frames.some((one) => one.family);
  byId("unseen-tab").hidden = !DATA.frames.some((one) => one.inferred?.some((joints) => Object.keys(joints).length));
  for (const [name, value] of DATA.settings) row(byId("settings").querySelector("tbody"), [text(words(name)), text(value, "text wrap")]);
  page.onChange(show);
  choose(DATA.kind === "motion" && DATA.judged ? "findings" : "joints");
  if (DATA.kind === "motion" && DATA.judged) showFindings();
  return { choose };
})();
