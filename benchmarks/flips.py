"""The 2048 flips of one view of Taylor's human, with all checks: the tree against a plain loop over the flips.

    python benchmarks/flips.py [--views 5] [--repeat 5]

The loop places one flip after the other, completes neck and pelvis, and asks one check after the other about that one
posture, until one rejects it. Survivors must be identical. Ratios are of one run on one machine.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from posekit.body import load_figure
from posekit.papers.taylor_views import StudyPictures, exact_views
from posekit.recovery.taylor_figure.completion import Completion, joint_checks, taylor_checks
from posekit.recovery.taylor_figure.human import N_FLIPS, taylor_human
from posekit.settings import PHOTOGRAPH_TOLERANCE
from posekit.synthesis import CameraSphere, random_views
from posekit.tree import Check
from posekit.validators import load_ranges

TAYLOR_HUMAN = taylor_human()
STICK_FIGURE = load_figure().from_stature(1.75)
URDF_RANGES = load_ranges("urdf")

Flips = tuple[bool, ...]


def grow(view: StudyPictures, checks: Sequence[Check]) -> set[Flips]:
    """Grow the tree of one view and say which flips survive."""
    return flips_of(TAYLOR_HUMAN.grow(view.image, view.lengths, view.scale, checks).postures())


def loop(view: StudyPictures, checks: Sequence[Check], completion: Completion) -> set[Flips]:
    """Ask the checks about one flip after the other, of all 2^11."""
    linkage = TAYLOR_HUMAN.linkage
    place = linkage.place_nodes(view.image - view.image.mean(axis=1, keepdims=True))[0] / view.scale[0]
    apart = np.array([np.linalg.norm(place[a] - place[b]) for a, b in linkage.segments])
    depth = np.sqrt(np.maximum(view.lengths.reshape(-1) ** 2 - apart**2, 0.0))
    parents, segments = TAYLOR_HUMAN.spanned.tree.parents, TAYLOR_HUMAN.spanned.segments
    nodes = TAYLOR_HUMAN.spanned.nodes
    survivors = set()
    for far in product((False, True), repeat=len(depth)):
        points = np.zeros((len(nodes), 3))
        points[:, :2] = place[list(nodes)]
        for joint in range(1, len(nodes)):
            parent, segment = nodes[parents[joint]], segments[joint]
            start, end = linkage.segments[segment]
            # Half a girdle goes the way of the whole, from whichever end it is walked.
            halved = nodes[joint] not in (start, end) or parent not in (start, end)
            away = far[segment] == (parent == start or nodes[joint] == end)
            step = depth[segment] * (0.5 if halved else 1.0)
            points[joint, 2] = points[parents[joint], 2] + (step if away else -step)
        joints = completion.complete(points[None])
        if not any(check.judge(joints[:, list(check.points)]).violated.any() for check in checks):
            survivors.add(far)
    return survivors


def flips_of(postures: np.ndarray) -> set[Flips]:
    """Say of postures (N, 14, 3) which segments go away from the camera."""
    start, end = (
        [TAYLOR_HUMAN.spanned.joint(segment[k]) for segment in TAYLOR_HUMAN.linkage.segments] for k in (0, 1)
    )
    return {tuple(row) for row in (postures[:, end, 2] > postures[:, start, 2]).tolist()}


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    start = time.perf_counter()
    result = call()
    return result, time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=5)
    parser.add_argument("--repeat", type=int, default=5)
    given = parser.parse_args()
    scene = random_views(
        STICK_FIGURE, given.views, np.random.default_rng(0), CameraSphere(distance=(3.0, 6.0))
    )
    views = list(exact_views(TAYLOR_HUMAN, [scene])[0].parts(1))
    checks = taylor_checks(
        STICK_FIGURE, TAYLOR_HUMAN.points, ranges=URDF_RANGES, tolerance=PHOTOGRAPH_TOLERANCE
    )
    plain = joint_checks(STICK_FIGURE, ranges=URDF_RANGES, tolerance=PHOTOGRAPH_TOLERANCE)
    completion = Completion(figure=STICK_FIGURE, points=TAYLOR_HUMAN.points)
    grow(views[0], checks)  # coal's models are built at the first call

    print(f"{len(checks)} checks, {N_FLIPS} flips a view")
    tree_time = loop_time = 0.0
    for k, view in enumerate(views):
        runs = [timed(partial(grow, view, checks)) for _ in range(given.repeat)]
        by_tree, seconds = min(runs, key=lambda pair: pair[1])
        tree_time += seconds
        by_loop, seconds = timed(partial(loop, view, plain, completion))
        loop_time += seconds
        if by_tree != by_loop:
            raise SystemExit(f"view {k}: the tree has {len(by_tree)} survivors, the loop {len(by_loop)}")
        print(f"view {k}: {len(by_tree)} survivors, identical")
    for name, seconds in (("loop over the flips", loop_time), ("tree, one view a call", tree_time)):
        print(f"{name:24} {seconds / len(views) * 1e3:9.1f} ms a view {loop_time / seconds:8.1f} x")


if __name__ == "__main__":
    main()
