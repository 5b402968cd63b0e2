"""The parts of placing a neck: intervals, samples, suggestions and allowances, each by numbers of its own."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.cameras import PinholeCamera
from posekit.cameras.head.perspective import HeadPlacement
from posekit.cameras.neck.allowance import RIGID_JOINTS, allowances
from posekit.cameras.neck.body import NEAREST_DEPTH, sight
from posekit.cameras.neck.closure import RigidClosure
from posekit.cameras.neck.cover import cover, meet
from posekit.cameras.neck.given import NeckSettings, PlacementInput, with_own_head
from posekit.cameras.neck.pose import PartPoses, _origin, poses
from posekit.cameras.neck.search import _distinct, _gaps, _joined, search
from posekit.cameras.neck.suggestion import suggest
from posekit.errors import InputError
from posekit.geometry import Array, rotation_from_vector
from posekit.skeleton import JOINT, JOINTS, PARENTS, segment_name
from posekit.synthesis import random_views

FIGURE = load_figure()
CAMERA = PinholeCamera(K=np.array([[1000.0, 0.0, 320.0], [0.0, 1000.0, 240.0], [0.0, 0.0, 1.0]]))
VIEWS = random_views(FIGURE, 12, np.random.default_rng(8))
ends = st.floats(0.0, 10.0)


def unions(pairs: list[tuple[float, float]]) -> Array:
    """Make ascending intervals, that do not touch, of some numbers."""
    numbers = sorted({round(x, 3) for pair in pairs for x in pair})
    return np.array([numbers[k : k + 2] for k in range(0, len(numbers) - 1, 2)]).reshape(-1, 2)


def inside(intervals: Array, at: float) -> bool:
    return any(low <= at <= high for low, high in intervals.tolist())


# --- intervals and samples ------------------------------------------------------------------------------


@given(a=st.lists(st.tuples(ends, ends), max_size=4), b=st.lists(st.tuples(ends, ends), max_size=4))
def test_what_two_unions_share_is_inside_both(
    a: list[tuple[float, float]], b: list[tuple[float, float]]
) -> None:
    one, other = unions(a), unions(b)
    both = meet(one, other)
    assert (both[:, 0] <= both[:, 1]).all() and (np.diff(both[:, 0]) > 0).all()
    assert (both[1:, 0] > both[:-1, 1]).all()
    edges = np.concatenate([one.ravel(), other.ravel(), both.ravel()])
    for at in np.concatenate([edges, edges + 1e-4, edges - 1e-4]):
        assert inside(both, at) == (inside(one, at) and inside(other, at))


@given(
    a=st.lists(st.tuples(ends, ends), min_size=1, max_size=5),
    reach=st.floats(0.02, 3.0),
    most=st.integers(1, 9),
)
def test_samples_cover_intervals_as_far_as_is_said(
    a: list[tuple[float, float]], reach: float, most: int
) -> None:
    intervals = unions(a)
    samples, step = cover(intervals, reach, most)
    if not len(intervals):
        assert len(samples) == step == 0
        return
    width = intervals[:, 1] - intervals[:, 0]
    least = sum(max(1, math.ceil(w / (2 * reach) - 1e-9)) for w in width)
    assert 1 <= len(samples) <= most and (np.diff(samples) > 0).all()
    if least <= most:
        assert len(samples) == least and step <= reach + 1e-9
        reached = [np.abs(samples - at).min() for low, high in intervals for at in np.linspace(low, high, 50)]
        assert max(reached) <= step + 1e-9
    elif len(intervals) > most:
        kept = np.sort(np.argsort(-width, kind="stable")[:most])
        np.testing.assert_allclose(samples, intervals[kept].mean(axis=1))
        assert step == pytest.approx(width[kept].max() / 2)
    # As wide as they must be, by five per cent at most.
    if least > most >= len(intervals):
        wider = step / 1.05 * 0.999
        assert sum(max(1, math.ceil(w / (2 * wider) - 1e-9)) for w in width) > most or len(samples) == len(
            intervals
        )


def test_intervals_that_touch_are_one_and_minima_that_are_one_are_said_once() -> None:
    apart = np.array([[1.0, 2.0], [2.0 + 1e-10, 3.0], [3.1, 4.0], [4.0, 5.0], [5.0 + 1e-8, 6.0]])
    np.testing.assert_allclose(_joined(apart), [[1.0, 3.0], [3.1, 5.0], [5.0, 6.0]])
    np.testing.assert_array_equal(_joined(apart[:1]), apart[:1])
    at, misfit = _distinct(np.array([2.0, 2.0 + 1e-9, 2.0 + 1e-8, 3.0]), np.arange(4.0))
    np.testing.assert_array_equal(misfit, [0.0, 2.0, 3.0])
    np.testing.assert_allclose(at, [2.0, 2.0, 3.0], atol=1e-7)


class _TwoBranches:
    """Branch 0 is within a tolerance of 0.1 from 2.05 to 2.25 m, branch 1 from 1.75 to 1.95 m."""

    def all(self, rows: Array, neck: Array) -> Array:
        return np.abs(np.stack([neck - 2.15, neck - 1.85], axis=-1))

    def least(self, rows: Array, neck: Array) -> Array:
        return np.asarray(self.all(rows, neck).min(axis=-1))


def test_a_gap_between_two_branches_inside_a_cell_is_found() -> None:
    distance = np.array([[2.4, 2.2, 1.8, 1.6]])
    closure: Any = _TwoBranches()
    tolerance = np.array([0.1])
    within = closure.all(np.array([0]), distance) <= tolerance
    found = _gaps(closure, np.array([0]), distance, within, tolerance)
    np.testing.assert_allclose(np.sort(found.distance), [1.95, 2.0, 2.05], atol=1e-9)
    np.testing.assert_allclose(found.misfit[np.argsort(found.distance)], [0.1, 0.15, 0.1], atol=1e-9)
    assert found.frame.tolist() == [0, 0, 0]
    wider = np.array([0.2])  # the two overlap: no gap
    none = _gaps(closure, np.array([0]), distance, closure.all(np.array([0]), distance) <= wider, wider)
    assert len(none.distance) == 0


# --- how far away a body can be -------------------------------------------------------------------------


def test_nothing_is_farther_than_its_segments_reach() -> None:
    """From the true neck every joint has an end; a little beyond the bound some chain has none."""
    seen = sight(VIEWS.camera, FIGURE, VIEWS.image, np.zeros(len(VIEWS)))
    assert seen.nearest == NEAREST_DEPTH * FIGURE.lengths["neck-pelvis"]
    for frame in range(len(VIEWS)):
        true = np.linalg.norm(VIEWS.joints_cam[frame], axis=-1)
        assert (true <= seen.farthest[frame] * (1 + 1e-9)).all()
        joint = seen.bounding[frame, 0]
        assert seen.segment(frame) == segment_name((PARENTS[joint], int(joint)))
        for part in range(1, len(JOINTS)):
            parent = PARENTS[part]
            cosine, sine = seen.angle(parent, part)
            np.testing.assert_allclose(cosine**2 + sine**2, 1.0)
            rays = VIEWS.joints_cam / np.linalg.norm(VIEWS.joints_cam, axis=-1, keepdims=True)
            np.testing.assert_allclose(
                cosine, np.einsum("fi,fi->f", rays[:, parent], rays[:, part]), atol=1e-12
            )
            assert seen.length(parent, part) == FIGURE.lengths[segment_name((parent, part))]


@pytest.mark.parametrize("tangent", [0.0, 0.02])
def test_two_joints_bound_each_other_by_the_sine_between_them(tangent: float) -> None:
    """A segment of length l, seen under the angle a, is no farther than l / sin a."""
    image = np.full((2, 14, 2), np.nan)
    image[:, JOINT["neck"]] = [320.0, 240.0]
    image[0, JOINT["pelvis"]] = [320.0, 340.0]
    length = FIGURE.lengths["neck-pelvis"]
    seen = sight(CAMERA, FIGURE, image, np.full(2, tangent))
    assert seen.farthest[0, 0] == pytest.approx((length + tangent) / math.sin(math.atan(0.1)))
    assert seen.segment(0) == "neck-pelvis" and seen.segment(1) == ""
    assert np.isinf(seen.farthest[1, 0]) and np.isinf(seen.farthest[0, JOINT["pelvis"]])
    assert np.isnan(seen.farthest[0, JOINT["left_hip"]])


def test_a_body_in_front_of_the_camera_closes_where_it_is() -> None:
    seen = sight(VIEWS.camera, FIGURE, VIEWS.image, np.full(len(VIEWS), 1e-9))
    closure = RigidClosure(seen)
    rows = np.arange(len(VIEWS))
    true = np.linalg.norm(VIEWS.joints_cam[:, 0], axis=-1)
    assert closure.least(rows, true).max() < 1e-8
    assert closure.known.tolist() == [4] * len(VIEWS)
    assert closure.unit == FIGURE.lengths["neck-pelvis"]
    image = VIEWS.image.copy()
    image[:, JOINT["pelvis"]] = np.nan
    assert RigidClosure(sight(VIEWS.camera, FIGURE, image, np.zeros(len(VIEWS)))).known.tolist() == [1] * len(
        VIEWS
    )
    image = VIEWS.image.copy()
    image[:, JOINT["left_hip"]] = np.nan
    assert RigidClosure(sight(VIEWS.camera, FIGURE, image, np.zeros(len(VIEWS)))).known.tolist() == [3] * len(
        VIEWS
    )
    # Of all 32 branches each is what it is alone, and none is nearer than the camera.
    at = true[:, None] * [0.97, 1.0]
    every = closure.all(rows, at)
    for branch in range(32):
        alone = closure.one(rows[:, None], np.full((len(VIEWS), 1), branch), at)
        np.testing.assert_allclose(alone, every[..., branch], rtol=1e-9)
    near = np.full((len(VIEWS), 1), seen.nearest * 0.99)
    assert (
        np.isinf(closure.all(rows, near)).all()
        and np.isinf(closure.one(rows[:, None], np.zeros_like(near, dtype=int), near)).all()
    )


def test_many_frames_are_searched_as_one_by_one() -> None:
    seen = sight(VIEWS.camera, FIGURE, VIEWS.image, np.full(len(VIEWS), 1e-9))
    frames = np.tile(np.arange(len(VIEWS)), 6)[:70]
    _, together = search(seen, frames, np.full(70, 0.03))
    _, alone = search(seen, frames[64:65], np.full(1, 0.03))
    np.testing.assert_allclose(together[64].intervals, alone[0].intervals)
    np.testing.assert_allclose(
        together[64].minima, together[int(np.flatnonzero(frames == frames[64])[0])].minima
    )
    assert len(together) == 70
    for depths in together:
        assert (
            depths.residual <= max(0.03, depths.residual.min())
        ).all() and not depths.minima.flags.writeable


# --- poses and suggestions ------------------------------------------------------------------------------

TORSO = FIGURE.neutral_points[:4] - FIGURE.neutral_points[0]


def pictured(count: int = 6, distance: float = 3.0) -> tuple[Array, Array, Array]:
    """Turn the torso and look at it: image, rotations, necks."""
    rng = np.random.default_rng(2)
    R = rotation_from_vector(rng.uniform(-1.0, 1.0, (count, 3)))
    neck = np.array([0.2, -0.1, distance]) + rng.uniform(-0.1, 0.1, (count, 3))
    points = neck[:, None] + np.einsum("fij,pj->fpi", R, TORSO)
    return CAMERA.project(points), R, neck


def test_poses_of_exact_points_are_the_truth_with_the_deviation_of_its_jacobian() -> None:
    image, R, neck = pictured()
    found = poses(CAMERA, TORSO, image, np.full((6, 4), 2.0), np.zeros(4))
    np.testing.assert_allclose(found.R[:, 0], R, atol=1e-5)
    np.testing.assert_allclose(found.origin[:, 0], neck, atol=1e-5)
    assert found.cost[:, 0].max() < 1e-8 and found.rms[:, 0].max() < 1e-4
    assert found.freedom.tolist() == [2] * 6 and found.found[:, 0].all()
    ray = neck / np.linalg.norm(neck, axis=1, keepdims=True)
    # Numerically: the pose as a function of the image, a pixel at a time.
    directions = [ray, *(np.tile(axis, (6, 1)) for axis in np.eye(3))]
    variance = np.zeros((4, 6))
    for point in range(4):
        for axis in range(2):
            moved = image.copy()
            moved[:, point, axis] += 1e-2
            other = poses(CAMERA, TORSO, moved, np.full((6, 4), 2.0), np.zeros(4)).origin[:, 0]
            variance += [(np.einsum("fi,fi->f", other - neck, way) / 1e-2 * 2.0) ** 2 for way in directions]
    for way, expected in zip(directions, variance, strict=True):
        np.testing.assert_allclose(found.deviation(way)[:, 0], np.sqrt(expected), rtol=0.05)
    # An offset of the body's points counts as so many pixels at their depth.
    offset = poses(CAMERA, TORSO, image, np.zeros((6, 4)), np.full(4, 0.01))
    pixels = 0.01 * 1000.0 / neck[:, 2]
    np.testing.assert_allclose(
        offset.deviation(ray)[:, 0] / found.deviation(ray)[:, 0], pixels / 2.0, rtol=0.1
    )
    few = image.copy()
    few[:, 3] = np.nan
    assert not poses(CAMERA, TORSO, few, np.full((6, 4), 2.0), np.zeros(4)).found.any()


def test_an_origin_moves_with_each_unknown_as_its_covariance_says() -> None:
    """Turns are about the camera's axes, before the pose."""
    rng = np.random.default_rng(3)
    R, size, centre = rotation_from_vector(rng.normal(size=(5, 3))), np.full(5, 0.4), rng.normal(size=(5, 3))
    shift, scale, jacobian = rng.normal(size=(5, 2)), rng.uniform(0.1, 0.5, 5), rng.normal(size=(5, 8, 6))

    def moved(step: Array) -> tuple[Array, Array]:
        end = HeadPlacement(rotation_from_vector(step[:3]) @ R, shift + step[3:5], scale + step[5], scale)
        return _origin(end, jacobian, centre, size)[1:]

    by = np.stack([(moved(step)[0] - moved(-step)[0]) / 2e-6 for step in 1e-6 * np.eye(6)], axis=-1)
    expected = by @ np.linalg.inv(np.swapaxes(jacobian, 1, 2) @ jacobian) @ np.swapaxes(by, 1, 2)
    np.testing.assert_allclose(moved(np.zeros(6))[1], expected, rtol=1e-6, atol=1e-6)


