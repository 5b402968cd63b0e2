"""Refinement's laws: the truth stays, chi2 never rises, chance is told from contradiction, errors are as stated."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import kstest

from posekit.body import Figure, load_figure
from posekit.cameras import Camera, PinholeCamera, ScaledOrthographicCamera
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.refinement import ObservedFrames, Refined, RootPrior, refine
from posekit.skeleton import JOINT, SEGMENT_NAMES
from posekit.synthesis import SyntheticScene, random_views

EXACT = 1e-9
TIGHT = 1e-18
"""A precision that takes postures on to rounding."""


@cache
def figure() -> Figure:
    return load_figure()


@cache
def scene(n: int = 120) -> SyntheticScene:
    return random_views(figure(), n, np.random.default_rng(11), ranges="urdf")


def known_root(view: SyntheticScene, deviation: float = 0.0) -> RootPrior:
    return RootPrior(
        mean=view.joints_cam[:, 0], covariance=np.tile(deviation**2 * np.eye(3), (len(view), 1, 1))
    )


def sight_of(
    view: SyntheticScene, pixels: float, noise: float | None = None, seed: int = 0, **other: object
) -> ObservedFrames:
    noisy = view.with_noise(pixels if noise is None else noise, np.random.default_rng(seed))
    given: dict[str, object] = {
        "figure": figure(),
        "camera": view.camera,
        "image": noisy.image,
        "deviation": pixels,
        "root": known_root(view),
    }
    return ObservedFrames(**(given | other))  # type: ignore[arg-type]


def nudged(view: SyntheticScene, size: float, seed: int = 5) -> Array:
    return view.joints_cam + np.random.default_rng(seed).normal(size=view.joints_cam.shape) * size


CAMERAS: dict[str, Camera] = {
    "pinhole": PinholeCamera(K=np.array([[1500.0, 0.0, 960.0], [0.0, 1500.0, 540.0], [0.0, 0.0, 1.0]])),
    "distorted": PinholeCamera(
        K=np.array([[1400.0, 2.0, 900.0], [0.0, 1350.0, 500.0], [0.0, 0.0, 1.0]]),
        distortion=np.array([-0.1, 0.02, 1e-3, -1e-3, 0.0]),
    ),
    "orthographic": ScaledOrthographicCamera(scale=350.0),
}


@pytest.mark.parametrize("rooted", [True, False])
@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
def test_the_exact_truth_without_noise_stays(camera: Camera, rooted: bool) -> None:
    view = scene()
    sight = sight_of(
        view,
        1.0,
        camera=camera,
        image=camera.project(view.joints_cam),
        root=known_root(view) if rooted else None,
    )
    refined = refine(sight, view.joints_cam)
    np.testing.assert_allclose(refined.joints, view.joints_cam, atol=EXACT)
    assert (refined.chi2 < 1e-12).all() and refined.converged.all() and (refined.p > 0.999).all()
    np.testing.assert_allclose(
        refined.lengths, list(figure().lengths.values()) * np.ones((len(view), 1)), atol=EXACT
    )


def test_configurations_are_refined_like_postures() -> None:
    view = scene()
    sight = sight_of(view, 1.0)
    by_q, by_joints = refine(sight, view.q), refine(sight, view.joints_cam)
    np.testing.assert_allclose(by_q.joints, by_joints.joints, atol=1e-4)
    placed = figure().forward_kinematics(by_joints.q)[:, :14]
    np.testing.assert_allclose(placed, by_joints.joints, atol=1e-9)


def test_from_beside_the_truth_it_comes_back() -> None:
    view = scene()
    refined = refine(sight_of(view, 1.0, noise=0.0), nudged(view, 0.01), precision=TIGHT, steps=60)
    # A segment at a right angle to its ray may fall to its other side, and a trunk to its mirror image.
    back = np.abs(refined.joints - view.joints_cam).max(axis=(1, 2))
    assert (back < 1e-6).mean() > 0.8
    assert np.median(back) < 1e-8


@pytest.mark.parametrize("pixels", [0.5, 2.0, 8.0])
@pytest.mark.parametrize("size", [0.0, 0.02, 0.1])
def test_chi2_never_increases(pixels: float, size: float) -> None:
    view = scene()
    refined = refine(sight_of(view, pixels), nudged(view, size))
    assert (refined.chi2 <= refined.start_chi2 + 1e-9).all()
    assert (refined.steps <= 45).all()


def test_chi2_is_what_its_definition_says() -> None:
    view = scene()
    sight = sight_of(view, 2.0, root=known_root(view, 0.02), limit_deviation=np.inf)
    refined = refine(sight, view.joints_cam)
    seen = ((view.camera.project(refined.joints) - sight.points()) / 2.0) ** 2
    root = (refined.joints[:, 0] - view.joints_cam[:, 0]) / 0.02
    np.testing.assert_allclose(refined.chi2, seen.sum(axis=(1, 2)) + (root**2).sum(axis=1), rtol=1e-6)


def test_a_rolled_camera_sees_rolled_postures() -> None:
    view = scene()
    c, s = np.cos(0.7), np.sin(0.7)
    roll = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    sight = sight_of(view, 2.0)
    centre = view.camera.K[:2, 2]
    turned = replace(
        sight,
        image=(sight.points() - centre) @ roll[:2, :2].T + centre,
        root=RootPrior(mean=view.joints_cam[:, 0] @ roll.T, covariance=np.zeros((len(view), 3, 3))),
    )
    start = nudged(view, 0.01)
    one = refine(sight, start, precision=TIGHT, steps=60)
    other = refine(turned, start @ roll.T, precision=TIGHT, steps=60)
    np.testing.assert_allclose(other.chi2, one.chi2, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(other.joints, one.joints @ roll.T, atol=1e-4)
    np.testing.assert_allclose(
        other.deviation[one.converged], one.deviation[one.converged], rtol=0.02, atol=1e-3
    )


def test_a_mirror_exchanges_left_and_right() -> None:
    view = scene()
    swap = np.array([JOINT[_other_side(name)] for name in JOINT])
    mirror = np.array([-1.0, 1.0, 1.0])
    centre = view.camera.K[0, 2]
    sight = sight_of(view, 2.0)
    image = sight.points()[:, swap].copy()
    image[..., 0] = 2 * centre - image[..., 0]
    mirrored = replace(
        sight,
        image=image,
        root=RootPrior(mean=view.joints_cam[:, 0] * mirror, covariance=np.zeros((len(view), 3, 3))),
    )
    start = nudged(view, 0.01)
    one = refine(sight, start, precision=TIGHT, steps=60)
    other = refine(mirrored, start[:, swap] * mirror, precision=TIGHT, steps=60)
    np.testing.assert_allclose(other.chi2, one.chi2, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(other.joints[:, swap] * mirror, one.joints, atol=1e-4)


def _other_side(name: str) -> str:
    for side, other in (("right_", "left_"), ("left_", "right_")):
        if name.startswith(side):
            return other + name.removeprefix(side)
    return name


def test_survivors_do_not_know_of_each_other(rng: np.random.Generator) -> None:
    view = scene()
    sight = sight_of(view, 2.0)
    frame = rng.integers(0, len(view), 300)
    start = view.joints_cam[frame] + rng.normal(size=(300, 14, 3)) * 0.01
    together = refine(sight, start, frame=frame)
    order = rng.permutation(300)
    shuffled = refine(sight, start[order], frame=frame[order])
    np.testing.assert_allclose(shuffled.joints, together.joints[order], atol=1e-9)
    np.testing.assert_array_equal(shuffled.dof, together.dof[order])
    for k in (0, 17, 299):
        alone = refine(sight, start[k : k + 1], frame=frame[k : k + 1])
        np.testing.assert_allclose(alone.joints[0], together.joints[k], atol=1e-9)


def test_shared_trunks_and_limbs_change_nothing(rng: np.random.Generator) -> None:
    # The search refines each different trunk and limb once. A last digit makes them all different.
    view = scene()
    sight = sight_of(view, 2.0)
    frame = np.repeat(np.arange(20), 6)
    start = nudged(view, 0.02)[frame]
    start[::2, JOINT["left_wrist"]] = view.joints_cam[frame[::2], JOINT["left_wrist"]]
    shared = refine(sight, start, frame=frame, precision=TIGHT, steps=60)
    apart = refine(
        sight, start + rng.normal(size=start.shape) * 1e-13, frame=frame, precision=TIGHT, steps=60
    )
    np.testing.assert_allclose(shared.chi2, apart.chi2, rtol=1e-4, atol=1e-4)
    assert np.median(np.abs(shared.joints - apart.joints).max(axis=(1, 2))) < 1e-7


def test_chi2_of_true_postures_is_chi_square_with_the_stated_freedom() -> None:
    # Without limits, and with noise so small that hardly a segment is at a right angle to its ray.
    view = scene(3000)
    off = np.random.default_rng(22).normal(size=(3000, 3)) * 0.05
    beside = RootPrior(
        mean=view.joints_cam[:, 0] + off, covariance=np.tile(0.05**2 * np.eye(3), (3000, 1, 1))
    )
    for root, dof in ((known_root(view), 6), (beside, 6), (None, 3)):
        refined = refine(sight_of(view, 0.05, limit_deviation=np.inf, root=root, seed=21), view.joints_cam)
        plain = refined.dof == dof
        assert plain.mean() > 0.9
        assert kstest(refined.p[plain], "uniform").pvalue > 0.01


@pytest.mark.parametrize("pixels", [0.5, 2.0])
def test_the_truth_is_rejected_no_more_often_than_stated(pixels: float) -> None:
    view = scene(3000)
    refined = refine(sight_of(view, pixels, seed=3), view.joints_cam)
    # Limits and folds make the test cautious, never rash: binomial, three deviations.
    for level in (1e-3, 1e-2, 1e-1):
        most = level + 3 * np.sqrt(level * (1 - level) / 3000)
        assert (~refined.explained(level)).mean() <= most
    assert (~refined.explained(0.1)).mean() > 0.04
    assert refined.converged.mean() > 0.98


def test_what_noise_cannot_explain_is_rejected() -> None:
    view = scene()
    sight = sight_of(view, 1.0)
    image = sight.points().copy()
    image[:, JOINT["right_shoulder"]] += 40.0  # 40 deviations: no torso has such an image
    assert (~refine(replace(sight, image=image), view.joints_cam).explained()).all()


def test_the_error_is_as_stated() -> None:
    # Many draws of the noise on a few postures.
    view = scene().select(np.arange(40))
    draws, pixels = 300, 0.3
    frame = np.repeat(np.arange(len(view)), draws)
    noise = np.random.default_rng(8).normal(size=(len(frame), 14, 2)) * pixels
    many = ObservedFrames(
        figure=figure(),
        camera=view.camera,
        image=view.image[frame] + noise,
        deviation=pixels,
        root=RootPrior(mean=view.joints_cam[frame, 0], covariance=np.zeros((len(frame), 3, 3))),
        limit_deviation=np.inf,
    )
    refined = refine(many, view.joints_cam[frame])
    off = (refined.joints - view.joints_cam[frame]).reshape(len(view), draws, 14, 3)
    stated = refined.covariance.reshape(len(view), draws, 14, 3, 3).mean(axis=1)
    drawn = np.einsum("fdji,fdjk->fjik", off, off) / draws
    ratio = np.sqrt(np.trace(drawn, axis1=2, axis2=3)[:, 1:] / np.trace(stated, axis1=2, axis2=3)[:, 1:])
    assert 0.9 < np.median(ratio) < 1.1
    assert ((ratio > 0.7) & (ratio < 1.5)).mean() > 0.9


def test_a_joint_that_was_not_seen_says_so() -> None:
    view = scene()
    sight = sight_of(view, 1.0)
    image = sight.points().copy()
    image[:, [JOINT["left_wrist"], JOINT["right_knee"], JOINT["right_ankle"]]] = np.nan
    seen, part = refine(sight, view.joints_cam), refine(replace(sight, image=image), view.joints_cam)
    assert np.isfinite(part.joints).all() and np.isfinite(part.covariance).all()
    assert (part.deviation[:, JOINT["left_wrist"]] > 0.1).all()
    assert (part.deviation[:, JOINT["right_ankle"]] > 0.3).all()
    assert np.median(part.deviation[:, JOINT["left_elbow"]] / seen.deviation[:, JOINT["left_elbow"]]) < 2
    # The lengths are kept all the same.
    np.testing.assert_allclose(part.lengths, seen.lengths, atol=1e-9)


def test_postures_with_unknown_joints_are_refined_as_far_as_they_are_known() -> None:
    view = scene()
    sight = sight_of(view, 1.0)
    start, image = view.joints_cam.copy(), sight.points().copy()
    gone = [
        JOINT["left_elbow"],
        JOINT["left_wrist"],
        JOINT["left_hip"],
        JOINT["left_knee"],
        JOINT["left_ankle"],
    ]
    start[:, gone] = image[:, gone] = np.nan
    part = refine(replace(sight, image=image), start)
    assert np.isfinite(part.joints).all() and np.isfinite(part.chi2).all()
    known = [JOINT[name] for name in ("right_elbow", "right_wrist", "right_shoulder")]
    assert np.median(np.abs(part.joints - view.joints_cam)[:, known]) < 0.01
    nothing = refine(replace(sight, image=np.full_like(image, np.nan), root=None), view.joints_cam)
    assert np.isfinite(nothing.joints).all() and (nothing.dof == 0).all() and (nothing.p == 1).all()
    assert np.isfinite(nothing.covariance).all()


def test_a_survivor_without_a_neck_is_not_refined() -> None:
    view = scene()
    start = view.joints_cam.copy()
    start[3] = np.nan
    refined = refine(sight_of(view, 1.0), start)
    assert np.isnan(refined.joints[3]).all() and not refined.converged[3] and refined.p[3] == 0
    assert not refined.explained()[3] and refined.converged[np.arange(len(view)) != 3].mean() > 0.98


def test_an_uncertain_deviation_counts_for_less() -> None:
    view = scene()
    sight = sight_of(view, 1.0)
    image = sight.points().copy()
    image[:, JOINT["left_hip"]] += 40.0
    wide = np.ones((len(view), 14))
    wide[:, JOINT["left_hip"]] = 40.0
    assert (~refine(replace(sight, image=image), view.joints_cam).explained()).mean() > 0.95
    assert refine(replace(sight, image=image, deviation=wide), view.joints_cam).explained().mean() > 0.95
    wide[:, JOINT["left_hip"]] = np.inf
    dropped = refine(replace(sight, image=image, deviation=wide), view.joints_cam)
    image[:, JOINT["left_hip"]] = np.nan
    unseen = refine(replace(sight, image=image), view.joints_cam)
    np.testing.assert_allclose(dropped.chi2, unseen.chi2, rtol=1e-6, atol=1e-6)


def test_lengths_are_refined_where_their_deviation_is_given() -> None:
    long = figure().scaled(
        {"right_elbow-right_wrist": 0.29, "left_shoulder-pelvis": 0.53, "neck-pelvis": 0.48}
    )
    view = random_views(long, 60, np.random.default_rng(2), ranges="urdf")
    sight = sight_of(view, 0.5, root=known_root(view))
    held = refine(sight, view.joints_cam)
    varied = refine(replace(sight, length_deviation=0.05), view.joints_cam)
    assert (~held.explained()).mean() > 0.5
    assert varied.explained().mean() > 0.98
    torso = SEGMENT_NAMES.index("neck-pelvis")
    assert np.abs(varied.lengths - varied.lengths.mean(axis=0)).max() > 1e-3
    assert abs(np.median(varied.lengths[:, torso]) - 0.48) < abs(figure().lengths["neck-pelvis"] - 0.48)
    # Those that are held stay.
    only = refine(replace(sight, length_deviation={"right_knee-right_ankle": 0.05}), view.joints_cam)
    others = [k for k, name in enumerate(SEGMENT_NAMES) if name != "right_knee-right_ankle"]
    assert (np.abs(only.lengths - np.array(list(figure().lengths.values())))[:, others] < 1e-4).all()


def test_limits_pull_and_cost() -> None:
    view = scene()
    loose, strict = (
        figure(),
        figure().with_limits({"left_elbow.flexion": (0.0, 0.3), "right_elbow.flexion": (0.0, 0.3)}),
    )
    sight = sight_of(view, 0.5, noise=0.0)
    free = refine(sight, view.joints_cam)
    held = refine(replace(sight, limits=strict.limits), view.joints_cam)
    assert (held.chi2 >= free.chi2 - 1e-6).all() and (held.chi2 > 20).mean() > 0.5
    np.testing.assert_allclose(
        refine(replace(sight, limits=loose.limits), view.joints_cam).chi2, free.chi2, atol=1e-9
    )
    assert (
        refine(replace(sight, limits=strict.limits, limit_deviation=np.inf), view.joints_cam).chi2 < 1e-9
    ).all()


def test_the_head_tells_where_the_neck_is() -> None:
    view = scene()
    noisy = view.with_noise(0.5, np.random.default_rng(4))
    root = RootPrior.along_ray(view.camera, view.joints_cam[:, 0], depth=1.0, lateral=0.1)
    without = sight_of(view, 0.5, image=noisy.image, root=root)
    with_head = replace(without, head_image=noisy.head_image, head_deviation=0.5)
    a, b = refine(without, view.joints_cam), refine(with_head, view.joints_cam, head=view.head_cam)
    assert (b.deviation[:, 0] < a.deviation[:, 0]).mean() > 0.9
    assert b.explained().mean() > 0.98
    assert np.isfinite(b.head).all() and np.isnan(a.head).all()
    assert np.median(np.linalg.norm(b.head - view.head_cam, axis=-1)) < 0.03


def test_nothing_to_refine() -> None:
    view = scene()
    none = refine(sight_of(view, 1.0), np.zeros((0, 14, 3)), frame=np.zeros(0, dtype=int))
    assert len(none) == 0 and none.covariance.shape == (0, 14, 3, 3) and none.q.shape[0] == 0


def test_some_survivors_are_selected() -> None:
    view = scene()
    refined = refine(sight_of(view, 1.0), view.joints_cam)
    part = refined.select(np.array([4, 2]))
    assert isinstance(part, Refined)
    np.testing.assert_array_equal(part.joints, refined.joints[[4, 2]])
    np.testing.assert_allclose(part.covariance, refined.covariance[[4, 2]], rtol=1e-9, atol=1e-15)
    with pytest.raises(ValueError, match="read-only"):
        part.joints[0] = 0.0


BAD: dict[str, tuple[dict[str, object], str]] = {
    "image of another shape": ({"image": np.zeros((120, 13, 2))}, "image has shape"),
    "infinite image": ({"image": np.full((120, 14, 2), np.inf)}, "infinite"),
    "no deviation": ({"deviation": 0.0}, "deviation is"),
    "negative deviation": ({"deviation": -np.ones((120, 14))}, "deviation is"),
    "deviation NaN": ({"deviation": np.nan}, "deviation is"),
    "deviations of another shape": ({"deviation": np.ones((120, 3))}, "deviation has shape"),
    "other roots": ({"root": RootPrior(mean=np.zeros((3, 3)), covariance=np.zeros((3, 3, 3)))}, "3 frames"),
    "no such segment": ({"length_deviation": {"neck-knee": 0.1}}, "neck-knee"),
    "length deviation NaN": ({"length_deviation": np.nan}, "length_deviation"),
    "length deviation in per cent": ({"length_deviation": 5.0}, "length_deviation"),
    "limits' deviation": ({"limit_deviation": 0.0}, "limits' deviation"),
    "limits' deviation NaN": ({"limit_deviation": np.nan}, "limits' deviation"),
    "head of another shape": ({"head_image": np.zeros((120, 4, 2))}, "head_image has shape"),
}


@pytest.mark.parametrize(("changed", "text"), BAD.values(), ids=BAD.keys())
def test_bad_input_is_refused_in_one_line(changed: dict[str, object], text: str) -> None:
    view = scene()
    with pytest.raises(InputError, match=text) as caught:
        refine(replace(sight_of(view, 1.0), **changed), view.joints_cam)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_bad_survivors_are_refused() -> None:
    view = scene()
    sight = sight_of(view, 1.0)
    for postures, frame, text in (
        (np.zeros((5, 14, 3)), None, "frame"),
        (np.zeros((5, 13, 3)), np.zeros(5, dtype=int), "postures has shape"),
        (np.full((5, 14, 3), np.inf), np.zeros(5, dtype=int), "infinite"),
        (np.zeros((5, 14, 3)), np.full(5, 120), "0 to 119"),
        (np.zeros((5, 14, 3)), np.zeros(5), "whole numbers"),
        (np.zeros((5, 14, 3)), np.zeros(4, dtype=int), "whole numbers"),
    ):
        with pytest.raises(InputError, match=text):
            refine(sight, postures, frame=frame)
    with pytest.raises(InputError, match="level"):
        refine(sight, view.joints_cam).explained(np.nan)


@pytest.mark.parametrize(
    ("mean", "covariance"),
    [
        (np.zeros((2, 2)), np.zeros((2, 3, 3))),
        (np.zeros((2, 3)), np.zeros((3, 3))),
        (np.zeros((2, 3)), np.full((2, 3, 3), np.nan)),
        (np.zeros((2, 3)), np.tile(np.diag([1.0, 1.0, -1.0]), (2, 1, 1))),
        (np.zeros((2, 3)), np.tile(np.array([[1.0, 0.5, 0], [0, 1, 0], [0, 0, 1]]), (2, 1, 1))),
    ],
)
def test_a_root_that_is_none_is_refused(mean: Array, covariance: Array) -> None:
    with pytest.raises(InputError, match="root"):
        RootPrior(mean=mean, covariance=covariance)
    with pytest.raises(InputError, match="root"):
        RootPrior.along_ray(scene().camera, np.ones((2, 3)), depth=np.nan)


def test_absurd_numbers_are_answered_without_a_warning() -> None:
    view = scene().select(np.arange(8))
    sight = sight_of(view, 1.0)
    for value in (1e300, -1e150, 1e9):
        image = sight.points().copy()
        image[:, JOINT["left_elbow"]] = value
        assert not refine(replace(sight, image=image), view.joints_cam).explained().any()
    for start in (-view.joints_cam, 0 * view.joints_cam, np.broadcast_to(view.joints_cam[:, :1], (8, 14, 3))):
        refined = refine(sight, start)
        assert np.isfinite(refined.joints).all() and (refined.p[np.isinf(refined.chi2)] == 0).all()
    far = refine(sight, view.joints_cam * 1e200)
    assert np.isnan(far.joints).all() and not far.explained().any()
    at_lens = RootPrior(mean=np.zeros((8, 3)), covariance=np.zeros((8, 3, 3)))
    assert not refine(replace(sight, root=at_lens), view.joints_cam).explained().any()
