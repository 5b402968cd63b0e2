"""The closed forms of the figure, part by part: each against rotations, bounds and bodies put together by hand."""

from __future__ import annotations

import math
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.body.angles import Limits, ball_angles, direction_angles, limb_angles
from posekit.body.axes import axis_signs
from posekit.body.capsules import CAPSULE_AXES, read_capsules
from posekit.body.closed_form import HIP_FLEXIONS, ClosedForm, freed, with_head
from posekit.body.closing import HIPS_LENGTHS, TORSO_LENGTHS, closed_lengths, closing_line
from posekit.body.frames import hips_frame, torso_frame
from posekit.body.lengths import forward_squared
from posekit.body.side import SIDE_DEVIATIONS, _slope, offset_deviation, side_is_certain
from posekit.body.torso_bending import bending_gives
from posekit.body.uncertainty import LengthUncertainty
from posekit.errors import FigureError
from posekit.geometry import Array, rotation_from_vector
from posekit.skeleton import DOFS, JOINT, SEGMENT_NAMES

FIGURE = load_figure()
angles = st.floats(-1.2, 1.2)


def turns(alpha: float, beta: float, gamma: float) -> Array:
    """Turn about y, x and z, by rotation vectors."""
    y, x, z = (rotation_from_vector(np.array(v)) for v in ((0, alpha, 0), (beta, 0, 0), (0, 0, gamma)))
    return np.asarray(y @ x @ z)


def limits_of(count: int, half: float = 1.5, signs: tuple[float, ...] = (1, -1, 1, -1)) -> Limits:
    return Limits(sign=np.array(signs[:count]), lower=np.full(count, -half), upper=np.full(count, half))


# --- angles ---------------------------------------------------------------------------------------------


@given(alpha=angles, beta=angles, gamma=angles)
def test_three_turns_are_found_in_their_rotation(alpha: float, beta: float, gamma: float) -> None:
    limits = limits_of(3)
    found = ball_angles(turns(alpha, beta, gamma)[None], limits)[0]
    np.testing.assert_allclose(found * limits.sign, [alpha, beta, gamma], atol=1e-9)


@given(alpha=angles, beta=angles, gamma=angles, epsilon=st.floats(0.01, 1.4))
def test_a_limbs_four_angles_are_found_in_its_directions(
    alpha: float, beta: float, gamma: float, epsilon: float
) -> None:
    limits = limits_of(4)
    R = turns(alpha, beta, gamma)
    upper = R @ [0.0, 0.0, -1.0]
    lower = R @ rotation_from_vector(np.array([0.0, epsilon, 0.0])) @ [0.0, 0.0, -1.0]
    found = limb_angles(upper[None], lower[None], limits)[0] * limits.sign
    # Both signs of the hinge give the same limb: the one whose worst angle is inside is taken.
    other = np.array([alpha, beta, gamma + np.pi, -epsilon])
    same = np.abs(found - [alpha, beta, gamma, epsilon]).max() < 1e-6
    assert same or np.abs(np.exp(1j * found) - np.exp(1j * other)).max() < 1e-6
    assert limits.violation(found * limits.sign) == 0.0
    two = direction_angles(upper[None], limits)[0]
    np.testing.assert_allclose(two * limits.sign[:2], [alpha, beta], atol=1e-9)


def test_costs_are_how_far_the_worst_angle_is_outside() -> None:
    limits = Limits(sign=np.ones(4), lower=np.array([-1.0, -1, -1, 0]), upper=np.array([1.0, 1, 1, 2]))
    inside, at = np.array([0.5, -0.5, 0.0, 1.0]), np.array([1.0, -1.0, 1.0, 2.0])
    assert limits.violation(inside) == limits.violation(at) == limits.cost(at) == 0.0
    outside = np.array([1.2, -1.1, 0.0, 0.5])
    assert limits.violation(outside) == limits.cost(outside) == pytest.approx(0.2)
    below = np.array([0.0, 0.0, 0.0, -0.3])
    assert limits.violation(below) == limits.cost(below) == pytest.approx(0.3)
    # The axial rotation counts by the sine of the bend, as a straight limb does not show it.
    turned = np.array([0.0, 0.0, 1.6, 0.5])
    assert limits.violation(turned) == pytest.approx(0.6) and limits.cost(turned) == pytest.approx(
        0.6 * math.sin(0.5)
    )
    three = Limits(sign=np.ones(3), lower=limits.lower[:3], upper=limits.upper[:3])
    assert three.cost(turned[:3]) == pytest.approx(0.6)
    np.testing.assert_allclose(limits.clip(3, np.array([-1.0, 1.0, 3.0])), [0.0, 1.0, 2.0])
    np.testing.assert_allclose(
        limits.nearest_turn(np.array([7.0, -7.0, 0.0, 1.0 + 3.2])),
        [7 - 2 * np.pi, 2 * np.pi - 7, 0, 4.2 - 2 * np.pi],
    )