def part_poses(
    cost: list[list[float]], *, depth: float = 3.0, deviation: float = 0.05, freedom: int = 2
) -> PartPoses:
    shape = np.shape(cost)
    origin = np.zeros((*shape, 3))
    origin[..., 2] = depth + 0.1 * np.arange(shape[1])
    return PartPoses(
        R=np.tile(np.eye(3), (*shape, 1, 1)),
        origin=origin,
        cost=np.array(cost, dtype=float),
        rms=np.full(shape, 1.25),
        covariance=np.tile(deviation**2 * np.eye(3), (*shape, 1, 1)),
        freedom=np.full(shape[0], freedom),
    )


AHEAD = np.array([[0.0, 0.0, 1.0]])


@pytest.mark.parametrize(("part", "changes", "seen", "bent", "words"), [
    ("head", {}, 4, 0.0, ""),
    ("head", {}, 3, 0.0, "the head does not suffice: 3 of its points are seen, expected at least 4"),
    ("head", {"cost": [[np.inf]]}, 5, 0.0, "the head does not suffice: no pose fits its image"),
    ("head", {"cost": [[13.8]]}, 4, 0.0, ""),
    ("head", {"cost": [[13.9]]}, 4, 0.0, "miss their image by 1.25 px, more than their deviation explains"),
    ("head", {"cost": [[18.4]], "freedom": 4}, 5, 0.0, ""),
    ("head", {"cost": [[18.5]], "freedom": 4}, 5, 0.0, "miss their image"),
    ("head", {"cost": [[22.4]], "freedom": 6}, 6, 0.0, ""),
    ("head", {"cost": [[22.5]], "freedom": 6}, 6, 0.0, "miss their image"),
    ("head", {"cost": [[900.0]], "freedom": 8}, 7, 0.0, ""),
    ("head", {"deviation": 0.099}, 4, 0.0, ""),
    ("head", {"deviation": 0.101}, 4, 0.0, "it tells the neck's depth to 0.1 m, expected 0.1 m"),
    ("torso", {"deviation": 0.199}, 4, 0.0, ""),
    ("torso", {"deviation": 0.201}, 4, 0.0, "it tells the neck's depth to 0.2 m, expected 0.2 m"),
    ("head", {"deviation": 0.06}, 4, 0.08, "to 0.1 m"),
    ("head", {"depth": -3.0}, 4, 0.0, "no pose fits its image"),
])  # fmt: skip
def test_a_part_says_why_it_does_not_suffice(
    part: Any, changes: dict[str, Any], seen: int, bent: float, words: str
) -> None:
    found = suggest(
        part, part_poses(**{"cost": [[1.0]], **changes}), AHEAD, np.array([seen]), bent + 1e-9 * (bent > 0)
    )
    assert (found.reasons[0] == "") == (words == "") and words in found.reasons[0]
    assert found.rms.tolist() == [1.25] and found.part == part


