// What a report says, laid out. All texts come from files of others: they go in as text, never as markup.

function make(name, options, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(options || {})) {
    if (key === "class") element.className = value;
    else if (key.startsWith("aria") || key === "type") element.setAttribute(key, value);
    else element[key] = value;
  }
  element.append(...children);
  return element;
}

const percent = (part, whole) => `${(100 * part / Math.max(whole, 1)).toFixed(1)} %`;
const spanName = span => span.where ? `${span.check}/${span.where}` : span.check;
const spanFrames = span => span.last > span.first ? `frames ${span.first} to ${span.last}` : `frame ${span.first}`;
const withUnit = (value, unit) => value === null ? "not known" : `${value} ${unit}`;

function showChecks(data, total, what) {
  const head = make("tr", {}, make("th", {}, "check"), make("th", { class: "number" }, what), make("th", { class: "bars" }));
  if (data.clip_counts) head.append(make("th", { class: "number" }, "clips"));
  head.append(make("th", { class: "number" }, "undecided"), make("th", {}, "most often"));
  document.getElementById("checks-head").append(head);
  const most = Math.max(1, ...data.checks.map(check => check.rejected));
  const says = data.checks.filter(check => check.rejected || check.undecided);
  const content = data.checks.filter(check => !says.includes(check)).map(check => check.name);
  const silent = document.getElementById("silent");
  if (content.length) silent.append(make("p", {}, `Nothing is rejected by ${content.join(", ")}.`));
  for (const line of data.not_asked) silent.append(make("p", {}, `Not asked: ${line}.`));
  for (const check of says.sort((a, b) => b.rejected - a.rejected)) {
    const bar = make("span", { class: "bar" });
    bar.style.width = `${100 * check.rejected / most}%`;
    const row = make("tr", {}, make("td", {}, check.name),
      make("td", { class: "number" }, `${check.rejected} (${percent(check.rejected, total)})`),
      make("td", { class: "bars" }, bar));
    if (data.clip_counts) row.append(make("td", { class: "number" }, String(check.clips)));
    row.append(make("td", { class: "number" }, String(check.undecided)),
      make("td", { class: "most" }, check.places.map(([where, count]) => `${where} ${count}`).join(", ")));
    document.getElementById("checks").append(row);
  }
}

