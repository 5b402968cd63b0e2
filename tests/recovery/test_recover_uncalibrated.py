"""From an uncalibrated picture to certified postures: the scale, the proportions, and flips given by hand."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure, stature_from_lengths
from posekit.cameras import ScaledOrthographicCamera
from posekit.errors import InputError
from posekit.formats.own import ScaledOrthographicModel, View, read_result, write_result
from posekit.recovery import recover
from posekit.recovery.recovery import Recovery
from posekit.recovery.result import result_of
from posekit.recovery.summary import summary_lines
from posekit.recovery.taylor_figure.proportions import figure_of
from posekit.settings import Tolerance
from posekit.settings.scale import Scale, parse_scale
from posekit.skeleton import JOINT, TREE_SEGMENTS, segment_name
from posekit.synthesis import random_postures
from posekit.views.builtin import builtin_view

FIGURE = load_figure()
S = 400.0
FRAMES = 40
PHYSICAL = ("rigid-parts", "joint-range", "collision")


def postures(n: int, seed: int = 2000) -> np.ndarray:
    """Random legal postures seen from anywhere, the neck at depth zero."""
    rng = np.random.default_rng(seed)
    joints = FIGURE.forward_kinematics(random_postures(FIGURE, n, rng))[:, :14]
    R = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0]
    R *= np.linalg.det(R)[:, None, None]
    turned: np.ndarray = np.einsum("nij,nkj->nki", R, joints - joints[:, :1])
    turned[..., :2] += rng.normal(size=(n, 1, 2))
    return turned


TRUTH = postures(FRAMES)


def view_of(truth: np.ndarray, scale: float | None = S, *, aspect: float = 1.0, **more: Any) -> View:
    camera = ScaledOrthographicCamera(scale=S, aspect=aspect)
    return View(
        camera=ScaledOrthographicModel(scale=scale, aspect=aspect),
        time=np.arange(len(truth), dtype=np.float64),
        image=camera.project(truth),
        truth=truth,
        **more,
    )


def nearest(recovery: Recovery, truth: np.ndarray) -> np.ndarray:
    """How far the best survivor of each frame is from the truth, over the joints it knows, metres."""
    return np.array(
        [
            np.fmax.reduce(np.linalg.norm(frame.joints - joints, axis=-1), axis=1).min()
            if len(frame)
            else np.inf
            for frame, joints in zip(recovery.frames, truth, strict=True)
        ]
    )


def flips(truth: np.ndarray) -> list[dict[str, str]]:
    """Which end of each segment is nearer in truth, frame by frame."""
    names = list(JOINT)
    return [
        {
            segment_name((a, b)): names[a] if joints[a, 2] < joints[b, 2] else names[b]
            for a, b in TREE_SEGMENTS
        }
        for joints in truth
    ]


def test_the_truth_is_among_the_survivors_of_an_exact_view() -> None:
    recovery = recover(view_of(TRUTH))
    assert nearest(recovery, TRUTH).max() < 1e-9
    assert {frame.judged for frame in recovery.frames} == {"exact"}


def test_every_survivor_gives_the_picture_again_and_has_the_lengths() -> None:
    view = view_of(TRUTH)
    recovery = recover(view)
    camera = ScaledOrthographicCamera(scale=S)
    for k, frame in enumerate(recovery.frames):
        seen = camera.project(frame.joints)
        np.testing.assert_allclose(seen - view.image[k], 0, atol=1e-9)
        for segment in TREE_SEGMENTS:
            length = np.linalg.norm(frame.joints[:, segment[0]] - frame.joints[:, segment[1]], axis=-1)
            np.testing.assert_allclose(length, FIGURE.lengths[segment_name(segment)], atol=1e-9)
        assert len(frame) + sum(frame.rejected.values()) == 8192


def test_a_picture_with_pixels_that_are_not_square_is_the_same_picture() -> None:
    square, wide = recover(view_of(TRUTH)), recover(view_of(TRUTH, aspect=1.5))
    for a, b in zip(square.frames, wide.frames, strict=True):
        np.testing.assert_allclose(a.joints, b.joints, atol=1e-9)


def test_the_least_scale_is_never_above_the_true_one_and_near_it() -> None:
    recovery = recover(view_of(TRUTH, None))
    bounds = np.array([frame.family.bound for frame in recovery.frames if frame.family is not None])
    assert (bounds <= S * (1 + 1e-12)).all()
    assert np.median(bounds / S) > 0.99
    error = nearest(recovery, TRUTH)
    assert np.isfinite(error).mean() >= 0.9
    assert np.median(error[np.isfinite(error)]) < 0.02


def test_the_segment_that_sets_the_bound_lies_in_the_picture() -> None:
    recovery = recover(view_of(TRUTH, None))
    for frame in recovery.frames:
        assert frame.family is not None
        a, b = (JOINT[name] for name in frame.family.segment.split("-"))
        if (a, b) in TREE_SEGMENTS:
            depth = frame.joints[:, a, 2] - frame.joints[:, b, 2]
            np.testing.assert_allclose(depth, 0, atol=1e-6)


def test_the_rigid_torso_fixes_the_scale() -> None:
    recovery = recover(view_of(TRUTH, None), scale=parse_scale("closure"))
    assert nearest(recovery, TRUTH).max() < 1e-6
    for frame in recovery.frames:
        assert frame.family is not None
        assert set(frame.family.chosen) <= set(frame.family.minima_s)
        assert np.abs(frame.family.chosen / S - 1).min() < 1e-9
        assert (np.diff(frame.family.minima_residual) >= 0).all()
        assert len(frame.family.curve_s) == len(frame.family.curve_residual) > 10
        assert frame.scales is not None
        assert set(np.unique(frame.scales)) <= set(frame.family.chosen)


def test_flips_by_hand_leave_the_true_posture_alone() -> None:
    recovery = recover(view_of(TRUTH), nearer=flips(TRUTH))
    assert [len(frame) for frame in recovery.frames] == [1] * FRAMES
    assert nearest(recovery, TRUTH).max() < 1e-9


def test_flips_by_hand_that_are_not_the_bodys_leave_nothing_and_say_why() -> None:
    wrong = [
        {name: next(end for end in name.split("-") if end != nearer) for name, nearer in frame.items()}
        for frame in flips(TRUTH[:3])
    ]
    recovery = recover(view_of(TRUTH[:3]), nearer=wrong)
    assert [len(frame) for frame in recovery.frames] == [0] * 3
    assert any(reason.startswith("nearer/") for frame in recovery.frames for reason in frame.rejected)


def test_the_ranges_tell_a_posture_from_its_mirror_image() -> None:
    recovery = recover(view_of(TRUTH))
    assert sum(frame.mirrored for frame in recovery.frames) == 0
    # Without any check every leaf has its mirror image.
    unchecked = recover(view_of(TRUTH[:2]), checks=())
    assert [frame.mirrored for frame in unchecked.frames] == [len(frame) for frame in unchecked.frames]
    assert summary_lines(unchecked)[-1].endswith("in 2 a posture and its mirror image both survive")


def test_the_stature_in_pixels_gives_the_scale() -> None:
    stature = stature_from_lengths(FIGURE.lengths)
    assert 1.5 < stature < 2.0
    recovery = recover(view_of(TRUTH, None), scale=Scale(how="stature", value=stature * S))
    for frame in recovery.frames:
        assert frame.family is not None
        assert frame.family.chosen == pytest.approx([S])


@pytest.mark.parametrize("scale", [None, "stature"])
def test_taylors_human_needs_neither_neck_nor_pelvis(scale: str | None) -> None:
    stature = 1.75
    figure = figure_of(stature)
    standing = figure.neutral_points[:14] * [1, -1, -1]
    R = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    truth = (standing[:, [1, 2, 0]] @ R.T)[None]
    view = view_of(truth, None, stature=stature)
    image = view.image.copy()
    image[:, [JOINT["neck"], JOINT["pelvis"]]] = np.nan
    how = None if scale is None else Scale(how="stature", value=stature * S)
    recovery = recover(dataclasses.replace(view, image=image), proportions="taylor", scale=how)
    frame = recovery.frames[0]
    assert len(frame) > 0
    assert np.isfinite(frame.joints).all()
    # His spine is straight; the figure's, by 4 cm, is not: 0.6 cm too long is 10 cm of depth.
    assert nearest(recovery, truth)[0] < 0.15
    assert frame.inferred is not None
    assert set(frame.inferred[0]) == {"neck", "pelvis"}
    assert len(frame) + sum(frame.rejected.values()) == 8192
    # Bodies of his proportions are in each other where they stand, and the result says by how much they may be.
    assert recovery.settings["contact_margin"] <= frame.margins["collision"].min() < -0.01


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_the_family_is_written_and_read_back(tmp_path, suffix) -> None:
    view = view_of(TRUTH[:4], None)
    for proportions in ("figure", "taylor"):
        result = result_of(recover(view, scale=Scale(), proportions=proportions, refine=False), unit="cm")
        path = tmp_path / f"r.{suffix}"
        write_result(path, result)
        back = read_result(path)
        for one, other in zip(result.frames, back.frames, strict=True):
            assert one.family is not None
            assert other.family is not None
            assert one.scales is not None
            assert other.scales is not None
            assert one.family.segment == other.family.segment
            np.testing.assert_allclose(one.family.chosen, other.family.chosen, rtol=1e-15)
            np.testing.assert_allclose(one.scales, other.scales, rtol=1e-15)
            inferred = one.inferred or []
            assert len(inferred) == len(other.inferred or [])
            for mine, theirs in zip(inferred, other.inferred or [], strict=True):
                assert set(mine) == set(theirs) == {"neck", "pelvis"}
                np.testing.assert_allclose(mine["neck"].lower, theirs["neck"].lower, rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "how", "value"),
    [
        ("min", "min", None),
        (" 4.5", "value", 450.0),
        ("1e2", "value", 1e4),
        ("stature:512", "stature", 512.0),
    ],
)
def test_the_texts_of_a_scale(text: str, how: str, value: float | None) -> None:
    scale = parse_scale(text, per_unit=100.0)
    assert (scale.how, scale.value) == (how, value)


def test_constraints_have_weights() -> None:
    assert dict(parse_scale("closure").weights) == {"closure": 1.0}
    assert dict(parse_scale("closure:2, coplanar:0.5").weights) == {"closure": 2.0, "coplanar": 0.5}


@pytest.mark.parametrize(
    "text",
    [
        "",
        "max",
        "-1",
        "0",
        "nan",
        "inf",
        "stature:",
        "stature:x",
        "closure:0",
        "closure:x",
        "closure,",
        "1:2",
    ],
)
def test_texts_that_are_no_scale(text: str) -> None:
    with pytest.raises(InputError, match=r"^--scale: .*expected min, a number, stature:PX"):
        parse_scale(text)


def test_a_scale_below_the_bound_says_which_segment_and_what_is_needed() -> None:
    bound = recover(view_of(TRUTH[:1], None)).frames[0].family
    assert bound is not None
    low = Scale(how="value", value=bound.bound * 0.999)
    with pytest.raises(
        InputError, match=rf"^frames\[0\]: --scale: .* which {bound.segment} needs: it is .* cm too"
    ):
        recover(view_of(TRUTH[:1], None), scale=low)
    # At the bound, and with as much tolerance as is missing, it goes through.
    recover(view_of(TRUTH[:1], None), scale=Scale(how="value", value=bound.bound))
    recover(
        view_of(TRUTH[:1], None),
        scale=low,
        tolerance=Tolerance(rigid=0.03, tangent=0.01, placement=False, angle=2.0),
    )


def test_a_frame_without_a_trunk_is_left_out_and_one_without_the_root_is_not() -> None:
    image = view_of(TRUTH[:3], None).image.copy()
    image[1, :6] = np.nan
    image[2, JOINT["neck"]] = np.nan
    recovery = recover(dataclasses.replace(view_of(TRUTH[:3], None), image=image))
    assert [len(frame) > 0 for frame in recovery.frames] == [True, False, True]
    assert recovery.frames[1].reason.startswith(
        "frames[1]: none of neck, right_shoulder, left_shoulder, pelvis"
    )
    assert recovery.frames[1].family is None
    assert recovery.frames[2].judged == "refined"
    result_of(recovery)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"proportions": "mean"}, r"^--proportions: 'mean'; expected figure or taylor$"),
        ({"nearer": [{}, {}]}, r"^--nearer: 2 frames; expected 3"),
        ({"nearer": [{"neck-elbow": "neck"}]}, "neck-elbow"),
        ({"nearer": [{"neck-pelvis": "nose"}]}, r"^--nearer: neck-pelvis: 'nose' is not one of its ends"),
    ],
)
def test_what_cannot_be_asked(options: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        recover(view_of(TRUTH[:3]), **options)


def test_a_calibrated_view_has_no_scale_and_no_other_proportions() -> None:
    for options in ({"scale": Scale()}, {"proportions": "taylor"}):
        with pytest.raises(InputError, match=r"^--(scale|proportions): .*leave the option out"):
            recover(builtin_view("seq1"), **options)