@pytest.mark.parametrize("beyond", [0.05, 0.3])
def test_outside_its_limits_the_nearer_branch_is_taken(beyond: float) -> None:
    limits = limits_of(3, 1.0)
    found = ball_angles(turns(1.0 + beyond, 0.2, -0.1)[None], limits)[0] * limits.sign
    np.testing.assert_allclose(found, [1.0 + beyond, 0.2, -0.1], atol=1e-9)
    assert limits.violation(found * limits.sign) == pytest.approx(beyond)


@pytest.mark.parametrize("gamma", [-2.0, 0.0, 2.0])
def test_a_straight_limb_takes_a_rotation_inside_its_limits(gamma: float) -> None:
    """Along one line no rotation shows: whatever is inside will do."""
    limits = limits_of(4, 0.5)
    upper = turns(0.2, -0.3, gamma) @ [0.0, 0.0, -1.0]
    found = limb_angles(upper[None], upper[None], limits)[0]
    assert limits.violation(found) < 1e-9
    np.testing.assert_allclose((found * limits.sign)[:2], [0.2, -0.3], atol=1e-6)
    assert abs(found[3]) < 1e-6


@pytest.mark.parametrize("side", [1.0, -1.0])
@given(together=st.floats(-0.9, 0.9))
def test_a_limb_along_the_abduction_axis_turns_inside_its_limits(side: float, together: float) -> None:
    """There flexion and rotation say one angle together: each of the two stays inside where that is possible."""
    limits = Limits(
        sign=np.ones(4), lower=np.array([-0.5, -1.6, -0.5, 0.0]), upper=np.array([0.5, 1.6, 0.5, 2.0])
    )
    R = turns(0.0, side * np.pi / 2, together)
    lower = R @ rotation_from_vector(np.array([0.0, 0.8, 0.0])) @ [0.0, 0.0, -1.0]
    found = limb_angles((R @ [0.0, 0.0, -1.0])[None], lower[None], limits)[0]
    assert limits.violation(found) < 1e-5
    again = turns(*found[:3]) @ rotation_from_vector(np.array([0.0, found[3], 0.0])) @ [0.0, 0.0, -1.0]
    np.testing.assert_allclose(again, lower, atol=1e-6)


def test_axes_have_signs_and_no_other_axis_will_do() -> None:
    signs = axis_signs(FIGURE.model, "here")
    np.testing.assert_array_equal(signs, FIGURE.limits.sign)
    assert set(np.abs(signs)) == {1.0}
    wrong = FIGURE.urdf.replace('<axis xyz="0 1 0"', '<axis xyz="0 0 1"', 1)
    if wrong == FIGURE.urdf:
        wrong = FIGURE.urdf.replace('<axis xyz="0 -1 0"', '<axis xyz="0 0 1"', 1)
    with pytest.raises(
        FigureError,
        match=r"here: joint '.*' turns about \[0\.0, 0\.0, 1\.0\]; expected plus or minus the y axis",
    ):
        axis_signs(pin.buildModelFromXML(wrong, pin.JointModelFreeFlyer()), "here")


# --- frames and flexions that are shared -----------------------------------------------------------------


