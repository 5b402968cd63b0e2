// Flips by hand (Taylor 2000, section 3.1): which end of each segment is nearer. Every combination is drawn at once, and
// what became of it is said: it survives, a check rejected it, or this page does not know, and which command does.
"use strict";
const hand = (() => {
  const { byId, element, words, percent } = page.tools, { state } = page, FLAT = 1e-4, MOST_REASONS = 3;
  const LEVEL = DATA.refined ? 0.05 : FLAT; // metres: photographs leave open which end is nearer by less
  const said = new Map(); // what was chosen by hand, frame by frame, as the file has it
  const branches = new Map();
  let verdict = { line: "" };

  const base = () => Math.max(state.survivor, 0);
  const signs = () => state.hand ?? page.frame().family.signs[base()];
  const of = (survivor) => `${state.frame} ${survivor}`;
  const usable = () => Boolean(page.frame().family && page.frame().held && state.survivor >= 0);
  const turnable = ({ steps }) => steps.every((step) => signs()[step] !== "r");

  // How much deeper the second end of a segment is than its first, metres.
  function deeper({ joints }) {
    const all = scene.points(), depth = (some) => some.reduce((sum, joint) => sum + all[joint].reduce((part, value, k) => part + value * DATA.camera.forward[k], 0), 0) / some.length;
    return joints.flat().every((joint) => all[joint]) ? depth(joints[1]) - depth(joints[0]) : 0;
  }

  // The branches that checks pruned in this frame, by their choices.
  function prunedOf(frame) {
    if (!branches.has(frame)) {
      const found = new Map();
      for (let k = 0; k < (frame.pruned ?? 0); k++) {
        const [branch, ...rest] = pack.pruned(frame, k), text = branch.toString(2).slice(1);
        (found.get(text) ?? found.set(text, []).get(text)).push(rest);
      }
      branches.set(frame, found);
    }
    return branches.get(frame);
  }

  // What rejected a combination, or the survivor that it comes to where a segment lies so level that both ends are one.
  function judged(all) {
    const frame = page.frame(), { signs: known } = frame.family, scaleNow = lift.scaleOf(frame.family, base());
    const own = (index) => lift.scaleOf(frame.family, index) === scaleNow;
    for (let index = 0; index < frame.held; index++) if (known[index] === all && own(index)) return { survivor: index };
    const pruned = prunedOf(frame), seen = new Set(), steps = DATA.flips.levels;
    if (steps.some((step) => all[step] === undefined || all[step] === "r")) return {};
    let code = steps.map((step) => all[step]).join("");
    while (!seen.has(code)) {
      seen.add(code);
      const found = [], coincident = [];
      for (let long = 0; long <= code.length; long++) {
        for (const one of pruned.get(code.slice(0, long)) ?? []) (DATA.reasons[one[0]][0] === "coincident" ? coincident : found).push(DATA.reasons[one[0]][0] === "coincident" ? long : one);
      }
      for (let index = 0; index < frame.held; index++) if (pack.branch(frame, index) === code && own(index)) return { survivor: index, same: true };
      // A posture and its twin with the trunk turned are one: what rejected the other says more.
      const telling = found.filter(([reason]) => DATA.reasons[reason][1] !== "twin");
      if (telling.length || (found.length && !coincident.length)) return { reasons: telling.length ? telling : found };
      if (!coincident.length) return {};
      const at = coincident[0] - 1;
      code = code.slice(0, at) + (code[at] === "1" ? "0" : "1") + code.slice(at + 1);
    }
    return {};
  }

  function reasonText([reason, value, bound]) {
    const [check, where, unit] = DATA.reasons[reason], [scale, shown] = { m: [1000, "mm"], deg: [1, "°"] }[unit] ?? [1, unit];
    const number = (one) => Number((one * scale).toPrecision(3));
    const text = `${words(check)}, ${words(where)}`;
    return Number.isNaN(value) || Number.isNaN(bound) ? text : `${text}: ${number(value)}${shown && ` ${shown}`} (bound ${number(bound)}${shown && ` ${shown}`})`;
  }

  function describe({ survivor, same, reasons }) {
    const frame = page.frame();
    if (survivor !== undefined) {
      const share = pack.probability(frame, survivor);
      return { kind: "survives", line: `survives: posture ${pack.number(frame, survivor)}${share === undefined ? "" : `, ${percent(share)}`}${same ? "; these flips come to this one, as a segment lies level" : ""}` };
    }
    if (reasons) {
      if (reasons.some(([reason]) => DATA.reasons[reason][1] === "unlisted")) return { kind: "unlisted", line: `not listed: further postures hold ${percent(frame.unlisted)} at most; recover with --coverage 1 to list it` };
      // Of several postures of these flips (trunk turned, other scales) one is told for each reason.
      const texts = [...new Map(reasons.map((one) => [one[0], one])).values()].map(reasonText);
      return { kind: "rejected", line: `rejected: ${texts.slice(0, MOST_REASONS).join("; ")}${frame.family.scales.length > 1 ? " (at one of its scales)" : ""}` };
    }
    if (frame.complete && frame.held === frame.count) return { kind: "rejected", line: "rejected: all that survive are listed, and it is not among them; recover with --explain to see by which check" };
    return { kind: "unknown", line: "not among the postures of this page: save the file and let posekit judge it, or recover with --explain" };
  }

  // Turns a segment, and shows what comes of it.
  function toggle(number) {
    const one = DATA.flips.segments[number];
    if (!usable() || !turnable(one)) return;
    if (state.path !== null) page.chooseSurvivor(state.survivor);
    const next = [...signs()];
    for (const step of one.steps) next[step] = next[step] === "1" ? "0" : "1";
    const found = judged(next.join(""));
    verdict = { ...describe(found), of: of(found.survivor) };
    if (found.survivor !== undefined) page.chooseSurvivor(found.survivor);
    else page.chooseFlips(next.join(""));
    said.set(page.frame().number, nearer());
    show();
  }

  // The nearer end of each segment that is not level, as the file has it.
  function nearer() {
    const found = {};
    for (const one of DATA.flips.segments) {
      const deep = turnable(one) ? deeper(one) : 0;
      if (Math.abs(deep) > LEVEL) found[one.name] = one.ends[deep > 0 ? 0 : 1];
    }
    return found;
  }

  function file() {
    const chosen = new Map(said);
    if (usable()) chosen.set(page.frame().number, nearer());
    return { schema: "posekit.nearer/1", frames: Array.from({ length: DATA.flips.frames }, (_, k) => chosen.get(k) ?? {}) };
  }

  function save() {
    const link = element("a"), url = URL.createObjectURL(new Blob([`${JSON.stringify(file(), null, 1)}\n`], { type: "application/json" }));
    link.href = url;
    link.download = "nearer.json";
    document.body.append(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
  }

  const buttons = [];
  function show() {
    const able = usable();
    byId("flips-list").hidden = byId("flips-save").parentNode.hidden = !able;
    if (!able) {
      byId("flips-verdict").textContent = "No posture of this frame can be turned.";
      byId("flips-note").textContent = "";
      return;
    }
    if (state.hand === null && verdict.of !== of(base())) verdict = { ...describe({ survivor: base() }), of: of(base()) };
    DATA.flips.segments.forEach((one, k) => {
      const free = turnable(one), deep = free ? deeper(one) : 0, level = Math.abs(deep) < FLAT;
      buttons[k].disabled = !free || level;
      buttons[k].textContent = `${words(one.name).replace("-", " – ")}: ${!free ? "not seen" : level ? "level" : `${words(one.ends[deep > 0 ? 0 : 1])} nearer`}`;
    });
    byId("flips-verdict").textContent = verdict.line;
    byId("flips-verdict").dataset.kind = verdict.kind;
    byId("flips-back").disabled = state.survivor === 0 && state.hand === null;
    const others = [...said.keys()].filter((number) => number !== page.frame().number);
    byId("flips-note").textContent = `The file says the nearer end of each segment of the posture that is drawn${DATA.refined ? ", where it is 5 cm deep" : ""}${others.length ? `, and of those chosen by hand in ${others.length === 1 ? "frame" : "frames"} ${others.sort((a, b) => a - b).join(", ")}` : ""}. posekit judges it by: posekit recover VIEW --nearer nearer.json -o RESULT`;
  }

  function open() {
    tables.choose("flips");
    byId("flips").scrollIntoView({ block: "nearest" });
    if (document.activeElement?.id !== "picture") buttons.find((one) => !one.disabled)?.focus();
  }

  for (const [k, one] of (DATA.frames.some((each) => each.family) ? DATA.flips.segments : []).entries()) {
    const made = element("button", words(one.name));
    made.type = "button";
    made.onclick = () => toggle(k);
    buttons.push(made);
    byId("flips-list").append(made);
  }
  byId("flips-save").onclick = save;
  byId("flips-back").onclick = () => page.choosePath(DATA.paths ? 0 : null);
  page.onChange(() => byId("flips").hidden || show());

  return {
    toggle, judged, file, open,
    click: (number) => {
      if (!usable()) return;
      tables.choose("flips");
      toggle(number);
    },
    said: () => `by hand – ${verdict.line}`, verdict: () => verdict, deeper, show,
  };
})();