// Lanes are checks, the horizontal is frames; above them the longest good span.
function timeline(clip, choose) {
  const checks = [...new Set(clip.spans.map(span => span.check))];
  const width = Math.max(260, Math.min(960, document.querySelector("main").clientWidth - 56));
  const left = Math.min(110, width / 3.4), lane = 15, top = 8, bottom = 18;
  const height = top + checks.length * lane + bottom;
  const picture = svgElement("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `timeline of ${clip.frames} frames` });
  const first = Math.min(clip.spans.length ? Math.min(...clip.spans.map(span => span.first)) : 0, clip.good.length ? clip.good[0] : 0, 0);
  const last = Math.max(clip.frames, ...clip.spans.map(span => span.last + 1), clip.good.length ? clip.good[1] + 1 : 0);
  const x = frame => left + (width - left - 4) * (frame - first) / Math.max(last - first, 1);
  const hatch = `hatch-${timeline.count = (timeline.count || 0) + 1}`;
  const pattern = svgElement("pattern", { id: hatch, width: 4, height: 4, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" }, svgElement("defs", {}, picture));
  svgElement("rect", { width: 2, height: 4, fill: "#9a9a9a" }, pattern);
  if (clip.good.length)
    svgElement("rect", { class: "good", x: x(clip.good[0]), y: 1, width: Math.max(1, x(clip.good[1] + 1) - x(clip.good[0])), height: 4 }, picture);
  checks.forEach((check, k) => {
    const y = top + k * lane;
    svgElement("rect", { class: "lane", x: left, y: y + 1, width: width - left - 4, height: lane - 2 }, picture);
    const label = svgElement("text", { x: left - 6, y: y + 11, "text-anchor": "end" }, picture);
    label.textContent = check.length > 17 ? `${check.slice(0, 16)}…` : check;
  });
  clip.spans.forEach((span, k) => {
    const y = top + checks.indexOf(span.check) * lane + 1;
    const options = { x: x(span.first), y, width: Math.max(2, x(span.last + 1) - x(span.first)), height: lane - 2, class: `span ${span.verdict}`, "data-span": k };
    if (span.verdict === "undecided") options.fill = `url(#${hatch})`;
    const mark = svgElement("rect", options, picture);
    svgElement("title", {}, mark).textContent = `${spanName(span)}, ${spanFrames(span)}`;
    mark.addEventListener("click", () => choose(k));
  });
  for (const [frame, anchor] of [[first, "start"], [Math.round((first + last) / 2), "middle"], [last - 1, "end"]]) {
    const tick = svgElement("text", { x: anchor === "end" ? width - 4 : x(frame), y: height - 5, "text-anchor": anchor }, picture);
    const seconds = clip.seconds && clip.frames > 1 ? ` (${(clip.seconds * (frame - first) / (clip.frames - 1)).toFixed(1)} s)` : "";
    tick.textContent = `${frame}${seconds}`;
  }
  return picture;
}

function showClip(clip, skeleton) {
  const badge = make("b", { class: clip.verdict }, clip.verdict);
  const share = `: ${clip.bad} of ${clip.frames} frames (${percent(clip.bad, clip.frames)})`;
  const good = clip.good.length ? `; longest good span ${clip.good[0]} to ${clip.good[1]}` : "; no valid frame";
  const card = make("article", {}, make("h3", {}, clip.name, " ", badge), make("p", { class: "soft" }, share.slice(2) + " are not valid" + good));
  const buttons = make("div", { class: "spans" });
  const box = make("div", { class: "frame", hidden: true });
  function choose(k) {
    const span = clip.spans[k];
    card.querySelectorAll(".span").forEach(mark => mark.classList.toggle("chosen", Number(mark.dataset.span) === k));
    buttons.querySelectorAll("button").forEach((button, j) => button.setAttribute("aria-pressed", String(j === k)));
    const facts = [["check", spanName(span)], ["verdict", span.verdict], ["frames", `${span.first} to ${span.last}`]];
    if (span.start !== null && span.end !== null) facts.push(["time", `${span.start} to ${span.end} s`]);
    if (span.places.length > 1) facts.push(["places", span.places.join(", ")]);
    facts.push(["worst in frame", String(span.worst)]);
    if (span.verdict === "invalid") facts.push(["value", withUnit(span.value, span.unit)], ["bound", withUnit(span.bound, span.unit)]);
    const list = make("dl", {}, ...facts.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
    const still = clip.stills[span.worst];
    box.replaceChildren(still ? stickFigure(still, span.joints, skeleton) : make("p", {}, "This frame's joints are not in the page."), list);
    if (still) box.append(make("p", {}, "Right side orange, left side blue; the frame before is grey, what is marked is ringed. Drag to turn."));
    box.hidden = false;
  }
  card.append(timeline(clip, choose));
  const shown = 12;
  function list(from, to) {
    clip.spans.slice(from, to).forEach((span, k) => {
      const worst = span.value === null ? "" : `: ${withUnit(span.value, span.unit)}`;
      const button = make("button", { type: "button", "aria-pressed": "false" }, `${spanName(span)}, ${spanFrames(span)}${worst}`);
      button.addEventListener("click", () => choose(from + k));
      buttons.append(button);
    });
  }
  list(0, shown);
  const left = Math.max(clip.spans.length - shown, 0);
  const unlisted = clip.more ? make("span", { class: "soft" }, `and ${clip.more} that are not listed`) : "";
  if (left) {
    const more = make("button", { type: "button", class: "soft" }, `${left} more`);
    more.addEventListener("click", () => { more.remove(); list(shown); buttons.append(unlisted); });
    buttons.append(more);
  } else buttons.append(unlisted);
  card.append(buttons, box);
  return card;
}

function showClips(data) {
  document.getElementById("clips-section").hidden = false;
  const select = document.getElementById("only");
  select.append(make("option", { value: "" }, "any check"), ...data.checks.filter(check => check.rejected || check.undecided).map(check => make("option", { value: check.name }, check.name)));
  const box = document.getElementById("clips");
  function fill() {
    const some = data.clips.filter(clip => !select.value || clip.spans.some(span => span.check === select.value));
    box.replaceChildren(...some.map(clip => showClip(clip, data.skeleton)));
    if (!some.length) box.append(make("p", {}, data.clips.length ? "None of those shown." : "None: all clips are valid."));
  }
  select.addEventListener("change", fill);
  let width = innerWidth;
  addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; fill(); } });
  fill();
  if (data.named.length) {
    const named = document.getElementById("named-box");
    named.hidden = false;
    named.querySelector("summary").textContent = `${data.named.length} more that are not valid`;
    for (const clip of data.named)
      document.getElementById("named").append(make("tr", {}, make("td", {}, clip.name), make("td", {}, clip.verdict), make("td", { class: "number" }, `${clip.bad} of ${clip.frames}`)));
  }
  if (data.unnamed) document.getElementById("more").textContent = `${data.unnamed} further clips that are not valid are not named here.`;
}

function showReport(data) {
  document.getElementById("title").textContent = data.title;
  const sum = counts => Object.values(counts).reduce((a, b) => a + b, 0);
  const counted = (counts, thing) => `${sum(counts).toLocaleString("en")} ${thing}${sum(counts) === 1 ? "" : "s"}`;
  const total = sum(data.postures), thing = data.clip_counts ? "frame" : "posture", what = `${thing}s`;
  const said = counts => Object.entries(counts).map(([verdict, count]) => `${count.toLocaleString("en")} ${verdict}`).join(", ");
  let lead = `${counted(data.postures, thing)}: ${said(data.postures)}.`;
  if (data.clip_counts) lead = `${counted(data.clip_counts, "clip")}: ${said(data.clip_counts)}. ${lead}`;
  document.getElementById("lead").textContent = lead;
  if (data.settings.why) document.getElementById("lead").after(make("p", {}, data.settings.why));
  showChecks(data, total, what);
  if (data.clip_counts) showClips(data);
  document.getElementById("refused-section").hidden = !data.refused.length;
  for (const line of data.refused) document.getElementById("refused").append(make("li", {}, line));
  document.getElementById("repair-section").hidden = !data.repair.length;
  for (const row of data.repair)
    document.getElementById("repair").append(make("tr", {}, ...row.map(cell => make("td", {}, cell))));
  if (data.rows.length) {
    document.getElementById("postures-section").hidden = false;
    for (const row of data.rows)
      document.getElementById("postures").append(make("tr", {}, make("td", {}, String(row.posture)), make("td", {}, row.verdict), make("td", {}, row.why.join("; "))));
  }
  for (const [name, value] of Object.entries(data.settings))
    document.getElementById("settings").append(make("tr", {}, make("td", { class: "soft" }, name), make("td", {}, value)));
}