def test_poses_are_plausible_that_fit_almost_as_well() -> None:
    found = suggest("torso", part_poses([[1.0, 9.99, 10.01, np.inf]]), AHEAD, np.array([4]), 0.0)
    np.testing.assert_allclose(found.distance, [[3.0, 3.1, np.nan, np.nan]])
    np.testing.assert_allclose(found.deviation, [[0.05, 0.05, np.nan, np.nan]])
    np.testing.assert_allclose(found.intervals(0), [[2.875, 3.125], [2.975, 3.225]])
    np.testing.assert_allclose(found.intervals(0, sigmas=1.0), [[2.95, 3.05], [3.05, 3.15]])
    assert found.found(0) and not found.distance.flags.writeable
    none = suggest("torso", part_poses([[np.inf]]), AHEAD, np.array([4]), 0.0)
    assert not none.found(0) and none.intervals(0).shape == (0, 2)


# --- what is given --------------------------------------------------------------------------------------


def checked(**changes: Any) -> PlacementInput:
    given_ = {"image": VIEWS.image, "head_image": None, "root": None, "camera": VIEWS.camera}
    own = {name: changes.pop(name) for name in tuple(changes) if name in given_}
    return PlacementInput.checked(**{**given_, **own}, settings=replace(NeckSettings(), **changes))


