"""Placing the neck: which method tells, what is chosen from it, and what is said where nothing tells."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.cameras import PinholeCamera
from posekit.cameras.neck import NeckPlacement, place
from posekit.cameras.neck.cover import cover, meet
from posekit.cameras.neck.given import MAX_NECKS, REACH_METRES
from posekit.cameras.neck.suggestion import SUFFICIENT_DEVIATION_METRES
from posekit.errors import InputError
from posekit.skeleton import JOINT, JOINTS, PARENTS, TREE_SEGMENTS, segment_name
from posekit.synthesis import CameraSphere, SyntheticScene, random_views, seq1, seq2
from posekit.tree import InterpretationTree
from posekit.validators.rigid_parts import rigid_parts

FIGURE = load_figure()
VIEWS = random_views(FIGURE, 120, np.random.default_rng(20))
NEAR = random_views(FIGURE, 30, np.random.default_rng(21), CameraSphere(distance=(1.8, 2.2), f=700.0))


def placed(scene: SyntheticScene, **options: Any) -> list[NeckPlacement]:
    return place(scene.camera, scene.figure, scene.image, scene.head_image, **options)


def inside(found: NeckPlacement, depth: float, slack: float = 1e-7) -> bool:
    low, high = found.intervals.T
    return bool(((low <= depth + slack) & (high >= depth - slack)).any())


def chosen_near(found: NeckPlacement, depth: float) -> bool:
    return bool(np.abs(found.depths - depth).min(initial=np.inf) <= found.step + 1e-6)


@pytest.mark.parametrize("method", ["auto", "head", "torso", "search"])
def test_exact_views_are_placed_exactly(method: Any) -> None:
    for found, neck in zip(placed(VIEWS, method=method), VIEWS.joints_cam[:, 0], strict=True):
        assert found.method in ((method,) if method != "auto" else ("head", "torso", "search"))
        assert np.linalg.norm(found.necks - neck, axis=1).min() < 1e-6
        assert len(found.necks) <= 2
        assert found.step == 0
        assert found.misfit.max() < 1e-8
        assert inside(found, neck[2])
        assert found.lower <= neck[2] <= found.upper * (1 + 1e-9)
        assert found.reason == ""
        assert found.unit == ("m" if found.method == "search" else "px")


@pytest.mark.parametrize("scene", [seq1(), seq2()], ids=["seq1", "seq2"])
def test_the_papers_walker_is_placed_by_its_head_or_without_it(scene: SyntheticScene) -> None:
    for method in ("auto", "search"):
        for found, neck in zip(
            placed(scene, method=method, deviation=1e-5), scene.joints_cam[:, 0], strict=True
        ):
            assert np.linalg.norm(found.necks - neck, axis=1).min() < 1e-6


def test_auto_takes_the_head_where_it_suffices_then_the_torso_then_the_search() -> None:
    by_head = placed(NEAR, deviation=0.3)
    assert {found.method for found in by_head} == {"head"}
    torso = placed(NEAR, deviation=4.0)
    assert {found.method for found in torso} >= {"torso"}
    search = placed(VIEWS, deviation=15.0)
    assert {found.method for found in search} >= {"search"}
    for found in by_head + torso + search:
        if found.method in ("head", "torso"):
            assert found.deviation <= SUFFICIENT_DEVIATION_METRES[found.method]
        before = {"head": 0, "torso": 1, "search": 2}[found.method]
        assert len(found.notes) == before
        assert all("does not suffice" in note or "is not used" in note for note in found.notes)
        assert np.isnan(found.deviation) == (found.method == "search")


@pytest.mark.parametrize("noise", [1.0, 3.0, 8.0])
def test_with_noise_some_neck_is_within_a_step_of_the_truth(noise: float) -> None:
    scene = VIEWS.with_noise(noise, np.random.default_rng(22))
    found = placed(scene, deviation=noise)
    depths = VIEWS.joints_cam[:, 0, 2]
    retained = np.mean([inside(one, depth) for one, depth in zip(found, depths, strict=True)])
    near = np.mean([chosen_near(one, depth) for one, depth in zip(found, depths, strict=True)])
    assert retained > 0.94
    assert near > 0.92
    assert max(len(one.necks) for one in found) <= MAX_NECKS


def test_every_neck_is_on_its_ray_and_in_an_interval_and_as_far_off_as_told() -> None:
    scene = VIEWS.with_noise(3.0, np.random.default_rng(23))
    for frame, found in enumerate(placed(scene, deviation=3.0, method="search")):
        pixels = scene.camera.project(found.necks[None])[0]
        np.testing.assert_allclose(pixels, np.tile(scene.image[frame, 0], (len(pixels), 1)), atol=1e-6)
        assert all(inside(found, depth) for depth in found.depths)
        assert (np.diff(found.depths) > 0).all()
        assert (found.misfit <= found.tolerance + 1e-9).all()
        low, high = found.intervals.T
        for depth in np.concatenate([np.linspace(a, b, 50) for a, b in zip(low, high, strict=True)]):
            assert np.abs(found.depths - depth).min() <= found.step + 1e-9
        assert found.step <= REACH_METRES or len(found.necks) >= MAX_NECKS - 2
        curve = found.curve[np.isfinite(found.curve[:, 1])]
        assert found.minima[0, 1] <= curve[:, 1].min() + 1e-12
        assert found.residual == found.minima[0, 1]


def test_the_tree_grows_from_the_necks_within_the_same_tolerance() -> None:
    """A neck that is chosen has leaves whose rigid parts pass the check."""
    scene = VIEWS.select(range(20)).with_noise(3.0, np.random.default_rng(24))
    lengths = np.array([0.0] + [FIGURE.lengths[segment_name(segment)] for segment in TREE_SEGMENTS])
    tree = InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=lengths)
    for frame, found in enumerate(placed(scene, deviation=3.0)):
        n = len(found.necks)
        assert n
        checks = rigid_parts(FIGURE, tolerance=found.tolerance + 1e-9, mode="distances")
        image = np.repeat(scene.image[frame : frame + 1], n, axis=0)
        leaves = tree.grow(scene.camera, found.necks, image, checks, tolerance=found.tangent + 1e-9)
        assert set(leaves.frame.tolist()) == set(range(n))


def test_the_tolerances_that_are_not_given_follow_from_the_deviation() -> None:
    few = VIEWS.select(range(10))
    exact, fine, coarse = (placed(few, deviation=px) for px in (0.0, 1.0, 6.0))
    for a, b, c in zip(exact, fine, coarse, strict=True):
        assert (a.tolerance, a.tangent) == (1e-8, 1e-9)
        assert a.tolerance < b.tolerance < c.tolerance
        assert a.tangent < b.tangent < c.tangent
    told = placed(few, tolerance=0.07)
    assert {found.tolerance for found in told} == {0.07}
    assert all(found.tangent > 1e-3 for found in told)
    shifted = placed(few, deviation=1.0, offset=np.where(np.arange(19) == JOINT["pelvis"], 0.03, 0.0))
    assert all(a.tolerance > b.tolerance for a, b in zip(shifted, fine, strict=True))


def test_one_distance_that_closes_is_no_proof_that_points_are_exact() -> None:
    scene = VIEWS.select(range(20))
    image = scene.image.copy()
    image[:, JOINT["pelvis"]] = np.nan
    for found, depth in zip(
        place(scene.camera, FIGURE, image, deviation=2.0), scene.joints_cam[:, 0, 2], strict=True
    ):
        assert (found.method, found.closing) == ("search", 1)
        assert len(found.necks) > 1
        assert chosen_near(found, depth)
    for found, depth in zip(
        place(scene.camera, FIGURE, image, deviation=0.0), scene.joints_cam[:, 0, 2], strict=True
    ):
        assert found.step == 0
        assert np.abs(found.depths - depth).min() < 1e-6


def test_without_a_head_the_torso_tells_and_without_a_shoulder_the_search() -> None:
    scene = VIEWS.select(range(10)).with_noise(1.0, np.random.default_rng(25))
    image = scene.image.copy()
    assert {found.method for found in place(scene.camera, FIGURE, image, deviation=1.0)} == {"torso"}
    image[:, JOINT["left_shoulder"]] = np.nan
    found = place(scene.camera, FIGURE, image, deviation=1.0)
    assert {one.method for one in found} == {"search"}
    assert "0 of its points" in found[0].notes[0]
    assert "3 of its points" in found[0].notes[1]
    asked = place(scene.camera, FIGURE, image, deviation=1.0, method="head")
    assert {one.method for one in asked} == {"none"}
    assert "the head does not suffice: 0 of its points are seen" in asked[0].reason
    assert np.isfinite(asked[0].upper)


def test_a_head_of_another_size_is_not_used_where_its_depth_is_impossible() -> None:
    scene = NEAR.select(range(10))
    image = scene.head_image.copy()
    middle = image.mean(axis=1, keepdims=True)
    found = place(scene.camera, FIGURE, scene.image, middle + 0.5 * (image - middle), deviation=0.3)
    for one, neck in zip(found, scene.joints_cam[:, 0], strict=True):
        assert one.method == "torso"
        assert np.linalg.norm(one.necks - neck, axis=1).min() < 1e-6
    assert any("the head is not used: it puts the neck at" in one.notes[0] for one in found)


def test_a_given_root_is_kept_and_compared() -> None:
    scene = VIEWS.select(range(4))
    root = scene.joints_cam[:, 0].copy()
    root[1] *= 3.0
    root[2] = np.nan
    image = scene.image.copy()
    image[3, 0] = np.nan
    found = place(scene.camera, FIGURE, image, scene.head_image, root=root)
    assert [one.method for one in found][:2] == ["given", "given"]
    assert found[2].method != "given"
    assert found[3].method == "given"
    np.testing.assert_array_equal(found[0].necks, root[:1])
    assert found[0].residual < 1e-8
    assert found[0].notes == ()
    ranges = ", ".join(f"{low:.4g} to {high:.4g}" for low, high in found[1].intervals)
    outside = f"outside of the depths at which the rigid parts close ({ranges} m)"
    assert found[1].notes == (f"the given neck, {root[1, 2]:.4g} m away, is {outside}",)
    assert np.isnan(found[3].misfit).all()


def test_reasons_say_what_to_do() -> None:
    image = VIEWS.image[:5].copy()
    image[0, 0] = np.nan
    image[1, 1:] = np.nan
    image[2, [1, 2]] += [[4000.0, 0.0], [-4000.0, 0.0]]
    image[3, JOINT["left_shoulder"]] = image[3, JOINT["right_shoulder"]]
    image[3, JOINT["pelvis"]] = image[3, 0]
    image[4, 1] = [np.nan, 500.0]  # half a point is none
    found = place(VIEWS.camera, FIGURE, image, deviation=1.0, tolerance=0.02)
    assert [one.method for one in found] == ["none", "none", "none", "none", "search"]
    assert found[0].reason == "the neck, from which the tree grows, is not seen"
    assert "add shoulders and pelvis" in found[1].reason
    assert "close at no depth" in found[2].reason or "too short for its image" in found[2].reason
    assert "they miss by" in found[3].reason
    assert "allow more tolerance" in found[3].reason
    for one in found[:4]:
        assert one.necks.shape == (0, 3)
        assert "\n" not in one.reason
    absurd = VIEWS.image[:4].copy()
    absurd[0] = 500.0  # all in one place
    absurd[1] = 1e300
    absurd[2] *= 1e9
    absurd[3, 1:] += 1e-9 * np.arange(26).reshape(13, 2)  # nearly as it was
    odd = place(VIEWS.camera, FIGURE, absurd, np.full((4, 5, 2), 1e300))
    assert [one.method for one in odd[:3]] == ["none"] * 3
    assert "no other joint is seen elsewhere" in odd[0].reason
    assert np.abs(odd[3].depths - VIEWS.joints_cam[3, 0, 2]).min() < 1e-3
    tiny = place(VIEWS.camera, FIGURE.from_stature(0.5), VIEWS.image[:1] * 40.0, deviation=0.0)[0]
    assert tiny.method == "none"


@settings(max_examples=25)
@given(st.lists(st.integers(0, 18), max_size=18, unique=True), st.integers(0, len(VIEWS) - 1))
def test_any_points_may_be_missing(missing: list[int], frame: int) -> None:
    scene = VIEWS.select([frame])
    image, head = scene.image.copy(), scene.head_image.copy()
    image[:, [k for k in missing if k < 14]] = np.nan
    head[:, [k - 14 for k in missing if k >= 14]] = np.nan
    (found,) = place(scene.camera, FIGURE, image, head)
    depth = scene.joints_cam[0, 0, 2]
    if found.reason:
        assert found.method == "none"
        assert 0 in missing or {1, 2, 3} <= set(missing)
    else:
        assert inside(found, depth)
        assert chosen_near(found, depth)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"image": np.zeros((3, 13, 2))}, r"image has shape \(3, 13, 2\)"),
        ({"image": np.full((3, 14, 2), np.inf)}, r"image\[0, 0\] is infinite"),
        ({"head_image": np.zeros((2, 5, 2))}, r"head_image has shape \(2, 5, 2\); expected \(3, 5, 2\)"),
        ({"root": np.zeros((3, 2))}, r"root has shape"),
        ({"root": np.tile([0.0, 0.0, -1.0], (3, 1))}, "behind the camera"),
        ({"method": "guess"}, "expected one of auto, head, torso, search"),
        ({"deviation": -1.0}, "deviation of neck is -1 px"),
        ({"deviation": np.nan}, "deviation of neck is nan px"),
        ({"deviation": np.ones(14)}, r"deviation has shape \(14,\)"),
        ({"offset": np.full(19, np.inf)}, "offset of neck is inf m"),
        ({"tolerance": -0.1}, "tolerance is -0.1 m"),
        ({"tolerance": np.nan}, "tolerance is nan m"),
        ({"tangent": np.inf}, "tangent is inf m"),
        ({"reach": 0.0}, "reach is 0.0 m"),
        ({"most": 0}, "most is 0"),
        ({"camera": PinholeCamera(K=np.tile(VIEWS.camera.K, (2, 1, 1)))}, "K for 2 frames, the image has 3"),
    ],
)
def test_bad_input_is_named(options: dict[str, Any], words: str) -> None:
    arguments: dict[str, Any] = {"camera": VIEWS.camera, "figure": FIGURE, "image": VIEWS.image[:3]} | options
    with pytest.raises(InputError, match=words) as raised:
        place(**arguments)
    assert "\n" not in str(raised.value)


def test_no_frames_are_no_placements() -> None:
    assert place(VIEWS.camera, FIGURE, np.empty((0, 14, 2))) == []


def test_a_placement_cannot_be_changed() -> None:
    (found,) = placed(VIEWS.select([0]))
    for values in (found.necks, found.minima, found.curve, found.intervals, found.misfit):
        with pytest.raises(ValueError, match="read-only"):
            values[...] = 0


def test_a_k_for_each_frame() -> None:
    K = np.repeat(VIEWS.camera.K[None], 6, axis=0)
    K[:, 0, 0] *= np.linspace(0.7, 1.4, 6)
    camera = PinholeCamera(K=K)
    joints = VIEWS.joints_cam[:6]
    for found, depth in zip(place(camera, FIGURE, camera.project(joints)), joints[:, 0, 2], strict=True):
        assert np.abs(found.depths - depth).min() < 1e-6


intervals = st.lists(st.floats(0.1, 50.0), min_size=2, max_size=16, unique=True).map(
    lambda ends: np.array(sorted(ends)[: len(ends) // 2 * 2]).reshape(-1, 2)
)


@given(intervals, st.floats(1e-3, 1.0), st.integers(1, 20))
def test_a_cover_reaches_every_depth_and_stays_inside(ranges: np.ndarray, reach: float, most: int) -> None:
    samples, told = cover(ranges, reach, most)
    assert 1 <= len(samples) <= most
    assert (np.diff(samples) > 0).all()
    assert ((samples[:, None] >= ranges[:, 0]) & (samples[:, None] <= ranges[:, 1])).any(axis=1).all()
    if len(ranges) <= most:
        grid = np.concatenate([np.linspace(low, high, 30) for low, high in ranges])
        assert np.abs(grid[:, None] - samples).min(axis=1).max() <= told * (1 + 1e-9) + 1e-12
        if told > reach * (1 + 1e-6):
            needed = np.ceil((ranges[:, 1] - ranges[:, 0]) / (2 * reach) - 1e-9).sum()
            assert needed > most


@given(intervals, intervals)
def test_intervals_meet_where_both_are(a: np.ndarray, b: np.ndarray) -> None:
    both = meet(a, b)
    at = np.linspace(0.0, 51.0, 997)

    def holds(ranges: np.ndarray) -> np.ndarray:
        return np.asarray(((at[:, None] >= ranges[:, 0]) & (at[:, None] <= ranges[:, 1])).any(axis=1))

    np.testing.assert_array_equal(holds(both), holds(a) & holds(b))
    assert (both[1:, 0] > both[:-1, 1]).all()


def test_of_a_neck_that_nothing_tells_all_is_empty_or_unknown() -> None:
    (found,) = place(VIEWS.camera, FIGURE, np.full((1, 14, 2), np.nan), np.full((1, 5, 2), np.nan))
    assert found.method == "none" and found.reason
    assert (found.necks.shape, found.misfit.shape, found.depths.shape) == ((0, 3), (0,), (0,))
    assert found.intervals.shape == found.minima.shape == found.curve.shape == (0, 2)
    numbers = (found.estimate, found.residual, found.deviation, found.lower, found.upper, found.tolerance)
    assert np.isnan([*numbers, found.tangent]).all()
    assert (found.step, found.closing, found.segment, found.notes, found.unit) == (0.0, 0, "", (), "m")
