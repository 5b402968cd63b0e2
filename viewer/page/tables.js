// Tabs of the page: findings of each clip, checks, joints, levels of the tree, rejected postures, settings, keys.
"use strict";
const tables = (() => {
  const { byId, element, button, row, words, shown, percent, plural } = page.tools;
  const text = (value, kind = "text") => element("td", value, kind);
  const heads = (head, titles, numbers = []) => row(head, titles.map((title, k) => element("th", title, numbers.includes(k) ? "" : "text")));
  const result = DATA.kind === "result", SVG = "http://www.w3.org/2000/svg", DECISION = { keep: "keep", drop: "drop", "repair?": "mend" };
  let last = "", open = "", only = "";

  function parts(name) {
    const found = ["p", "thead", "tbody"].map((tag) => byId(name).querySelector(tag));
    found.slice(1).forEach((part) => part.replaceChildren());
    return found;
  }

  function bar(count, share) {
    const made = element("td", undefined, "bars"), drawn = element("span", undefined, "bar");
    drawn.style.width = `${60 * share}%`;
    made.append(drawn, count.toLocaleString("en"));
    return made;
  }

  function drawing(tag, attributes, parent, title) {
    const made = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    if (title !== undefined) drawing("title", {}, made).textContent = title;
    parent?.append(made);
    return made;
  }

  const visit = (span) => span.index >= 0 && play.go(span.index);

  // Timeline of a clip: one row per check, frames along x. A bar at the top marks the longest valid span.
  function timeline(clip) {
    const checks = [...new Set(clip.spans.map((span) => span.check))], WIDE = 400, LEFT = 112, LANE = 14;
    const high = 8 + LANE * checks.length + 14, whole = Math.max(clip.frames, ...clip.spans.map((span) => span.last + 1));
    const picture = drawing("svg", { viewBox: `0 0 ${WIDE} ${high}`, class: "lanes", role: "img", "aria-label": `timeline of ${plural(clip.frames, "frame")}` });
    const x = (k) => LEFT + ((WIDE - LEFT - 4) * k) / whole;
    if (clip.good) drawing("rect", { class: "good", x: x(clip.good[0]), y: 1, width: Math.max(1, x(clip.good[1] + 1) - x(clip.good[0])), height: 4 }, picture, `longest valid span: frames ${clip.good[0]} to ${clip.good[1]}`);
    checks.forEach((check, k) => {
      drawing("rect", { class: "lane", x: LEFT, y: 8 + k * LANE, width: WIDE - LEFT - 4, height: LANE - 2 }, picture);
      drawing("text", { x: LEFT - 6, y: 18 + k * LANE, "text-anchor": "end" }, picture).textContent = check;
    });
    for (const span of clip.spans) {
      const mark = drawing("rect", { class: span.verdict, x: x(span.first), y: 8 + checks.indexOf(span.check) * LANE, width: Math.max(2, x(span.last + 1) - x(span.first)), height: LANE - 2 }, picture, span.text);
      mark.addEventListener("click", () => visit(span));
    }
    [[0, "start"], [whole - 1, "end"]].forEach(([k, anchor]) => { drawing("text", { x: anchor === "start" ? LEFT : WIDE - 4, y: high - 3, "text-anchor": anchor }, picture).textContent = k; });
    return picture;
  }

  function article(clip) {
    const made = element("article"), title = element("h3", clip.name ? `${clip.name} ` : "");
    title.title = clip.path;
    title.append(element("span", clip.decision, DECISION[clip.decision]));
    made.append(title, element("p", clip.bad ? `${clip.bad.toLocaleString("en")} of ${plural(clip.frames, "frame")} not valid` + (clip.good ? `; longest valid span: frames ${clip.good[0]} to ${clip.good[1]}` : "; no valid frame") : `${plural(clip.frames, "frame")}, all valid`, "soft"));
    if (!clip.spans.length) return made;
    if (clip.frames > 1) made.append(timeline(clip));
    const list = element("div", undefined, "spans");
    for (const span of clip.spans.filter((one) => !only || one.check === only)) {
      const one = button(span.text, () => visit(span), span.verdict);
      one.disabled = span.index < 0 && FIGURED;
      list.append(one);
    }
    if (clip.more) list.append(element("span", `and ${plural(clip.more, "more span")}`, "soft"));
    made.append(list);
    return made;
  }

  function showFindings() {
    const box = byId("findings"), some = DATA.clips.filter((clip) => !only || clip.spans.some((span) => span.check === only));
    const bad = some.filter((clip) => clip.decision !== "keep"), shownClips = (bad.length ? bad : some).slice(0, 60);
    const note = element("p", undefined, "note"), select = element("select"), found = DATA.checks.filter((one) => one.frames || one.undecided);
    select.setAttribute("aria-label", "show findings of this check");
    for (const name of ["", ...found.map((one) => one.name)]) {
      const option = element("option", name || "all checks");
      option.value = name;
      option.selected = name === only;
      select.append(option);
    }
    select.onchange = () => { only = select.value; showFindings(); byId("findings").querySelector("select").focus(); };
    note.append(bad.length ? `${plural(bad.length, "clip")} not kept, the worst first. Click a finding to see its worst frame. Show ` : "All clips are valid. ", ...(found.length ? [select] : []));
    box.replaceChildren(note, ...shownClips.map(article));
    const left = (bad.length ? bad : some).length - shownClips.length + DATA.moreClips;
    if (left > 0) box.append(element("p", `${plural(left, "further clip")} ${left === 1 ? "is" : "are"} not listed here.`, "note"));
    for (const line of DATA.notes) box.append(element("p", line, "note"));
  }

  function showChecks() {
    const [note, head, body] = parts("checks"), top = Math.max(1, ...DATA.checks.map((one) => one.frames));
    note.textContent = "Number of frames that each check rejects, and the worst finding of each check.";
    heads(head, ["check", "frames", "clips", "undecided", "most often", "worst"], [2, 3]);
    for (const one of DATA.checks) {
      const made = row(body, [text(one.name), bar(one.frames, one.frames / top), text(one.clips, ""), text(one.undecided, ""), text(words(one.place), "text wrap"), text(one.worst)]);
      made.title = one.message;
    }
  }

  // The same text as in the tooltips of joints, for users without a pointer.
  function showJoints() {
    const [note, head, body] = parts("joints"), found = page.findings();
    note.textContent = result ? "For each joint: whether it is nearer to the camera than its parent, the probability, and the 95 % radius of its position if the posture is right." : "Findings of the checks at each joint.";
    heads(head, ["joint", ...(result ? ["depth", "sure", "± cm"] : []), ""], result ? [2, 3] : []);
    DATA.points.slice(0, DATA.joints).forEach((name, joint) => {
      const side = page.depth(joint), lines = found.filter((one) => one.joints.includes(joint)).map((one) => `! ${one.text}`);
      if (page.unseen(joint)) lines.unshift("not seen");
      if (!result && !lines.length && !DATA.figure) return;
      const cells = result ? [text(side?.way ?? "", "text wrap"), text(side ? percent(side.sure) : "", side?.sure > 0.95 ? "strong" : ""), text(shown(page.radius(joint), 100), "")] : [];
      row(body, [text(words(name)), ...cells, text(lines.join("; "), "text wrap")]);
    });
  }

  function showLevels() {
    const { levels } = page.frame(), [note, head, body] = parts("levels"), top = Math.log2(1 + Math.max(1, ...levels));
    note.textContent = levels.length
      ? "Each joint can be at a nearer or a farther position, so each level of the tree has up to twice as many branches. The table counts the branches that the checks accept."
      : "The postures of this frame come from the solver for noisy points, not from the tree.";
    if (!levels.length) return;
    heads(head, ["joint", "branches"]);
    levels.forEach((count, level) => row(body, [text(words(DATA.points[level] ?? "")), bar(count, Math.log2(1 + count) / top)]));
  }

  function showRejected() {
    const here = page.frame(), [note, head, body] = parts("rejected");
    const lost = here.rejected.reduce((sum, entry) => sum + entry[1], here.rejectedMore), top = Math.max(1, ...here.rejected.map((entry) => entry[1]));
    note.textContent = `${plural(lost, "posture was", "postures were")} rejected, ${here.count.toLocaleString("en")} passed. Each rejected posture is counted once, at the first check that rejects it.`;
    heads(head, ["check", "where", "postures"]);
    for (const [reason, count] of here.rejected) row(body, [text(DATA.reasons[reason][0].replaceAll("_", "-")), text(words(DATA.reasons[reason][1]), "text wrap"), bar(count, (count / top) * 0.9)]);
    if (here.rejectedMore) row(body, [text("others"), text(""), bar(here.rejectedMore, 0)]);
  }

  function showSettings() {
    const body = parts("settings")[2];
    for (const [name, value] of DATA.settings) row(body, [text(words(name)), text(value, "text wrap")]);
  }

  const SHOW = { joints: showJoints, levels: showLevels, rejected: showRejected }, ONCE = { findings: showFindings, checks: showChecks, settings: showSettings };
  const USED = { findings: DATA.judged, checks: DATA.judged, joints: FIGURED, levels: result, rejected: result, settings: DATA.settings?.length, keys: FIGURED };

  // Only the open tab is updated, and only if the selection changes.
  function show() {
    const { frame, survivor, path, playing } = page.state, now = `${open} ${frame} ${survivor} ${path}`;
    if (playing || now === last) return;
    last = now;
    SHOW[open]?.();
  }

  function choose(name) {
    open = name;
    for (const tab of tabs) {
      const on = tab.dataset.tab === name;
      tab.setAttribute("aria-selected", on);
      tab.tabIndex = on ? 0 : -1;
      byId(tab.dataset.tab).hidden = !on;
    }
    if (FIGURED) show();
  }

  const tabs = [...document.querySelectorAll("#tabs button")];
  for (const tab of tabs) {
    tab.hidden = !USED[tab.dataset.tab];
    if (!tab.hidden) ONCE[tab.dataset.tab]?.();
    tab.onclick = () => choose(tab.dataset.tab);
    tab.onkeydown = (event) => {
      const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!way) return;
      event.preventDefault();
      event.stopPropagation();
      const some = tabs.filter((one) => !one.hidden), next = some[(some.indexOf(tab) + way + some.length) % some.length];
      next.focus();
      choose(next.dataset.tab);
    };
  }
  page.onChange(show);
  choose(DATA.judged ? "findings" : "joints");
  return { choose };
})();
