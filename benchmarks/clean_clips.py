"""Clips of recordings without known faults, half of them for setting thresholds.

    python -m benchmarks.clean_clips CAPTURE.npz [FILE ...]

A file is anything that `benchmarks/people.py` reads. What the recordings themselves have wrong is left out
(`KNOWN_FAULTS`): checks name those too, and rightly.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.people import people
from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS
from posekit.validators.motion import MotionClip

KNOWN_FAULTS: Final[Mapping[str, slice]] = {
    # The legs whip about the pelvis, a metre a frame, in seven stretches; this one is sound.
    "train/directing_traffic_1": slice(520, 675),
    "train/basketball_1": slice(1, 160),  # held still from there to the end
    "humanoid3d_getup_facedown": slice(0, -1),  # the last frame is the one before
    "humanoid3d_getup_faceup": slice(0, -1),
}
"""Frames of clips that are kept where a recording has faults of its own."""

FIRST_POSE: Final = "train/"
"""Clips of CMU's, by what their names start with: the first frame of each is the skeleton's pose at rest."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CleanClip:
    """A clip without known faults.

    Parameters
    ----------
    name : str
        Of the clip.
    clip : MotionClip
        What is recorded.
    thresholds : bool
        Whether thresholds may be set on it: clips with even numbers.
    """

    name: str
    clip: MotionClip
    thresholds: bool


def clean_clips(paths: Sequence[str | Path]) -> list[CleanClip]:
    """Read clean clips of captures; those with even numbers in their file are for thresholds."""
    found = []
    for path in paths:
        capture, feet = people(path), _feet(Path(path))
        for index, name in enumerate(capture.names):
            rows = np.flatnonzero(capture.clip == index)
            rows = rows[KNOWN_FAULTS.get(name, slice(1 if name.startswith(FIRST_POSE) else 0, None))]
            rate = float(capture.fps[index])
            clip = MotionClip(
                joints=capture.points[rows, : len(JOINTS)],
                head=capture.points[rows, len(JOINTS) :],
                feet=np.empty(0) if feet is None else feet[rows],
                time=np.arange(len(rows)) / rate,
                rate=rate,
                up=capture.up,
            )
            found.append(CleanClip(name=name, clip=clip, thresholds=index % 2 == 0))
    return found


def _feet(path: Path) -> Array | None:
    """Return right toe, left toe and unknown heels (T, 4, 3) of an NPZ that has toes."""
    if path.suffix != ".npz":
        return None
    with np.load(path, allow_pickle=False) as data:
        names = [str(name) for name in data.get("joint_names", ())]
        if "r_toe" not in names:
            return None
        feet = np.full((len(data["joints"]), 4, 3), np.nan)
        for k, name in enumerate(("r_toe", "l_toe")):
            feet[:, k] = data["joints"][:, names.index(name)]
        return feet


def lowest(clip: MotionClip) -> Array:
    """Return how high the lowest known point of each frame is (T,), metres."""
    points = np.concatenate([clip.joints, clip.feet], axis=1)
    return np.asarray(np.nanmin(points @ up_of(clip), axis=1))


def standing(clip: MotionClip) -> NDArray[np.bool_]:
    """Say in which frames a toe, or an ankle without toes, stands (T,): near the ground, slower than 0.1 m/s."""
    feet = clip.feet[:, :2]
    if np.isnan(feet).all():
        feet = clip.joints[:, [JOINT["right_ankle"], JOINT["left_ankle"]]]
    speed = np.linalg.norm(np.gradient(feet, axis=0), axis=-1) * clip.rate
    height = feet @ up_of(clip)
    ground = np.nanpercentile(height, 5)
    return np.asarray(((speed < 0.1) & (height < ground + 0.03)).any(axis=1))


def up_of(clip: MotionClip) -> Array:
    return np.zeros(3) if clip.up is None else clip.up


def main() -> None:
    if len(sys.argv) < 2:
        print("no capture given: python -m benchmarks.clean_clips CAPTURE.npz [FILE ...]")
        return
    for one in clean_clips(sys.argv[1:]):
        grounded = standing(one.clip).mean() if len(one.clip) > 1 else 0.0
        print(
            f"{one.name}: {len(one.clip)} frames at {one.clip.rate:.0f} Hz, {grounded:.0%} on a foot, "
            f"lowest {np.percentile(lowest(one.clip), 5) * 100:.1f} cm, "
            + ("for thresholds" if one.thresholds else "held out")
        )


if __name__ == "__main__":
    main()
