// Time line with the certainty of each frame; play, pause and speed; keys of the whole page.
"use strict";
const play = (() => {
  const { byId } = page.tools, { state } = page, last = DATA.frames.length - 1;
  const USUAL_RATE = 30, LONGEST_STEP = 1;
  const gap = (k) => (DATA.frames[k + 1].clip === DATA.frames[k].clip ? DATA.frames[k + 1].time - DATA.frames[k].time : NaN);
  const gaps = DATA.frames.slice(1).map((_, k) => gap(k)).filter((one) => one > 0).sort((a, b) => a - b);
  const usual = gaps.length ? Math.min(gaps[gaps.length >> 1], LONGEST_STEP) : 1 / USUAL_RATE;
  // Time at which each frame is shown: the recorded time, with gaps shortened to one second.
  const starts = [0];
  for (let k = 0; k < last; k++) starts.push(starts[k] + (gap(k) > 0 ? Math.min(gap(k), LONGEST_STEP) : usual));
  const whole = starts[Math.max(last, 0)] + usual;
  let clock = 0, before = 0;

  const frameAt = (time) => Math.max(0, starts.findLastIndex((one) => one <= time));

  function step(now) {
    if (!state.playing) return;
    clock = (clock + (Math.min(now - before, 250) / 1000) * Number(byId("speed").value)) % whole;
    before = now;
    const next = frameAt(clock);
    if (next !== state.frame) page.chooseFrame(next);
    requestAnimationFrame(step);
  }

  function toggle() {
    if (last < 1) return;
    state.playing = !state.playing;
    byId("play").textContent = state.playing ? "⏸" : "▶";
    byId("play").setAttribute("aria-label", state.playing ? "pause" : "play");
    if (!state.playing) return page.refresh();
    clock = state.frame === last ? 0 : starts[state.frame];
    before = performance.now();
    requestAnimationFrame(step);
  }

  function go(index) {
    if (!FIGURED) return;
    page.chooseFrame(index);
    clock = starts[state.frame];
  }

  // The height of a bar is the certainty of its frame. Frames without a posture have no bar; marks on top are findings.
  function drawStrip() {
    const strip = byId("strip"), pen = strip.getContext("2d"), wide = strip.clientWidth, high = strip.clientHeight;
    strip.width = wide;
    strip.height = high;
    DATA.frames.forEach((one, k) => {
      const x = (k / (last + 1)) * wide, width = Math.max(1, wide / (last + 1)), sure = one.sure ?? (one.held ? 0.35 : 0);
      pen.fillStyle = "#9bb8d3";
      pen.fillRect(x, high - sure * (high - 6), width + 0.3, sure * (high - 6));
      if (!one.findings) return;
      pen.fillStyle = "#d4006a";
      pen.fillRect(x, 0, Math.max(width, 2), 5);
    });
  }

  function among(way) {
    const order = page.sorted();
    page.chooseSurvivor(order[order.indexOf(state.survivor) + way]);
  }

  function faster(way) {
    const speed = byId("speed");
    speed.selectedIndex = Math.min(Math.max(speed.selectedIndex + way, 0), speed.options.length - 1);
  }

  const KEYS = {
    " ": toggle,
    ArrowDown: () => among(1),
    ArrowUp: () => among(-1),
    ArrowRight: () => go(state.frame + 1),
    ArrowLeft: () => go(state.frame - 1),
    PageDown: () => go(state.frame + 10),
    PageUp: () => go(state.frame - 10),
    Home: () => go(0),
    End: () => go(last),
    l: () => page.choosePath(DATA.paths ? 0 : null),
    1: () => scene.look("free"),
    2: () => byId("look-camera").hidden || scene.look("camera"),
    3: () => scene.look("side"),
    4: () => scene.look("above"),
    b: () => scene.show("bodies"),
    a: () => scene.show("others"),
    c: () => scene.show("rays"),
    t: () => scene.show("truth"),
    ",": () => faster(-1),
    ".": () => faster(1),
    "?": () => tables.choose("keys"),
  };

  document.addEventListener("keydown", (event) => {
    const { target } = event;
    if (!FIGURED || event.ctrlKey || event.altKey || event.metaKey || target instanceof HTMLSelectElement) return;
    if (target instanceof HTMLInputElement && (target.type === "range" || event.key === " ")) return;
    if (target instanceof HTMLButtonElement && event.key === " ") return;
    if (!(event.key in KEYS)) return;
    event.preventDefault();
    KEYS[event.key]();
  });
  byId("time").hidden = last < 1;
  byId("frame").max = Math.max(last, 0);
  byId("frame").oninput = (event) => go(Number(event.target.value));
  byId("play").onclick = toggle;
  byId("strip").onclick = (event) => go(Math.floor((event.offsetX / byId("strip").clientWidth) * (last + 1)));
  if (FIGURED) new ResizeObserver(drawStrip).observe(byId("strip"));
  go(0);
  return { toggle, go };
})();
page.state.drawn = true;