@given(vector=st.tuples(*[st.floats(-2, 2)] * 3), lift=st.floats(-0.3, 0.3), shift=st.floats(-0.3, 0.3))
def test_frames_turn_with_the_body(vector: tuple[float, float, float], lift: float, shift: float) -> None:
    """However far the shoulders' line is tilted or the hips are off the middle, the axes are square."""
    R = rotation_from_vector(np.array(vector))
    neck, pelvis = np.zeros(3), np.array([0.0, 0.0, -0.5])
    right, left = np.array([0.05, -0.2, -0.02]), np.array([0.05, 0.2, -0.02 + lift])
    np.testing.assert_allclose(torso_frame(*(R @ p for p in (neck, right, left, pelvis))), R, atol=1e-9)
    hips = np.array([0.0, -0.1 + shift, -0.6]), np.array([0.0, 0.1 + shift, -0.6])
    np.testing.assert_allclose(hips_frame(R @ pelvis, R @ hips[0], R @ hips[1]), R, atol=1e-9)
    bent = np.array([0.1, 0.0, -0.6]), np.array([0.1, 0.2, -0.6])
    by_neck = hips_frame(R @ pelvis, R @ bent[0], R @ bent[1], R @ neck)
    np.testing.assert_allclose(by_neck, R, atol=1e-9)


def test_a_pelvis_between_the_hips_lends_its_flexion_to_them() -> None:
    own = FIGURE.limits
    pelvis = DOFS.index("pelvis.flexion")
    free = freed(own)
    for hip in HIP_FLEXIONS:
        ends = own.sign[pelvis] * own.sign[hip] * np.array([own.lower[pelvis], own.upper[pelvis]])
        assert free.lower[hip] == pytest.approx(own.lower[hip] + min(ends))
        assert free.upper[hip] == pytest.approx(own.upper[hip] + max(ends))
    others = np.delete(np.arange(22), HIP_FLEXIONS)
    np.testing.assert_array_equal(free.lower[others], own.lower[others])
    form = ClosedForm(limits=free, head_offsets=FIGURE.ik.head_offsets, middle_pelvis=True)
    assert form.pelvis_turn == pytest.approx((min(ends), max(ends)))
    assert form.hips_joints == (JOINT["pelvis"], JOINT["right_hip"], JOINT["left_hip"], JOINT["neck"])
    assert form.rigid_kind(form.hips_joints) == -4 and form.rigid_kind((0, 1, 2, 3)) == 4
    assert FIGURE.ik.hips_joints == form.hips_joints[:3] and FIGURE.ik.rigid_kind(form.hips_joints[:3]) == 3
    for one, limits in ((form, free), (FIGURE.ik, own)):
        np.testing.assert_allclose(one.with_limits(own.lower, own.upper).limits.lower, limits.lower)


def test_unknown_ends_leave_a_limb_its_direction() -> None:
    q = np.array([[0.3, 0.2, -0.4, 0.9]] * 2)
    points = np.zeros((2, 3, 3))
    R = np.stack([turns(*(FIGURE.limits.sign[6:9] * each[:3])) for each in q])
    points[:, 1] = R @ [0.0, 0.0, -0.3]
    bend = np.stack(
        [rotation_from_vector(np.array([0.0, FIGURE.limits.sign[9] * each[3], 0.0])) for each in q]
    )
    points[:, 2] = points[:, 1] + np.einsum("nij,njk,k->ni", R, bend, [0.0, 0.0, -0.25])
    points[1, 2] = np.nan
    eye = np.tile(np.eye(3), (2, 1, 1))
    found = FIGURE.ik.limb("right_shoulder", eye, points[:, 0], points[:, 1], points[:, 2])
    np.testing.assert_allclose(found[0], q[0], atol=1e-9)
    np.testing.assert_allclose(found[1, :2], q[1, :2], atol=1e-9)
    assert np.isnan(found[1, 2:]).all()
    none = FIGURE.ik.limb("right_shoulder", eye, points[:, 0], points[:, 1], None)
    assert np.isnan(none[:, 2:]).all() and np.isfinite(none[:, :2]).all()


