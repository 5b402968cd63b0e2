"""Photographs without a camera, of people whose lengths nobody knows: empty frames, survivors, how near the best comes.

    python benchmarks/photographs.py [CAPTURE.npz] [--pictures 300] [--seed 0]

Perspective pictures (f = 1500 px, 2 px of noise) of twelve joints, recovered as of an unknown adult: of random legal
postures of the built-in figure, and, with a capture, of real ones of somebody else. Beside each the fixed tolerances
for photographs on the same pictures, with neck and pelvis seen. Prints what docs/how-to/uncalibrated.md sums up.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from posekit.body import load_figure
from posekit.formats.markdown import table_lines
from posekit.formats.own import ScaledOrthographicModel, View
from posekit.geometry import Array
from posekit.measures import pa_mpjpe
from posekit.recovery import recover
from posekit.recovery.recovery import FrameRecovery
from posekit.skeleton import JOINTS, PARENTS
from posekit.synthesis import CameraSphere, SyntheticScene, mocap_scenes, random_views, read_capture

SPHERE = CameraSphere(distance=(2.5, 6.0))
NOISE_PIXELS = 2.0
CLEARLY_OUT = np.sin(np.radians(20.0))
"""Of a segment's length, by which it stands out of the picture so far that its side counts."""

TWELVE = [k for k, name in enumerate(JOINTS) if name not in ("neck", "pelvis")]
LIMBS = np.arange(6, len(JOINTS))
STARTS = np.array(PARENTS)[LIMBS]


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of one picture: survivors, the best one's distance (m), whether one has all limbs' sides."""

    survivors: int
    best: float
    kept: bool


def outcome(frame: FrameRecovery, truth: Array) -> Outcome:
    """Compare the survivors of a picture with the true joints (14, 3), whose sides are those along the rays."""
    if not len(frame):
        return Outcome(survivors=0, best=np.nan, kept=False)
    target = np.broadcast_to(truth[TWELVE], (len(frame), len(TWELVE), 3))
    segment = truth[LIMBS] - truth[STARTS]
    along = np.einsum("ki,ki->k", segment, truth[STARTS]) / np.linalg.norm(truth[STARTS], axis=1)
    found = frame.joints[:, LIMBS, 2] - frame.joints[:, STARTS, 2]
    level = np.abs(along) < CLEARLY_OUT * np.linalg.norm(segment, axis=1)
    right = (np.sign(found) == np.sign(along)) | level
    best = float(np.nanmin(pa_mpjpe(frame.joints[:, TWELVE], target).value))
    return Outcome(survivors=len(frame), best=best, kept=bool(right.all(axis=1).any()))


def measured(scenes: Iterable[SyntheticScene], seed: int, *, refined: bool) -> tuple[list[Outcome], float]:
    """Recover all pictures, refined from twelve points or by tolerances from fourteen; with seconds a picture."""
    rng = np.random.default_rng(seed)
    found: list[Outcome] = []
    seconds = 0.0
    for scene in scenes:
        image = scene.image + NOISE_PIXELS * rng.standard_normal(scene.image.shape)
        if refined:
            image[:, [JOINTS.index("neck"), JOINTS.index("pelvis")]] = np.nan
        view = View(camera=ScaledOrthographicModel(scale=None), time=np.arange(len(scene)) / 30, image=image)
        begin = perf_counter()
        recovery = recover(view, infer=False, refine=None if refined else False)
        seconds += perf_counter() - begin
        found += [outcome(*pair) for pair in zip(recovery.frames, scene.joints_cam, strict=True)]
    return found, seconds / len(found)


def row(title: str, how: str, found: Sequence[Outcome], seconds: float) -> list[str]:
    """Make the table's row of some pictures."""
    counts = np.array([one.survivors for one in found])
    best = np.array([one.best for one in found])
    return [
        title,
        how,
        str(len(found)),
        f"{100 * np.mean(counts == 0):.1f} %",
        f"{np.median(counts):g}",
        f"{100 * np.mean([one.kept for one in found]):.1f} %",
        f"{1000 * np.nanmedian(best):.0f}" if np.isfinite(best).any() else "-",
        f"{seconds:.2f}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("capture", type=Path, nargs="?")
    parser.add_argument("--pictures", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    rng = np.random.default_rng(asked.seed)
    kinds: dict[str, Sequence[SyntheticScene]] = {
        "random legal postures": (random_views(load_figure(), asked.pictures, rng, SPHERE),)
    }
    if asked.capture is not None:
        kinds["real postures"] = mocap_scenes(read_capture(asked.capture), asked.pictures, rng, sphere=SPHERE)
    rows = [
        row(title, how, *measured(scenes, asked.seed, refined=refined))
        for title, scenes in kinds.items()
        for how, refined in (("refined, 12 points", True), ("tolerances, 14 points", False))
    ]
    head = [
        "postures",
        "how",
        "pictures",
        "empty",
        "survivors, median",
        "limb sides kept",
        "best PA, mm",
        "s a picture",
    ]
    print("\n".join(table_lines(head, rows)))


if __name__ == "__main__":
    main()