@pytest.mark.parametrize(("changes", "words"), [
    ({"tolerance": -1e-9}, "tolerance is -1e-09 m; expected a finite length of at least 0 m"),
    ({"tangent": math.inf}, "tangent is inf m; expected a finite length of at least 0 m"),
    ({"reach": 0.9e-6}, "reach is 9e-07 m; expected a finite length of at least 1e-06 m"),
    ({"most": 0}, "most is 0; expected at least one neck a frame"),
    ({"deviation": -1.0}, "deviation of neck is -1 px; expected zero or a positive, finite number"),
    ({"offset": np.array([0.0] * 18 + [np.nan])}, "offset of left_ear is nan m; expected zero"),
    ({"deviation": np.zeros(3)}, r"deviation has shape (3,); expected one number, or (12, 19)"),
    ({"root": np.tile([0.0, 0.0, 0.0], (12, 1))}, "root of frame 0 is [0.0, 0.0, 0.0] m, behind the camera; expected"),
    ({"root": np.zeros((3, 3))}, r"root has shape (3, 3); expected (12, 3), NaN where not seen"),
    ({"image": np.zeros((12, 13, 2))}, r"image has shape (12, 13, 2); expected (F, 14, 2), NaN where not seen"),
    ({"head_image": np.zeros((12, 4, 2))}, r"head_image has shape (12, 4, 2); expected (12, 5, 2)"),
    ({"image": np.full((12, 14, 2), np.inf)}, "image[0, 0] is infinite; expected finite numbers, or NaN"),
    ({"camera": PinholeCamera(K=np.tile(CAMERA.K, (2, 1, 1)))}, "K for 2 frames, the image has 12; give one K"),
])  # fmt: skip
def test_what_is_impossible_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as caught:
        checked(**changes)
    assert words in str(caught.value)


