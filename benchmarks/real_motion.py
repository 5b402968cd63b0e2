"""Real motion capture through virtual cameras: how often the truth is among the survivors, and what kills it.

    python benchmarks/real_motion.py CAPTURE.npz [--frames 500] [--seed 0]

The capture is an NPZ as `posekit synth mocap` reads it. Frames are drawn evenly over its clips, each seen by a
camera of its own; lengths are each clip's medians. A real torso is not rigid, so the true posture is none of the
tree's leaves: the leaf that took the true branches stands for it ("the truth"), and its distance is reported.
Prints Markdown tables.
"""

from __future__ import annotations

import argparse
from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np

from posekit.formats.markdown import table_lines
from posekit.recovery import recover
from posekit.recovery.recovery import FrameRecovery
from posekit.settings import MEASURED_TOLERANCE, Tolerance
from posekit.skeleton import JOINTS, PARENTS
from posekit.synthesis import SyntheticScene, mocap_scenes, read_capture
from posekit.tree.bits import path_of
from posekit.views.builtin import view_of

CHECK_NAMES = ("rigid-parts", "joint-range", "collision")


class Tally:
    """What became of the truth, frame by frame."""

    def __init__(self) -> None:
        self.retained: dict[str, list[bool]] = defaultdict(list)
        self.survivors: list[int] = []
        self.error: list[float] = []
        self.killers: Counter[str] = Counter()

    def add(self, label: str, frame: FrameRecovery, truth: np.ndarray) -> None:
        code = true_code(frame, truth)
        found = code in frame.branches
        self.retained[label].append(found)
        self.survivors.append(len(frame))
        if found:
            joints = frame.joints[frame.branches.index(code)]
            self.error.append(float(np.linalg.norm(joints - truth, axis=-1).mean()))
        else:
            self.killers[killer(frame, code)] += 1

    def row(self) -> list[str]:
        every = [found for label in self.retained.values() for found in label]
        median, high = np.percentile(self.survivors, [50, 95])
        return [
            f"{np.mean(every):.1%}",
            f"{median:.0f}",
            f"{high:.0f}",
            f"{np.median(self.error) * 1000:.1f}" if self.error else "-",
        ]


def true_code(frame: FrameRecovery, truth: np.ndarray) -> str:
    """Follow, from the root, the candidate that is nearer to the true joint."""
    assert frame.batch is not None
    candidates = frame.batch.leaves.candidates
    bits: dict[int, int] = {}
    for joint in range(1, len(JOINTS)):
        path = 0
        for ancestor in path_of(PARENTS[joint], PARENTS):
            path = path << 1 | bits[ancestor]
        pair = candidates.positions[joint][frame.index, 2 * path : 2 * path + 2]
        distance = np.linalg.norm(pair - truth[joint], axis=-1)
        bits[joint] = int(np.argmin(np.where(np.isnan(distance), np.inf, distance)))
    return "".join(str(bits[joint]) for joint in range(1, len(JOINTS)))


def killer(frame: FrameRecovery, code: str) -> str:
    """Find the finding that pruned the branch which leads to a code."""
    for branch in frame.pruned():
        if code.startswith(branch.branch):
            return branch.reason
    return "merged with its twin"


def evaluate(
    scenes: tuple[SyntheticScene, ...], ranges: str, tolerance: Tolerance, checks: tuple[str, ...]
) -> Tally:
    tally = Tally()
    for scene in scenes:
        recovery = recover(view_of(scene), checks=checks, ranges=ranges, tolerance=tolerance)
        for label, frame, truth in zip(scene.labels, recovery.frames, scene.joints_cam, strict=True):
            tally.add(label, frame, truth)
    return tally


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture", type=Path, nargs="?")
    parser.add_argument("--frames", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    if given.capture is None:
        print("no capture given: python benchmarks/real_motion.py CAPTURE.npz")
        return
    scenes = mocap_scenes(read_capture(given.capture), given.frames, np.random.default_rng(given.seed))
    head = ["truth among survivors", "survivors, median", "95 %", "median joint error of the truth, mm"]

    print("Rigid tolerance against truth and survivors (distances inside torso and hips)\n")
    rows = []
    for ranges in ("table1", "urdf"):
        for centimetres in (0.5, 1, 2, 3, 4, 5):
            tolerance = replace(MEASURED_TOLERANCE, rigid=centimetres / 100)
            rows.append([ranges, f"{centimetres:g}", *evaluate(scenes, ranges, tolerance, CHECK_NAMES).row()])
    print("\n".join(table_lines(["ranges", "rigid tolerance, cm", *head], rows)))

    print("Angle tolerance against truth and survivors\n")
    rows = []
    for ranges in ("table1", "urdf"):
        for degrees in (1e-3, 1, 2, 3, 5):
            tolerance = replace(MEASURED_TOLERANCE, angle=degrees)
            rows.append([ranges, f"{degrees:g}", *evaluate(scenes, ranges, tolerance, CHECK_NAMES).row()])
    print("\n".join(table_lines(["ranges", "angle tolerance, deg", *head], rows)))

    print("By check, at the default tolerance\n")
    rows = []
    for ranges in ("table1", "urdf"):
        for checks in (("rigid-parts",), ("rigid-parts", "joint-range"), CHECK_NAMES):
            rows.append(
                [ranges, " + ".join(checks), *evaluate(scenes, ranges, MEASURED_TOLERANCE, checks).row()]
            )
    print("\n".join(table_lines(["ranges", "checks", *head], rows)))

    print("By action, all checks, at the default tolerance\n")
    tallies = {
        ranges: evaluate(scenes, ranges, MEASURED_TOLERANCE, CHECK_NAMES) for ranges in ("table1", "urdf")
    }
    rows = [
        [action, str(len(found)), f"{np.mean(found):.1%}", f"{np.mean(tallies['urdf'].retained[action]):.1%}"]
        for action, found in sorted(tallies["table1"].retained.items())
    ]
    print("\n".join(table_lines(["action", "frames", "table1", "urdf"], rows)))

    print("What kills the truth, where it dies\n")
    reasons = Counter(tallies["table1"].killers) + Counter(tallies["urdf"].killers)
    rows = [
        [reason, str(tallies["table1"].killers[reason]), str(tallies["urdf"].killers[reason])]
        for reason, _ in reasons.most_common()
    ]
    print("\n".join(table_lines(["finding", "table1", "urdf"], rows)))


if __name__ == "__main__":
    main()