@pytest.mark.parametrize("shape", [(2, 13, 3), (14, 3), (2, 14, 2)])
def test_heads_are_appended_to_whole_postures_alone(shape: tuple[int, ...]) -> None:
    with pytest.raises(FigureError, match=r"expected \(N, 14, 3\) or \(N, 19, 3\)"):
        with_head(np.zeros(shape))
    found = with_head(np.ones((2, 14, 3)))
    assert found.shape == (2, 19, 3) and (found[:, :14] == 1).all() and np.isnan(found[:, 14:]).all()
    whole = np.ones((2, 19, 3))
    assert with_head(whole) is whole


# --- capsules -------------------------------------------------------------------------------------------


def changed(link: str, **changes: Any) -> pin.GeometryModel:
    geometry = pin.GeometryModel(FIGURE.geometry)
    for body in geometry.geometryObjects:
        if FIGURE.model.frames[body.parentFrame].name == link:
            shape = body.geometry
            body.geometry = changes.get("shape") or coal.Capsule(
                changes.get("radius", shape.radius), 2 * changes.get("half", shape.halfLength)
            )
            body.placement = body.placement * changes.get("by", pin.SE3.Identity())
    return geometry


def moved(metres: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([metres, 0.0, 0.0]))


@pytest.mark.parametrize(("changes", "words"), [
    ({}, ""),
    ({"by": moved(0.9e-9)}, ""),
    ({"by": moved(1.2e-9)}, "its capsule lies 1.2e-09 m beside the line between its joints; expected it on that line"),
    ({"by": pin.SE3(rotation_from_vector(np.array([1e-6, 0.0, 0.0])), np.zeros(3))}, "beside the line"),
    ({"radius": 0.0}, "its capsule has radius 0 and half length"),
    ({"half": 0.0}, "and half length 0 m; expected both positive"),
    ({"radius": np.inf}, "its capsule has radius inf"),
    ({"shape": coal.Sphere(0.1)}, "its collision body is a Sphere; expected a capsule"),
])  # fmt: skip
def test_capsules_lie_along_the_lines_of_their_links(changes: dict[str, Any], words: str) -> None:
    geometry = changed("left_shank", **changes)
    if words:
        with pytest.raises(FigureError) as caught:
            read_capsules(FIGURE.model, geometry, FIGURE.neutral_points)
        assert words in str(caught.value) and "'left_shank'" in str(caught.value)
        return
    capsules, pairs = read_capsules(FIGURE.model, geometry, FIGURE.neutral_points)
    assert {capsule.link for capsule in capsules} == set(CAPSULE_AXES) and pairs == FIGURE.collision_pairs
    for capsule in capsules:
        start, end = (
            FIGURE.neutral_points[list(points)].mean(axis=0) for points in CAPSULE_AXES[capsule.link]
        )
        middle, axis = capsule.place(FIGURE.neutral_points[None, list(capsule.points)])
        np.testing.assert_allclose(axis[0], (end - start) / np.linalg.norm(end - start), atol=1e-12)
        np.testing.assert_allclose(middle[0], start + capsule.center * axis[0], atol=1e-12)


# --- torsos that are bent, flat, or do not close -----------------------------------------------------------


@given(degrees=st.sampled_from([38.2]), height=st.floats(0.3, 0.7), width=st.floats(0.2, 0.5))
def test_a_bent_spine_brings_a_shoulder_nearer(degrees: float, height: float, width: float) -> None:
    """An arc of that length from the pelvis up, and half the shoulders' width square to its end."""
    lengths = {"neck-pelvis": height, "right_shoulder-left_shoulder": width}
    phi = math.radians(degrees)
    radius = height / phi
    neck = np.array([radius * (1 - math.cos(phi)), radius * math.sin(phi)])
    inward = np.array([math.cos(phi), -math.sin(phi)])
    shoulder = neck + width / 2 * inward
    upright = math.hypot(height, width / 2)
    assert bending_gives(lengths) == pytest.approx(upright - np.linalg.norm(shoulder), rel=1e-6)


def known(**own: float) -> LengthUncertainty:
    return LengthUncertainty(own={name: own.get(name.replace("-", "_"), 0.0) for name in SEGMENT_NAMES})


