"""The interpretation tree against brute force on the same views, and its rate over a batch.

    python benchmarks/tree.py [--views 200] [--batch 1000]

Brute force lifts all 8192 leaves of a view, in one NumPy batch, and asks every check about every leaf that has a
solution; collisions are asked of Pinocchio's pool over whole configurations. The tree's collisions are coal's too.
Survivors must be identical. Ratios are of one run on one machine.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.figure import load_figure
from posekit.pipeline import EXACT
from posekit.skeleton import JOINTS, PARENTS, TREE_SEGMENTS, segment_name
from posekit.synthesis import Scene, random_views
from posekit.tree import Check, InterpretationTree, enumerate_leaves
from posekit.validators import judge, load_ranges, make_checks

FIGURE = load_figure()
LENGTHS = np.array([0.0, *(FIGURE.lengths[segment_name(segment)] for segment in TREE_SEGMENTS)])
CHUNK = 250


def physical_checks() -> list[Check]:
    return make_checks(
        FIGURE,
        ("rigid-parts", "joint-range", "collision"),
        ranges=load_ranges("urdf"),
        rigid_tolerance=EXACT.rigid,
    )


def grow(scene: Scene, checks: list[Check]) -> list[NDArray[np.int32]]:
    """Grow the trees of all frames and return each frame's surviving codes."""
    tree = InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=LENGTHS)
    codes = []
    for first in range(0, len(scene), CHUNK):
        part = slice(first, first + CHUNK)
        leaves = tree.grow(
            scene.camera,
            scene.joints_cam[part, 0],
            scene.image[part],
            checks,
            given=scene.head_cam[part],
            tolerance=EXACT.tangent,
        )
        codes += [leaves.code[start:end] for start, end in pairwise(leaves.offsets())]
    return codes


def brute_force(scene: Scene, k: int, checks: list[Check], pool: pin.GeometryPool) -> NDArray[np.intp]:
    """Judge all leaves of one view."""
    leaves, codes = enumerate_leaves(
        scene.camera,
        scene.joints_cam[k, 0],
        scene.image[k],
        parents=PARENTS,
        lengths=LENGTHS,
        tolerance=EXACT.tangent,
    )
    head = np.broadcast_to(scene.head_cam[k], (len(leaves), 5, 3))
    points = np.concatenate([leaves, head], axis=1)
    alive = np.ones(len(points), dtype=bool)
    for judgement in judge(checks, points):
        alive &= ~judgement.violated.any(axis=1)
    q = np.asfortranarray(FIGURE.inverse_kinematics(points).T)
    alive &= ~np.asarray(pin.computeCollisionsInParallel(2, pool, q, True)).astype(bool)
    return codes[alive]


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    start = time.perf_counter()
    result = call()
    return result, time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=200)
    parser.add_argument("--batch", type=int, default=1000)
    given = parser.parse_args()
    checks = physical_checks()
    scene = random_views(FIGURE, max(given.views, given.batch), np.random.default_rng(0))
    some = scene.select(np.arange(given.views))
    grow(some, checks)

    pool = pin.GeometryPool(FIGURE.model, FIGURE.geometry, 2)
    rest = [check for check in checks if check.name != "collision"]
    brute, brute_time = timed(lambda: [brute_force(some, k, rest, pool) for k in range(len(some))])
    batched, batched_time = timed(lambda: grow(some, checks))
    single, single_time = timed(lambda: [grow(some.select([k]), checks)[0] for k in range(len(some))])
    for name, codes in (("batched", batched), ("one at a time", single)):
        same = sum(np.array_equal(np.sort(a), np.sort(b)) for a, b in zip(brute, codes, strict=True))
        print(f"survivors identical to brute force, {name}: {same} of {len(some)} views")
    rows = (
        ("brute force", brute_time),
        ("tree, one view a call", single_time),
        ("tree, one batch", batched_time),
    )
    for name, seconds in rows:
        print(f"{name:24} {seconds / len(some) * 1e3:9.3f} ms a view {brute_time / seconds:8.1f} x")

    _, seconds = min((timed(lambda: grow(scene, checks)) for _ in range(5)), key=lambda pair: pair[1])
    counts = np.array([len(codes) for codes in grow(scene, checks)])
    print(
        f"{len(scene)} views in batches of {CHUNK}, all checks, best of 5: {len(scene) / seconds:.0f} views/s; "
        f"survivors median {np.median(counts):.0f}, 95 % {np.percentile(counts, 95):.0f}"
    )


if __name__ == "__main__":
    main()
