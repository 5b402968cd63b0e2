"""Lengths that a clip tells by itself: from starts that are off, one calibrated camera, from the side, front and back.

    python benchmarks/clip_lengths.py CAPTURE.npz [--frames 100] [--noise 2] [--off 0.1] [--clips 0,8,13] [--placed]

The capture is an NPZ as `posekit synth mocap` reads it; the true lengths are each clip's medians. Every length of the
start is off by up to `--off`, and all of them once more by as much. Necks are given, or with `--placed` are not. A clip
is recovered as `posekit recover` does it; errors are those of the logarithms after the limbs' common factor. The prior
of postures is the built-in one, which was fitted to these clips of one person: nothing is held out.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from posekit import recover
from posekit.body import load_figure
from posekit.formats.markdown import table_lines
from posekit.formats.own import View
from posekit.skeleton import SEGMENT_NAMES
from posekit.synthesis import CameraSphere, Capture, SyntheticScene, read_capture
from posekit.synthesis.camera_sphere import CameraPlacements
from posekit.synthesis.mocap import clip_lengths
from posekit.synthesis.observe import observe
from posekit.synthesis.viewpoints import look_at
from posekit.views.builtin import view_of

Floats = NDArray[np.float64]

SIDES = ("side", "front", "back")
CAMERA_HEIGHT, CAMERA_DISTANCE = 1.3, 4.5
LIMB_ENDS = ("elbow", "wrist", "knee", "ankle")
IS_LIMB = np.array([name.endswith(LIMB_ENDS) for name in SEGMENT_NAMES])


def scene_of(capture: Capture, clip: int, side: str, frames: int) -> SyntheticScene:
    """See the middle of a clip from one side of the person, by a camera that stands still."""
    rows = capture.frames_of(clip, complete=True)
    count = min(frames, len(rows))
    rows = rows[(len(rows) - count) // 2 :][:count]
    points, up = capture.points[rows], capture.up
    left = np.nanmean(points[:, 2] - points[:, 1], axis=0)
    left -= up * (left @ up)
    left /= np.linalg.norm(left)
    forward = np.cross(left, up)
    towards = {"side": left, "front": forward, "back": -forward}[side]
    flat = points.reshape(-1, 3)
    middle = (np.nanmin(flat, axis=0) + np.nanmax(flat, axis=0)) / 2
    away = CAMERA_DISTANCE + (0.0 if side == "side" else 0.6 * np.nanmax((flat - middle) @ towards))
    position = middle + towards * away
    position += up * (np.nanmin(flat @ up) + CAMERA_HEIGHT - position @ up)
    R = look_at(position, middle, up)
    placements = CameraPlacements(
        R_cam_world=np.broadcast_to(R, (count, 3, 3)), position=np.broadcast_to(position, (count, 3))
    )
    figure = load_figure().scaled(clip_lengths(points))
    time = np.arange(count) / float(capture.fps[clip])
    return observe(figure, CameraSphere().camera, points, placements, time=time)


def view_with(
    scene: SyntheticScene, lengths: Floats, noise: float, off: float, rng: np.random.Generator
) -> View:
    """Make the view of a scene whose `lengths` (17,) are stated wrongly."""
    factors = rng.uniform(1 - off, 1 + off, len(lengths)) * rng.uniform(1 - off, 1 + off)
    stated = dict(zip(SEGMENT_NAMES, (lengths * factors).tolist(), strict=True))
    return replace(view_of(scene.with_noise(noise, rng)), lengths=stated, deviation=noise)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("capture", type=Path)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--noise", type=float, default=2.0, help="pixels")
    parser.add_argument("--off", type=float, default=0.1, help="as a fraction")
    parser.add_argument("--clips", help="numbers from 0; all if not given")
    parser.add_argument("--placed", action="store_true", help="do not give the necks")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    capture, rng = read_capture(given.capture), np.random.default_rng(given.seed)
    clips = range(len(capture.names)) if given.clips is None else map(int, given.clips.split(","))
    found: dict[str, list[tuple[Floats, Floats, Floats, float]]] = {side: [] for side in SIDES}
    for clip in clips:
        for side in SIDES:
            scene = scene_of(capture, clip, side, given.frames)
            true = np.array([scene.figure.lengths[name] for name in SEGMENT_NAMES])
            view = view_with(scene, true, given.noise, given.off, rng)
            if given.placed:
                view = replace(view, root=np.empty((0,)))
            recovery = recover(view)
            said = recovery.settings.get("one_body")
            if said is None:
                print(f"{capture.names[clip]} from the {side}: no body was found")
                continue
            names = ("start", "lengths")
            start, error = (
                np.log([said[one][name] for name in SEGMENT_NAMES]) - np.log(true) for one in names
            )
            deviation = np.array([said["deviation"][name] for name in SEGMENT_NAMES])
            empty = float(np.mean([not len(frame) for frame in recovery.frames]))
            aligned = [one - np.median(one[IS_LIMB]) for one in (start, error)]
            found[side].append((*aligned, deviation, empty))
            worst = 100 * np.abs(aligned[1][IS_LIMB]).max()
            print(f"{capture.names[clip]} from the {side}: worst limb {worst:.1f} %", flush=True)
    rows = []
    for side, each in found.items():
        if not each:
            continue
        start, error, deviation = (np.stack([one[k] for one in each]) for k in range(3))
        limbs, trunk = np.abs(error[:, IS_LIMB]), np.abs(error / deviation)[:, ~IS_LIMB]
        bound = 0.02 if side == "side" else 0.03
        rows.append(
            [
                side,
                f"{np.median(np.abs(start[:, IS_LIMB])):.1%}",
                f"{np.median(limbs):.1%} ({np.quantile(limbs, 0.95):.1%})",
                f"{np.mean(limbs <= bound):.0%}",
                f"{np.mean(limbs / deviation[:, IS_LIMB] < 1.96):.0%}",
                f"{np.mean(trunk < 1.96):.0%}",
                f"{np.mean([one[3] for one in each]):.1%}",
            ]
        )
    head = ["from", "limbs at the start", "limbs, median (95 %)", "within 2 % (side) or 3 %"]
    head += ["limbs in their 95 %", "others in theirs", "frames empty"]
    print("\n".join(table_lines(head, rows)))


if __name__ == "__main__":
    main()