def test_lengths_leave_a_side_the_deviation_that_small_changes_show() -> None:
    lengths = dict(FIGURE.lengths)
    offset = math.sqrt(forward_squared(lengths))
    assert offset_deviation(lengths, known()) == 0.0 and side_is_certain(lengths, known())
    shares = dict(zip(TORSO_LENGTHS, (0.001, 0.002, 0.0005, 0.003, 0.001, 0.002), strict=True))
    variance = 0.0
    for name, share in shares.items():
        up, down = (
            math.sqrt(max(forward_squared({**lengths, name: lengths[name] * (1 + s * 1e-4)}), 0.0))
            for s in (1, -1)
        )
        variance += (share * (up - down) / 2e-4) ** 2
    own = known(**{name.replace("-", "_"): share for name, share in shares.items()})
    assert offset_deviation(lengths, own) == pytest.approx(math.sqrt(variance), rel=1e-3)
    scale = offset / math.sqrt(variance) / SIDE_DEVIATIONS
    for share, certain in ((0.99, True), (1.01, False)):
        scaled = known(**{name.replace("-", "_"): scale * share * each for name, each in shares.items()})
        assert side_is_certain(lengths, scaled) == certain
    legs = known(right_hip_right_knee=0.1)
    assert offset_deviation(lengths, legs) == 0.0
    assert SIDE_DEVIATIONS == 3.0


@pytest.mark.parametrize("name", ["neck-pelvis", "neck-right_shoulder", "right_shoulder-pelvis"])
def test_at_the_edge_of_a_triangle_the_other_end_tells_the_slope(name: str) -> None:
    """With a shoulder between neck and pelvis, one of the two small changes makes no triangle."""
    lengths = {**FIGURE.lengths, "neck-right_shoulder": 0.2, "right_shoulder-pelvis": 0.3, "neck-pelvis": 0.5}
    slope = _slope(lengths, name)
    assert math.isfinite(slope)
    sign = -1.0 if name == "neck-pelvis" else 1.0
    end = forward_squared({**lengths, name: lengths[name] * (1 + sign * 1e-6)})
    assert slope == pytest.approx(sign * (end - forward_squared(lengths)) / 1e-6, rel=1e-6)
    assert offset_deviation(lengths, known(neck_pelvis=0.01)) == math.inf


def test_only_the_part_that_does_not_close_is_changed() -> None:
    lengths = dict(FIGURE.lengths)
    assert closed_lengths(lengths).moved == {} and closing_line({}) == ""
    wide = {
        **lengths,
        "right_hip-left_hip": 1.02 * (lengths["pelvis-right_hip"] + lengths["pelvis-left_hip"]),
    }
    found = closed_lengths(wide)
    assert set(found.moved) == set(HIPS_LENGTHS)
    for name in SEGMENT_NAMES:
        assert found.lengths[name] == pytest.approx(wide[name] + found.moved.get(name, 0.0), abs=1e-12)
    right, left, width = (found.lengths[name] for name in HIPS_LENGTHS)
    assert width == pytest.approx(right + left, rel=1e-9)
    # The miss of 2 % is shared by three logarithms that count alike: the width and the sum of two halves.
    assert math.log(width / wide["right_hip-left_hip"]) == pytest.approx(
        -2 * math.log(right / wide["pelvis-right_hip"]), rel=0.02
    )
    line = closing_line(found.moved)
    most = max(found.moved, key=lambda name: abs(found.moved[name]))
    assert f"of the hips {most} most, by {1000 * found.moved[most]:+.3g} mm" in line and "torso" not in line
    one_side = {
        **lengths,
        "pelvis-right_hip": 1.05 * (lengths["pelvis-left_hip"] + lengths["right_hip-left_hip"]),
    }
    right, left, width = (closed_lengths(one_side).lengths[name] for name in HIPS_LENGTHS)
    assert right == pytest.approx(left + width, rel=1e-9)
    other_side = {
        **lengths,
        "pelvis-left_hip": 1.05 * (lengths["pelvis-right_hip"] + lengths["right_hip-left_hip"]),
    }
    right, left, width = (closed_lengths(other_side).lengths[name] for name in HIPS_LENGTHS)
    assert left == pytest.approx(right + width, rel=1e-9)
