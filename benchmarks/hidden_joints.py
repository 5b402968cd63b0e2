"""Joints hidden in real motion: how often the truth is kept, how large the regions are, and what a frame costs.

    python benchmarks/hidden_joints.py CAPTURE.npz [--frames 64] [--seed 0] [--only pelvis,leg] [--clips 3,7]

The capture is an NPZ as `posekit synth mocap` reads it. Frames are drawn evenly over its clips, each seen by a camera
of its own at 2.5 to 6 m with exact image points and the clip's median lengths; then joints are hidden at random. The
truth is kept where some survivor has the seen joints that it places within 10 mm of the true ones, in the mean, and
says of every other joint a region (its box and its ball) in which the true position is. The volume of a hidden joint's
box is compared with the box of what its segments alone allow it about the nearest joint of its path that was seen.
Times are of the processor; the ratio is to a frame that is exact, of random postures of the figure, in the same run.
Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from posekit.body import load_figure
from posekit.formats.markdown import table_lines
from posekit.formats.own import View
from posekit.recovery import recover
from posekit.recovery.recovery import FrameRecovery
from posekit.skeleton import JOINT, JOINTS, PARENTS, SIDES, segment_name
from posekit.synthesis import mocap_scenes, random_views, read_capture
from posekit.views.builtin import view_of

NEAR_METRES = 0.010
"""Metres of mean error of the seen joints within which a survivor has the true posture."""

SLACK_METRES = 1e-3
"""Metres beside a region that count as in it."""

PATTERNS = (
    "nothing",
    "1 joint",
    "2 joints",
    "3 joints",
    "pelvis",
    "shoulder",
    "arm",
    "leg",
    "elbow",
    "wrist",
    "hip",
)


def hidden_joints(pattern: str, rng: np.random.Generator) -> list[int]:
    """Draw what is hidden in one frame."""
    side = SIDES[rng.integers(2)]
    parts = {
        "nothing": [],
        "pelvis": ["pelvis"],
        "arm": [f"{side}_{name}" for name in ("shoulder", "elbow", "wrist")],
        "leg": [f"{side}_{name}" for name in ("hip", "knee", "ankle")],
    }
    if pattern[0].isdigit():
        return sorted(rng.choice(np.arange(1, len(JOINTS)), int(pattern[0]), replace=False).tolist())
    return [JOINT[name] for name in parts.get(pattern, [f"{side}_{pattern}"])]


@dataclass
class Tally:
    """What became of the truth in the frames of one pattern."""

    kept: list[bool] = field(default_factory=list)
    legal: list[bool] = field(default_factory=list)
    empty: int = 0
    survivors: list[int] = field(default_factory=list)
    volume: dict[str, list[float]] = field(default_factory=dict)
    judged: Counter[str] = field(default_factory=Counter)
    lost: Counter[str] = field(default_factory=Counter)
    seconds: float = 0.0

    def add(
        self, frame: FrameRecovery, truth: np.ndarray, hidden: list[int], lengths: dict[str, float]
    ) -> None:
        """Judge one frame."""
        self.survivors.append(len(frame))
        self.empty += not len(frame)
        self.judged[str(frame.judged)] += 1
        best, why = None, "empty"
        inferred = frame.inferred or [{} for _ in range(len(frame))]
        nearest = np.inf
        for joints, regions in zip(frame.joints, inferred, strict=True):
            placed = [k for k in range(len(JOINTS)) if JOINTS[k] not in regions]
            apart = np.linalg.norm(joints[placed] - truth[placed], axis=-1)
            outside = {
                name: float(
                    max(
                        np.maximum(
                            region.lower - truth[JOINT[name]], truth[JOINT[name]] - region.upper
                        ).max(),
                        np.linalg.norm(truth[JOINT[name]] - joints[JOINT[name]]) - region.radius,
                    )
                )
                for name, region in regions.items()
            }
            far = float(np.nanmean(apart))
            unknown = [JOINTS[k] for k, value in zip(placed, apart, strict=True) if np.isnan(value)]
            if far < nearest:
                nearest = far
                beyond = {name: value for name, value in outside.items() if not value <= SLACK_METRES}
                worst = max(beyond, key=lambda name: beyond[name]) if beyond else ""
                why = (
                    f"seen {far * 1000:.0f} mm"
                    if far > NEAR_METRES
                    else f"unknown {'/'.join(unknown)}"
                    if unknown
                    else f"outside {worst} {beyond.get(worst, 0.0) * 1000:.0f} mm"
                )
            if (
                far <= NEAR_METRES
                and not unknown
                and all(value <= SLACK_METRES for value in outside.values())
            ):
                best = regions
        self.kept.append(best is not None)
        if best is None:
            self.lost[f"{'+'.join(JOINTS[k] for k in hidden)}: {why}"] += 1
            return
        for joint in hidden:
            region = best[JOINTS[joint]]
            reach, at = 0.0, joint
            while at in hidden:
                reach += lengths[segment_name((PARENTS[at], at))]
                at = PARENTS[at]
            share = float(np.prod((region.upper - region.lower) / (2.0 * reach)))
            self.volume.setdefault(JOINTS[joint].split("_")[-1], []).append(share)

    def row(self, exact: float) -> list[str]:
        """Return the numbers as words."""
        n = len(self.kept)
        every = [value for values in self.volume.values() for value in values]
        volumes = ", ".join(
            f"{name} {np.median(values):.1%} ({np.quantile(values, 0.95):.0%})"
            for name, values in self.volume.items()
        )
        return [
            str(n),
            f"{np.mean(self.kept):.1%}",
            f"{np.mean(np.array(self.kept)[self.legal]):.1%}",
            f"{self.empty / n:.1%}",
            f"{np.median(self.survivors):.0f}",
            f"{np.mean(every):.1%}" if every else "-",
            volumes or "-",
            f"{1000 * self.seconds / n:.1f}",
            f"{self.seconds / n / exact:.0f}",
        ]


def hide(view: View, hidden: list[list[int]]) -> View:
    """Hide joints of each frame."""
    image = view.image.copy()
    for frame, joints in enumerate(hidden):
        image[frame, joints] = np.nan
    return replace(view, image=image, head_image=view.head_image)


def exact_seconds(n: int) -> float:
    """Measure what an exact frame costs, seconds of the processor."""
    view = view_of(random_views(load_figure(), n, np.random.default_rng(0)))
    recover(view)
    begin = time.process_time()
    for frame in recover(view).frames:
        _ = frame.joints
    return (time.process_time() - begin) / n


def main(arguments: list[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("capture", type=Path)
    parser.add_argument("--frames", type=int, default=64)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default=",".join(PATTERNS), help="some patterns")
    parser.add_argument("--clips", default="", help="numbers of the clips; all if not given")
    parser.add_argument("--lost", action="store_true", help="say how the truth was lost")
    given = parser.parse_args(arguments)
    warnings.simplefilter("ignore", UserWarning)
    scenes = mocap_scenes(read_capture(given.capture), given.frames, np.random.default_rng(given.seed))
    if given.clips:
        scenes = tuple(scenes[int(k)] for k in given.clips.split(","))
    exact = exact_seconds(32)
    legal = []
    for scene in scenes:
        whole = Tally()
        for frame, truth in zip(recover(view_of(scene)).frames, scene.joints_cam, strict=True):
            whole.add(frame, truth, [], {})
        legal.append(whole.kept)
    rows, lost = [], []
    for pattern in given.only.split(","):
        rng, tally = np.random.default_rng([given.seed, PATTERNS.index(pattern)]), Tally()
        for scene, seen in zip(scenes, legal, strict=True):
            view = view_of(scene)
            tally.legal += seen
            hidden = [hidden_joints(pattern, rng) for _ in range(len(view))]
            begin = time.process_time()
            recovery = recover(hide(view, hidden))
            tally.seconds += time.process_time() - begin
            for frame, truth, joints in zip(recovery.frames, scene.joints_cam, hidden, strict=True):
                tally.add(frame, truth, joints, dict(recovery.figure.lengths))
        rows.append([pattern, *tally.row(exact)])
        print(*rows[-1], file=sys.stderr, flush=True)
        lost.append(f"{pattern}: {dict(tally.judged)}; {dict(tally.lost.most_common(12))}")
    head = [
        "hidden",
        "frames",
        "truth kept",
        "of those kept seen",
        "empty",
        "survivors",
        "volume",
        "by joint, median (95 %)",
        "ms",
        "x exact",
    ]
    print("\n".join(table_lines(head, rows)))
    if given.lost:
        print("\n".join(lost))


if __name__ == "__main__":
    main()