def test_what_is_given_is_filled_up() -> None:
    half = VIEWS.image.copy()
    half[0, 3, 1] = np.nan
    found = checked(image=half, tolerance=0.0, reach=1e-6, most=1)
    assert np.isnan(found.image[0, 3]).all() and np.isfinite(found.image[0, 2]).all()
    assert np.isnan(found.head_image).all() and found.head_image.shape == (12, 5, 2)
    assert np.isnan(found.root).all() and (found.deviation == 2.0).all() and (found.offset == 0.0).all()
    assert found.deviation.shape == (12, 19) and found.offset.shape == (19,)
    assert checked(own_head=np.zeros((2, 3))).head_image.shape == (12, 7, 2)
    usual = NeckSettings()
    assert (usual.method, usual.reach, usual.most, usual.tolerance, usual.tangent) == (
        "auto",
        0.05,
        12,
        None,
        None,
    )
    np.testing.assert_allclose(
        with_own_head(np.array([[1.0, 2.0, 3.0, 4.0, 5.0]]), 2), [[1, 2, 3, 4, 5, 3, 3]]
    )
    assert with_own_head(np.ones(5), 0).shape == (5,)


@pytest.mark.parametrize("deviation", [0.0, 0.5, 3.0])
def test_allowances_are_deviations_at_the_farthest_depth(deviation: float) -> None:
    """Three deviations and what foreshortening takes of a shoulder; four for a segment; rounding of exact points."""
    found = allowances(VIEWS.camera, FIGURE, checked(deviation=deviation, offset=0.0))
    f = VIEWS.camera.K[0, 0] if VIEWS.camera.K.ndim == 2 else VIEWS.camera.K[:, 0, 0]

    def sigma(tangent: Array) -> Array:
        seen = sight(VIEWS.camera, FIGURE, VIEWS.image, tangent)
        return np.asarray(deviation * seen.farthest[:, 0] * seen.rays[:, 0, 2] / f)

    first = sigma(np.zeros(12))
    expected = (first + sigma(4 * first)) / 2
    shoulder = (FIGURE.lengths["neck-right_shoulder"] + FIGURE.lengths["neck-left_shoulder"]) / 2
    np.testing.assert_allclose(found.tangent, np.maximum(4 * expected, 1e-9))
    np.testing.assert_allclose(found.rigid, np.maximum(3 * expected + np.sqrt(2 * shoulder * expected), 1e-8))
    both = allowances(VIEWS.camera, FIGURE, checked(deviation=deviation, tolerance=0.02, tangent=0.01))
    assert (both.rigid == 0.02).all() and (both.tangent == 0.01).all()
    one = allowances(VIEWS.camera, FIGURE, checked(deviation=deviation, tolerance=0.02))
    np.testing.assert_allclose(one.rigid, 0.02)
    np.testing.assert_allclose(one.tangent, found.tangent)
    other = allowances(VIEWS.camera, FIGURE, checked(deviation=deviation, tangent=0.01))
    np.testing.assert_allclose(other.rigid, found.rigid)
    assert {JOINTS[k] for k in RIGID_JOINTS} == {
        "neck",
        "right_shoulder",
        "left_shoulder",
        "pelvis",
        "right_hip",
        "left_hip",
    }


