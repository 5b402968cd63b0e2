"""Collision against real motion, pair by pair: what real bodies press together, and what each pair takes away.

    python benchmarks/contacts.py CAPTURE.npz [--views 640] [--seed 1]

The capture is an NPZ as `posekit synth mocap` reads it. The true joints of all frames are judged with the figure's
capsules, scaled to each clip's median lengths, and with thicker ones: the closest approach of each pair, and the frames
that it loses. Then each frame is seen by a virtual camera of its own, as in `benchmarks/real_motion.py`, and
recovered by the anatomical ranges without collision; the pairs are asked about what survives. Prints Markdown tables.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from ranges import Clip, clips_of  # type: ignore[import-not-found]  # the scripts beside this one
from real_motion import true_code  # type: ignore[import-not-found]

from posekit.body import Figure
from posekit.body.capsules import Capsule
from posekit.formats.markdown import table_lines
from posekit.recovery import recover
from posekit.settings import MEASURED_TOLERANCE
from posekit.synthesis import SyntheticScene, mocap_scenes, read_capture
from posekit.validators import load_ranges
from posekit.validators.collision import PairCollision
from posekit.views.builtin import view_of

RADIUS_FACTORS: Mapping[str, Mapping[str, float]] = {
    "the figure's": {},
    "4 cm at the shank": {"shank": 0.04 / 0.032},
    "3.5 cm at the upper arm": {"upper_arm": 0.035 / 0.025},
    "10 cm at the trunk": {"torso": 0.10 / 0.09},
    "all three": {"shank": 0.04 / 0.032, "upper_arm": 0.035 / 0.025, "torso": 0.10 / 0.09},
    "skin: mean girths": {
        "shank": 5.9 / 3.2, "upper_arm": 5.0 / 2.5, "torso": 1.2, "forearm": 4.1 / 2.5, "thigh": 9.0 / 4.5
    },
}  # fmt: skip
"""By how much the radii of some parts are larger. A skin is a part's mean girth (Heinz et al. 2003) over 2 pi."""


def pairs_of(figure: Figure, larger: Mapping[str, float]) -> list[PairCollision]:
    def capsule(k: int) -> Capsule:
        body = figure.capsules[k]
        return replace(
            body, radius=body.radius * larger.get(body.link.removeprefix("right_").removeprefix("left_"), 1)
        )

    return [
        PairCollision(a=capsule(i), b=capsule(j), contact_margin=0.0, exact=True)
        for i, j in figure.collision_pairs
    ]


def distances(
    figure: Figure, points: NDArray[np.float64], larger: Mapping[str, float]
) -> dict[str, NDArray[np.float64]]:
    """Return the distance of each pair in postures without a head (N, 14, 3), metres."""
    whole = np.concatenate([points, np.full((len(points), 5, 3), np.nan)], axis=1)
    found = {}
    for pair in pairs_of(figure, larger):
        gap = pair.judge(whole[:, list(pair.points)]).value[:, 0]
        if not np.isnan(gap).all():
            found[pair.where[0]] = gap
    return found


def on_true_joints(clips: Sequence[Clip]) -> None:
    gaps = [distances(clip.figure, clip.points, {}) for clip in clips]
    rows = []
    for pair in gaps[0]:
        closest, clip = min((float(each[pair].min()), c.name) for each, c in zip(gaps, clips, strict=True))
        every = np.concatenate([each[pair] for each in gaps])
        row = [pair, f"{closest * 100:.1f}", clip, f"{np.quantile(every, 0.005) * 100:.1f}"]
        rows.append((closest, [*row, *(f"{int((every < -0.01 * give).sum())}" for give in (0, -1, -2))]))
    rows.sort()
    print("How near real bodies come (the nearest twelve pairs)\n")
    head = ["pair", "closest, cm", "in clip", "0.5 % of frames, cm", "frames lost", "if 1 cm thicker", "2 cm"]
    print("\n".join(table_lines(head, [row for _, row in rows[:12]])))


def statistics(counts: Sequence[int]) -> tuple[str, str, str]:
    median, high = np.percentile(counts, [50, 95])
    return f"{np.mean(counts):.1f}", f"{median:.0f}", f"{high:.0f}"


def of_survivors(clips: Sequence[Clip], scenes: Sequence[SyntheticScene]) -> None:
    """Ask the pairs about what the anatomical ranges leave of views."""
    ranges = load_ranges("anatomical")
    left = []
    for scene in scenes:
        recovery = recover(
            view_of(scene), checks=("rigid-parts", "joint-range"), ranges=ranges, tolerance=MEASURED_TOLERANCE
        )
        for frame, truth in zip(recovery.frames, scene.joints_cam, strict=True):
            true = [code == true_code(frame, truth) for code in frame.branches]
            left.append((recovery.figure, frame.joints, np.array(true, dtype=bool)))
    rows = []
    for name, larger in RADIUS_FACTORS.items():
        counts: list[int] = []
        kept, alone, taken = [], Counter[str](), 0
        for figure, joints, mine in left:
            gaps = distances(figure, joints, larger)
            hit: NDArray[np.bool_] = np.stack([gap < -1e-9 for gap in gaps.values()])
            alive = hit.sum(axis=0) == 0
            counts.append(int(alive.sum()))
            kept.append(bool(mine[alive].any()))
            taken += int((~alive).sum())
            alone.update({pair: int((hit[k] & (hit.sum(axis=0) == 1)).sum()) for k, pair in enumerate(gaps)})
        lost = [
            np.any([gap < -1e-9 for gap in distances(c.figure, c.points, larger).values()], axis=0)
            for c in clips
        ]
        worst = max(zip((float(each.mean()) for each in lost), (c.name for c in clips), strict=True))
        where = f"{worst[0]:.1%} ({worst[1]})" if worst[0] else "none"
        share = f"{np.concatenate(lost).mean():.2%}"
        rows.append([name, share, where, f"{np.mean(kept):.1%}", *statistics(counts)])
        if not larger:
            total = sum(len(joints) for _, joints, _ in left)
            print(
                f"Of {total} survivors of the ranges collision takes {taken / total:.0%}; one pair alone: ",
                end="",
            )
            print(", ".join(f"{pair} {count / total:.1%}" for pair, count in alone.most_common(10)) + "\n")
    found = np.mean([mine.any() for _, _, mine in left])
    rows.append(["no collision", "0.00%", "none", f"{found:.1%}", *statistics([len(j) for _, j, _ in left])])
    print("Radii against real frames and survivors\n")
    head = [
        "radii",
        "frames lost",
        "worst clip",
        "truth among survivors",
        "survivors, mean",
        "median",
        "95 %",
    ]
    print("\n".join(table_lines(head, rows)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture", type=Path, nargs="?")
    parser.add_argument("--views", type=int, default=640)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    if given.capture is None:
        print("no capture given: python benchmarks/contacts.py CAPTURE.npz")
        return
    capture = read_capture(given.capture)
    clips = clips_of(capture)
    on_true_joints(clips)
    of_survivors(clips, mocap_scenes(capture, given.views, np.random.default_rng(given.seed)))


if __name__ == "__main__":
    main()
