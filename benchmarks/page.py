"""The interactive page of 1,000 frames: seconds to the first picture, pictures a second while it plays, and its size.

Run: python benchmarks/page.py

Of a motion, and of what was recovered of a noisy view with its paths (40 frames of a walk, again and again). The
browser draws without a graphics card: as it does by itself, and with one that is imitated (SwiftShader). Pictures are
counted with the body alone and with all survivors; the first counts from the address being given.
"""

from __future__ import annotations

import dataclasses
import tempfile
import time
from pathlib import Path

import numpy as np

import posekit
from posekit.formats.held import HeldPostures
from posekit.formats.own import OpenCVModel, Postures, Result, View
from posekit.formats.own.paths import FollowedPaths
from posekit.recovery.sequences import follow
from posekit.skeleton import JOINTS
from posekit.synthesis import Walker, walker_scene
from posekit.viewer.browser.browser import Browser
from posekit.viewer.page import write_page
from posekit.views import view_of

N_FRAMES, N_RECOVERED, RATE = 1000, 40, 60.0
DEVIATION = 2.0
SECONDS_PLAYED = 4.0
FIRST_PICTURE = """new Promise((done) => {
  const look = () => (page.state.firstPicture ? done(page.state.firstPicture) : setTimeout(look, 5));
  look();
})"""
WINDOW_SIZES = ((1280, 800), (420, 800))


def main() -> None:
    recovered = recovered_walk()
    assert recovered.paths is not None
    long = repeated(recovered, N_FRAMES)
    assert long.paths is not None
    joints = long.paths.smoothed[0]
    motion = HeldPostures(
        postures=Postures(joints=joints),
        frame=np.arange(N_FRAMES),
        clip=np.zeros(N_FRAMES, dtype=np.intp),
        time=np.arange(N_FRAMES) / RATE,
        up="-y",
    )
    survivors = sum(len(frame.joints) for frame in long.frames)
    print(f"{N_FRAMES} frames; the recovered ones have {survivors:,} postures and {len(long.paths)} paths")
    with tempfile.TemporaryDirectory() as folder:
        for name, given in (("motion", motion), ("recovered", long)):
            page = Path(folder) / f"{name}.html"
            start = time.process_time()
            write_page(page, given)
            seconds = time.process_time() - start
            print(f"{name}: {page.stat().st_size / 1e6:.2f} MB, written in {seconds:.1f} s of processor time")
            for webgl in (False, True):
                for window in WINDOW_SIZES:
                    measure(page, window, webgl=webgl)


def measure(page: Path, window: tuple[int, int], *, webgl: bool) -> None:
    """Open a page in a browser of its own and play it; print what was found.

    Parameters
    ----------
    page : Path
        The file.
    window : (int, int)
        Its width and height, pixels.
    webgl : bool
        Whether the browser imitates a graphics card, through which it then draws everything.
    """
    with Browser(size=window, webgl=webgl) as browser:
        start = time.perf_counter()
        browser.open(page)
        whole = time.perf_counter() - start
        first = browser.evaluate(FIRST_PICTURE) / 1000
        rates = []
        for others in ("false", "true"):
            browser.evaluate(f"scene.show('others', {others}), 0")
            browser.evaluate("play.toggle(), window.before = [scene.pictures, performance.now()], 0")
            time.sleep(SECONDS_PLAYED)
            rates.append(
                browser.evaluate("(scene.pictures - before[0]) / (performance.now() - before[1]) * 1000")
            )
            browser.evaluate("play.toggle(), 0")
    card = "a card imitated" if webgl else "no graphics card"
    print(
        f"  {window[0]}x{window[1]}, {card}: first picture after {first:.2f} s (loaded {whole:.2f} s), plays "
        f"{rates[0]:.0f} pictures a second, {rates[1]:.0f} with all survivors"
    )


def recovered_walk() -> Result:
    """Recover a noisy view of the walker, and follow him."""
    truth = view_of(walker_scene(Walker(), frames=N_RECOVERED, dt=1 / RATE)).truth
    K = np.array([[1500.0, 0.0, 960.0], [0.0, 1500.0, 540.0], [0.0, 0.0, 1.0]])
    image = (truth @ K.T)[..., :2] / truth[..., 2:] + np.random.default_rng(18).normal(
        scale=DEVIATION, size=(N_RECOVERED, len(JOINTS), 2)
    )
    view = View(
        camera=OpenCVModel(K=K, size=(1920, 1080)),
        time=np.arange(N_RECOVERED) / RATE,
        image=image,
        root=truth[:, 0],
        lengths=posekit.builtin_view("seq1").lengths,
        deviation=DEVIATION,
    )
    recovery = posekit.recover(view)
    return posekit.result_of(recovery, following=follow(recovery, k=3))


def repeated(result: Result, count: int) -> Result:
    """Return a result of so many frames: those that there are, again and again.

    Parameters
    ----------
    result : Result
        With paths.
    count : int
        Frames.
    """
    index = np.resize(np.arange(len(result.frames)), count)
    frames = [dataclasses.replace(result.frames[row], time=k / RATE) for k, row in enumerate(index.tolist())]
    paths = result.paths
    assert paths is not None
    along = ("survivor", "joints", "smoothed", "interpolated", "deviation", "scale")
    longer = {name: getattr(paths, name)[:, index] for name in along}
    made: FollowedPaths = dataclasses.replace(paths, **longer)
    return dataclasses.replace(result, frames=frames, paths=made)


if __name__ == "__main__":
    main()