def test_offsets_are_allowed_for_beside_deviations() -> None:
    offset = np.zeros(19)
    offset[JOINT["neck"]] = 0.03
    found = allowances(VIEWS.camera, FIGURE, checked(deviation=0.0, offset=offset))
    np.testing.assert_allclose(found.tangent, 4 * 0.03 / np.sqrt(6))
    image = VIEWS.image.copy()
    image[:, JOINT["left_hip"]] = np.nan
    fewer = allowances(VIEWS.camera, FIGURE, checked(image=image, deviation=0.0, offset=offset))
    np.testing.assert_allclose(fewer.tangent, 4 * 0.03 / np.sqrt(5))


def test_of_a_view_of_nothing_no_deviation_is_allowed_for() -> None:
    image = VIEWS.image.copy()
    image[3] = np.nan
    found = allowances(VIEWS.camera, FIGURE, checked(image=image, deviation=3.0, offset=0.0))
    assert (found.tangent[3], found.rigid[3]) == (1e-9, 1e-8) and (np.delete(found.rigid, 3) > 0.01).all()
    image[4, [JOINT["neck"], JOINT["pelvis"]]] = np.nan
    hidden = allowances(VIEWS.camera, FIGURE, checked(image=image, deviation=3.0, offset=0.02))
    seen = np.isfinite(image[4, RIGID_JOINTS, 0]).sum()
    assert hidden.tangent[4] == pytest.approx(4 * 0.02) and seen == 4
