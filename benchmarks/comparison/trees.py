"""The tree against brute force through Pinocchio and coal, and against a learned lifter: time of each view.

Brute force lifts all 8192 leaves of a view in one NumPy batch, asks rigid parts and joint ranges about every leaf with
a solution, and Pinocchio's pool about the configurations of all of them. Plain and fast path are two ways through one
tree (`posekit.tree`): survivors must be identical in all three.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module, util
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from benchmarks.comparison.lifter import Lifter, make_lifter
from benchmarks.comparison.measure import Chart, Cost, Section, Sizes, least, microseconds
from posekit.body import Figure, load_figure
from posekit.recovery import recover
from posekit.settings import EXACT_TOLERANCE, Tolerance
from posekit.skeleton import JOINTS, PARENTS, TREE_SEGMENTS, segment_name
from posekit.synthesis import SyntheticScene, random_views
from posekit.tree import Check, InterpretationTree, enumerate_leaves
from posekit.validators import judge, load_ranges, make_checks
from posekit.views.builtin import view_of

CHUNK_VIEWS = 250
"""Views grown in one call: their tables stay in the processor's cache."""

Codes = list[NDArray[np.int32]]


def physical_checks(figure: Figure, tolerance: Tolerance = EXACT_TOLERANCE) -> list[Check]:
    """Make rigid parts, joint ranges and collision for exact, or measured, image points."""
    return make_checks(
        figure,
        ("rigid-parts", "joint-range", "collision"),
        ranges=load_ranges("urdf"),
        rigid_tolerance=tolerance.rigid,
        rigid_mode="placement" if tolerance.placement else "side",
        angle_tolerance=tolerance.angle,
    )


def lengths_of(figure: Figure) -> NDArray[np.float64]:
    """Return each joint's distance from its parent (14,), metres."""
    return np.array([0.0, *(figure.lengths[segment_name(segment)] for segment in TREE_SEGMENTS)])


def grow(
    figure: Figure,
    scene: SyntheticScene,
    checks: list[Check],
    *,
    joints: int = len(JOINTS),
    tangent: float = EXACT_TOLERANCE.tangent,
) -> Codes:
    """Grow the trees of all views over the first joints, and return each view's surviving codes."""
    tree = InterpretationTree(
        joints=JOINTS[:joints], parents=PARENTS[:joints], lengths=lengths_of(figure)[:joints]
    )
    whole = joints == len(JOINTS)
    codes: Codes = []
    for first in range(0, len(scene), CHUNK_VIEWS):
        part = slice(first, first + CHUNK_VIEWS)
        leaves = tree.grow(
            scene.camera,
            scene.joints_cam[part, 0],
            scene.image[part, :joints],
            checks,
            given=scene.head_cam[part] if whole else None,
            tolerance=tangent,
        )
        codes += [leaves.code[start:end] for start, end in pairwise(leaves.offsets())]
    return codes


def brute_force(
    figure: Figure, scene: SyntheticScene, k: int, checks: list[Check], pool: pin.GeometryPool
) -> NDArray[np.int32]:
    """Judge all leaves of one view, collisions as whole configurations."""
    leaves, codes = enumerate_leaves(
        scene.camera,
        scene.joints_cam[k, 0],
        scene.image[k],
        parents=PARENTS,
        lengths=lengths_of(figure),
        tolerance=EXACT_TOLERANCE.tangent,
    )
    head = np.broadcast_to(scene.head_cam[k], (len(leaves), 5, 3))
    points = np.concatenate([leaves, head], axis=1)
    alive = np.ones(len(points), dtype=bool)
    for judgement in judge(checks, points):
        alive &= ~judgement.violated.any(axis=1)
    q = np.asfortranarray(figure.inverse_kinematics(points).T)
    alive &= ~np.asarray(pin.computeCollisionsInParallel(1, pool, q, True)).astype(bool)
    return np.asarray(codes[alive], dtype=np.int32)


def paths() -> tuple[str, ...]:
    """Name the ways through the tree that can be measured here."""
    if util.find_spec("posekit.compiled.compiling") is None or util.find_spec("numba") is None:
        return ("plain",)
    return ("plain", "fast")


