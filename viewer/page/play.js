// Time: the line with how sure each frame is, play and pause, speed; and the keys of the whole page.
"use strict";
const play = (() => {
  const { byId } = page.tools, { state } = page, last = DATA.frames.length - 1;
  const USUAL_RATE = 30, LONGEST_STEP = 1;
  const gaps = DATA.frames.slice(1).map((one, k) => one.time - DATA.frames[k].time).filter((gap) => gap > 0).sort((a, b) => a - b);
  const usual = gaps.length ? Math.min(gaps[gaps.length >> 1], LONGEST_STEP) : 1 / USUAL_RATE;
  // When each frame is shown: as it was recorded, but for gaps, which are no longer than a second.
  const starts = [0];
  for (let k = 0; k < last; k++) {
    const gap = DATA.frames[k + 1].time - DATA.frames[k].time;
    starts.push(starts[k] + (gap > 0 ? Math.min(gap, LONGEST_STEP) : usual));
  }
  const whole = starts[last] + usual;
  let clock = 0, before = 0;

  function frameAt(time) {
    let [low, high] = [0, last];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (starts[middle] <= time) low = middle;
      else high = middle - 1;
    }
    return low;
  }

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
    page.chooseFrame(index);
    clock = starts[state.frame];
  }

  // How sure each frame is, as high as it is sure; frames without a posture are empty, findings are marks on top.
  function drawStrip() {
    const strip = byId("strip"), pen = strip.getContext("2d"), wide = strip.clientWidth, high = strip.clientHeight;
    strip.width = wide;
    strip.height = high;
    DATA.frames.forEach((one, k) => {
      const x = (k / (last + 1)) * wide, width = Math.max(1, wide / (last + 1));
      pen.fillStyle = "#9bb8d3";
      const sure = one.answer ? one.answer.sure : one.held ? 0.35 : 0;
      pen.fillRect(x, high - sure * (high - 6), width + 0.3, sure * (high - 6));
      if (one.findings) {
        pen.fillStyle = "#d4006a";
        pen.fillRect(x, 0, Math.max(width, 2), 5);
      }
    });
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
    f: () => byId("flips-tab").hidden || hand.open(),
    b: () => scene.show("bodies"),
    a: () => scene.show("others"),
    c: () => scene.show("rays"),
    t: () => scene.show("truth"),
    ",": () => faster(-1),
    ".": () => faster(1),
    "?": () => {
      tables.choose("keys");
      byId("keys").scrollIntoView({ block: "nearest" });
    },
  };

  function among(way) {
    const order = page.sorted();
    page.chooseSurvivor(order[order.indexOf(state.survivor) + way]);
  }

  function faster(way) {
    const speed = byId("speed");
    speed.selectedIndex = Math.min(Math.max(speed.selectedIndex + way, 0), speed.options.length - 1);
  }

  document.addEventListener("keydown", (event) => {
    const { target } = event;
    if (event.ctrlKey || event.altKey || event.metaKey || target instanceof HTMLSelectElement) return;
    if (target instanceof HTMLInputElement && (target.type === "range" || event.key === " ")) return;
    if (target instanceof HTMLButtonElement && event.key === " ") return;
    if (!(event.key in KEYS)) return;
    event.preventDefault();
    KEYS[event.key]();
  });
  byId("time").hidden = last < 1;
  byId("frame").max = last;
  byId("frame").oninput = (event) => go(Number(event.target.value));
  byId("play").onclick = toggle;
  byId("strip").onclick = (event) => go(Math.floor((event.offsetX / byId("strip").clientWidth) * (last + 1)));
  new ResizeObserver(drawStrip).observe(byId("strip"));
  page.chooseFrame(0);
  return { toggle, go };
})();
scene.draw();
page.state.drawn = true;
// Milliseconds from the page being asked for; the picture is shown with the next frame of the browser.
requestAnimationFrame(() => setTimeout(() => (page.state.firstPicture = performance.now())));
