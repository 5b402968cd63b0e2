"""The search over the neck's depth: the truth is in it, the tree agrees with it, and its laws hold."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.cameras import PinholeCamera
from posekit.cameras.neck.body import NeckRays, sight
from posekit.cameras.neck.closure import RigidClosure
from posekit.cameras.neck.search import NeckDepths, _angles, search
from posekit.skeleton import JOINTS, PARENTS, RIGID_SEGMENTS, TREE_SEGMENTS, segment_name
from posekit.synthesis import CameraSphere, SyntheticScene, random_views, seq1, seq2
from posekit.tree import InterpretationTree

FIGURE = load_figure()
LENGTHS = np.array([0.0] + [FIGURE.lengths[segment_name(segment)] for segment in TREE_SEGMENTS])
TREE = InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=LENGTHS)
EXACT, ROUNDING = 1e-8, 1e-9
VIEWS = random_views(FIGURE, 300, np.random.default_rng(3))
SWAPPED = [
    JOINTS.index(name.replace("left", "?").replace("right", "left").replace("?", "right")) for name in JOINTS
]


def searched(
    scene: SyntheticScene, tolerance: float, tangent: float = ROUNDING, image: np.ndarray | None = None
) -> tuple[NeckRays, RigidClosure, list[NeckDepths]]:
    seen = sight(
        scene.camera, scene.figure, scene.image if image is None else image, np.full(len(scene), tangent)
    )
    usable = np.flatnonzero(np.isfinite(seen.farthest[:, 0]))
    closure, found = search(seen, usable, np.full(len(usable), tolerance))
    return seen, closure, found


def true_distance(scene: SyntheticScene) -> np.ndarray:
    return np.asarray(np.linalg.norm(scene.joints_cam[:, 0], axis=1))


def inside(found: NeckDepths, distance: float, slack: float = 1e-7) -> bool:
    low, high = found.intervals.T
    return bool(((low <= distance + slack) & (high >= distance - slack)).any())


@pytest.mark.parametrize(
    "scene",
    [
        VIEWS,
        seq1(),
        seq2(),
        random_views(FIGURE, 40, np.random.default_rng(4), CameraSphere(distance=(30.0, 60.0), f=9000.0)),
        random_views(FIGURE, 40, np.random.default_rng(5), CameraSphere(distance=(1.6, 2.0), f=500.0)),
        random_views(FIGURE.from_stature(1.2), 40, np.random.default_rng(6)),
    ],
    ids=["random", "seq1", "seq2", "far", "near", "child"],
)
def test_the_true_distance_is_a_minimum_without_residual(scene: SyntheticScene) -> None:
    _, _, found = searched(scene, EXACT)
    several = 0
    for distance, depths in zip(true_distance(scene), found, strict=True):
        away = np.abs(depths.minima - distance)
        assert away.min() < 1e-6
        assert depths.residual[away.argmin()] < EXACT
        assert inside(depths, distance)
        assert depths.lower < distance <= depths.upper * (1 + 1e-9)
        several += len(depths.minima) > 1
    assert several <= 0.02 * len(found) + 1  # two depths that both close exactly are rare


def test_the_misfit_is_the_least_of_all_the_trees_leaves() -> None:
    """Grow the whole tree, unpruned, and measure the four distances in every leaf."""
    rng = np.random.default_rng(7)
    seen, closure, _ = searched(VIEWS.select(range(25)), 0.05)
    scene = VIEWS.select(range(25))
    distance = seen.farthest[:, 0] * rng.uniform(0.8, 1.0, len(scene))
    root = distance[:, None] * seen.rays[:, 0]
    leaves = TREE.grow(scene.camera, root, scene.image, [])
    postures = leaves.postures()
    misfit = np.max(
        [
            np.abs(
                np.linalg.norm(postures[:, a] - postures[:, b], axis=-1)
                - FIGURE.lengths[segment_name((a, b))]
            )
            for a, b in RIGID_SEGMENTS
        ],
        axis=0,
    )
    told = closure.least(np.arange(len(scene)), distance)
    for frame in range(len(scene)):
        own = misfit[leaves.frame == frame]
        assert told[frame] == pytest.approx(own.min() if len(own) else np.inf, abs=1e-9)
    assert np.isfinite(told).mean() > 0.8


def test_one_branch_is_one_of_all() -> None:
    seen, closure, _ = searched(VIEWS, 0.05)
    distance = 0.97 * seen.farthest[:, 0]
    rows = np.arange(len(VIEWS))
    every = closure.all(rows, distance[:, None])[:, 0]
    for branch in range(every.shape[1]):
        one = closure.one(rows, np.full(len(rows), branch), distance)
        np.testing.assert_allclose(one, every[:, branch], atol=1e-12)


def test_beyond_the_bound_the_tree_has_no_leaf_and_up_to_it_it_has() -> None:
    seen, _, found = searched(VIEWS, 0.05)
    for factor, alive in ((1 - 1e-7, True), (1 + 1e-6, False)):
        root = (factor * seen.farthest[:, 0])[:, None] * seen.rays[:, 0]
        counts = TREE.grow(VIEWS.camera, root, VIEWS.image, []).counts()[:, -1]
        assert ((counts > 0) == alive).all()
    assert {depths.segment for depths in found} <= {segment_name(segment) for segment in TREE_SEGMENTS}


def test_the_named_segment_is_the_one_to_lengthen() -> None:
    class Longer:
        """Lengths that need make no body: the bound reads them alone."""

        def __init__(self, name: str) -> None:
            self.lengths = {**FIGURE.lengths, name: 1.01 * FIGURE.lengths[name]}

    seen, _, found = searched(VIEWS.select(range(30)), 0.05)
    for frame, depths in enumerate(found):
        longer: Any = Longer(depths.segment)
        moved = sight(VIEWS.camera, longer, VIEWS.image[frame : frame + 1], np.full(1, ROUNDING))
        assert moved.farthest[0, 0] > seen.farthest[frame, 0] * (1 + 1e-6)


@settings(max_examples=6)
@given(st.floats(0.2, 5.0))
def test_a_body_twice_as_large_is_twice_as_far(factor: float) -> None:
    scene = VIEWS.select(range(4))
    larger = FIGURE.scaled(
        {name: factor * length for name, length in FIGURE.lengths.items()},
    )
    frames = np.arange(4)
    _, _, small = searched(scene, 0.03, 0.01)
    seen = sight(scene.camera, larger, scene.image, np.full(4, 0.01 * factor))
    _, large = search(seen, frames, np.full(4, 0.03 * factor))
    for a, b in zip(small, large, strict=True):
        assert b.upper == pytest.approx(factor * a.upper, rel=1e-6)
        np.testing.assert_allclose(b.intervals, factor * a.intervals, rtol=1e-5)
        assert b.residual[0] == pytest.approx(factor * a.residual[0], abs=1e-8)


@pytest.mark.parametrize("swap", [False, True])
def test_a_mirrored_image_has_the_same_depths(swap: bool) -> None:
    scene = VIEWS.select(range(40))
    image = scene.image.copy()
    image[..., 0] = 2 * scene.camera.K[0, 2] - image[..., 0]
    if swap:
        image = image[:, SWAPPED]
    _, _, plain = searched(scene, 0.04, 0.02)
    _, _, mirrored = searched(scene, 0.04, 0.02, image)
    for a, b in zip(plain, mirrored, strict=True):
        assert a.upper == pytest.approx(b.upper, rel=1e-12)
        np.testing.assert_allclose(a.intervals, b.intervals, rtol=1e-7)


@pytest.mark.parametrize("noise", [0.0, 4.0])
def test_a_larger_tolerance_never_shrinks_the_intervals(noise: float) -> None:
    scene = VIEWS.select(range(30)).with_noise(noise, np.random.default_rng(8))
    levels = [(1e-8, 1e-9), (0.005, 1e-9), (0.02, 0.01), (0.05, 0.01), (0.05, 0.03), (0.1, 0.05), (0.3, 0.1)]
    before: list[NeckDepths] | None = None
    for tolerance, tangent in levels:
        _, _, found = searched(scene, tolerance, tangent)
        for narrow, wide in zip(before or [], found, strict=bool(before)):
            assert narrow.upper <= wide.upper * (1 + 1e-12)
            for low, high in narrow.intervals:
                assert any(a <= low + 1e-6 and b >= high - 1e-6 for a, b in wide.intervals)
        before = found


def test_inside_the_intervals_the_misfit_is_within_the_tolerance_and_outside_it_is_not() -> None:
    rng = np.random.default_rng(9)
    scene = VIEWS.select(range(60)).with_noise(3.0, rng)
    _, closure, found = searched(scene, 0.05, 0.03)
    for frame, depths in enumerate(found):
        at = rng.uniform(depths.lower, depths.upper, 400)
        least = closure.least(np.full(400, frame), at)
        within = np.array([inside(depths, distance, 0.0) for distance in at])
        np.testing.assert_array_equal(within, least <= 0.05)


def test_no_minimum_is_missed_that_a_fine_grid_sees() -> None:
    scene = VIEWS.select(range(12)).with_noise(3.0, np.random.default_rng(10))
    _, closure, found = searched(scene, 0.2, 0.03)
    for frame, depths in enumerate(found):
        at = depths.upper * np.cos(np.linspace(0, np.arccos(depths.lower / depths.upper), 20_001))
        least = closure.least(np.full(len(at), frame), at)
        assert depths.residual[0] <= least.min() + 1e-12
        assert (np.diff(depths.residual) >= 0).all()
        np.testing.assert_allclose(
            closure.least(np.full(len(depths.minima), frame), depths.minima), depths.residual, atol=1e-9
        )


@settings(max_examples=40)
@given(st.lists(st.integers(1, 13), max_size=12, unique=True), st.integers(0, len(VIEWS) - 1))
def test_whatever_is_missing_the_truth_stays_inside(missing: list[int], frame: int) -> None:
    scene = VIEWS.select([frame])
    image = scene.image.copy()
    image[:, missing] = np.nan
    _, _, found = searched(scene, EXACT, image=image)
    for depths in found:
        assert inside(depths, true_distance(scene)[0])
        # The hips are lifted from the pelvis: without it their distance is not known.
        read = [{*pair, 3} if 4 in pair else set(pair) for pair in RIGID_SEGMENTS]
        assert depths.known == sum(not joints & set(missing) for joints in read)
    if not found:
        # The joints that hang on the neck are gone, and those beyond them with them.
        assert {1, 2, 3} <= set(missing)


def test_distorted_pixels_are_undistorted() -> None:
    lens = PinholeCamera(K=VIEWS.camera.K, distortion=np.array([-0.1, 0.02, 1e-4, -2e-4, 0.0]))
    scene = VIEWS.select(range(20))
    seen = sight(lens, FIGURE, lens.project(scene.joints_cam), np.full(20, ROUNDING))
    _, found = search(seen, np.arange(20), np.full(20, 1e-6))
    for distance, depths in zip(true_distance(scene), found, strict=True):
        assert np.abs(depths.minima - distance).min() < 1e-5


def test_where_nothing_is_within_the_tolerance_the_best_minimum_is_kept() -> None:
    image = VIEWS.image + np.random.default_rng(4).normal(0.0, 0.002, VIEWS.image.shape) * 1000
    _, _, found = searched(VIEWS, 0.0, 0.01, image)
    known = [depths for depths in found if depths.known and len(depths.minima)]
    assert len(known) > 0.9 * len([depths for depths in found if depths.known])
    assert all(depths.residual[0] > 0 and len(depths.minima) == 1 for depths in known)


def test_the_grid_stands_at_breaks_and_is_finer_where_there_are_none() -> None:
    """A break is one between the nearest and the farthest distance."""
    seen, closure, _ = searched(VIEWS, EXACT)
    frames = np.flatnonzero(np.isfinite(seen.farthest[:, 0]))
    upper = seen.farthest[frames, 0]
    grid, breaks = _angles(closure, frames, upper), closure.breaks(frames)
    count = breaks.shape[1]
    for angles, own, far in zip(grid, breaks, upper, strict=True):
        assert (np.diff(angles) >= 0).all()
        for k, at in enumerate(own):
            inside_ = closure.nearest < at < far
            node = np.arccos(at / far) if inside_ else angles[-1] * (k + 0.5) / count
            assert np.abs(angles - node).min() < 1e-12