@contextmanager
def on(path: str, threads: int | None = 1) -> Iterator[None]:
    """Take one way through the tree for a while, with so many threads."""
    if util.find_spec("posekit.compiled.compiling") is None:
        yield
        return
    chosen: Any = import_module("posekit.compiled.compiling")
    chosen.use_threads(threads)
    try:
        with chosen.path(path):
            yield
    finally:
        chosen.use_threads(None)


def same(some: Codes, others: Codes) -> int:
    """Count the views whose survivors are identical."""
    return sum(np.array_equal(np.sort(a), np.sort(b)) for a, b in zip(some, others, strict=False))


def section(sizes: Sizes) -> Section:
    """Measure the tree, brute force, the pipeline around the tree, and a lifter."""
    figure = load_figure()
    checks = physical_checks(figure)
    scene = random_views(figure, sizes.views, np.random.default_rng(0))
    some = scene.select(np.arange(min(sizes.brute, len(scene))))
    pool = pin.GeometryPool(figure.model, figure.geometry, 1)
    rest = [check for check in checks if check.name != "collision"]
    view = view_of(scene)

    def every_leaf() -> Codes:
        return [brute_force(figure, some, k, rest, pool) for k in range(len(some))]

    def tree(path: str) -> Codes:
        with on(path):
            return grow(figure, scene, checks)

    def pipeline() -> object:
        with on(paths()[-1]):
            return recover(
                view, checks=("rigid-parts", "joint-range", "collision"), tolerance=EXACT_TOLERANCE
            )

    lifters = [make_lifter(batch, scene.image) for batch in (1, 64)]
    known = {path: tree(path) for path in paths()}
    brute = every_leaf()
    ways: dict[str, tuple[Callable[[], object], int]] = {"brute force": (every_leaf, len(some))}
    for path in paths():
        ways[f"tree, {path} path"] = (lambda path=path: tree(path), len(scene))  # type: ignore[misc]
    ways["posekit.recover"] = (pipeline, len(scene))
    for lifter in lifters:
        ways[lifter.name] = (lifter.run, lifter.views)
    costs = least({name: way for name, (way, _) in ways.items()}, max(2, sizes.repeats // 2))
    each = {name: Cost(cost.cpu / ways[name][1], cost.wall / ways[name][1]) for name, cost in costs.items()}
    base = each["brute force"].cpu
    identical = {"brute force": ""}
    identical |= {
        f"tree, {path} path": f"{same(brute, codes)} of {len(some)}" for path, codes in known.items()
    }
    if len(known) > 1:
        equal = same(known["plain"], known["fast"])
        identical["tree, fast path"] += f"; plain path's in {equal} of {len(scene)}"
    ratios = {
        f"{name} against brute force": base / each[name].cpu for name in each if name.startswith("tree")
    }
    best = f"tree, {paths()[-1]} path"
    ratios |= {"posekit.recover against brute force": base / each["posekit.recover"].cpu}
    ratios |= {f"{best} against {lifter.name}": each[lifter.name].cpu / each[best].cpu for lifter in lifters}
    counts = np.array([len(codes) for codes in known["plain"]])
    return Section(
        title="From a view to its survivors",
        text=f"{len(scene)} random legal views of the stick figure, exact image points, neck and head known, in calls "
        f"of {CHUNK_VIEWS}; {len(some)} of them by brute force. Survivors: median {np.median(counts):.0f}, 95 % up to "
        f"{np.percentile(counts, 95):.0f}. One thread each.",
        head=("way", "µs a view", "views/s of one core", "brute force = 1", "survivors as brute force's"),
        rows=[
            (
                name,
                microseconds(cost.cpu, 1),
                f"{1 / cost.cpu:,.0f}",
                f"{base / cost.cpu:,.0f}",
                identical.get(name, ""),
            )
            for name, cost in each.items()
        ],
        ratios=ratios,
        charts=(
            Chart(
                name="views",
                title="From a view to its survivors",
                y="µs of one core",
                bars={name: cost.cpu * 1e6 for name, cost in each.items()},
                log="y",
            ),
        ),
        left_out=(*_left_out(), *{lifter.note for lifter in lifters if lifter.note}),
    )


def _left_out() -> tuple[str, ...]:
    return () if "fast" in paths() else ("the fast path: numba is not installed",)


__all__ = ["CHUNK_VIEWS", "Lifter", "grow", "on", "paths", "physical_checks", "section"]
