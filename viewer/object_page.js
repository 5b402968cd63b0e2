// The frames of an object and the postures of each: one is drawn, or all of the frame in each other.
const objectPage = (() => {
  const get = (id) => document.getElementById(id);
  const state = { frame: 0, posture: null };

  function draw() {
    OBJECT.forEach((frame, k) => {
      posekit.show(`/meshcat/frame-${k}`, k === state.frame);
      if (k !== state.frame) return;
      for (const [number] of frame.postures)
        posekit.show(`/meshcat/frame-${k}/posture-${number}`, state.posture === null || state.posture === number);
    });
    viewer.set_dirty();
    const here = OBJECT[state.frame];
    get("frame-said").textContent = `${here.number} (${here.time.toFixed(3)} s)`;
    const chosen = here.postures.find(([number]) => number === state.posture);
    get("posture-said").textContent = chosen ? `posture ${chosen[0]}: ${chosen[1]}`
      : here.postures.length ? "all postures of the frame, in each other" : here.none;
    for (const button of get("postures").children)
      button.setAttribute("aria-pressed", button.dataset.posture === String(state.posture));
  }

  function choosePosture(number) {
    state.posture = number;
    draw();
  }

  function chooseFrame(k) {
    state.frame = k;
    const here = OBJECT[k], names = here.postures.map(([number]) => number);
    state.posture = names.length ? names[0] : null;
    get("postures").replaceChildren(...[...names, ...(names.length > 1 ? [null] : [])].map((number) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = number === null ? "all" : String(number);
      button.dataset.posture = String(number);
      button.onclick = () => choosePosture(number);
      return button;
    }));
    draw();
  }

  get("frame-row").hidden = OBJECT.length < 2;
  get("frame").oninput = () => chooseFrame(Number(get("frame").value));
  chooseFrame(0);
  return { state, chooseFrame, choosePosture };
})();
