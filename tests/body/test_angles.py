"""Closed-form angles: all branches, free angles, limits; against rotation matrices written out here."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.body.angles import (
    FREE_ANGLE_SINE,
    NEGLIGIBLE_VIOLATION_RADIANS,
    STRAIGHT_LIMB_SINE,
    Limits,
    ball_angles,
    direction_angles,
    limb_angles,
)
from posekit.skeleton import DOFS, SIDES

FIGURE = load_figure()
DOWN = np.array([0.0, 0.0, -1.0])


def limits_of(joint: str) -> Limits:
    """Return the limits of a ball joint, with its hinge for shoulder and hip."""
    first = DOFS.index(f"{joint}.flexion")
    part = slice(first, first + (4 if joint.endswith(("shoulder", "hip")) else 3))
    whole = FIGURE.limits
    return Limits(sign=whole.sign[part], lower=whole.lower[part], upper=whole.upper[part])


LIMBS = [f"{side}_{joint}" for joint in ("shoulder", "hip") for side in SIDES]
BALLS = ["neck", "pelvis"]


def turn(axis: int, angle: np.ndarray) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    R = np.zeros((len(angle), 3, 3))
    R[:, axis, axis] = 1
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R[:, i, i], R[:, i, j], R[:, j, i], R[:, j, j] = c, -s, s, c
    return R


def ball(angles: np.ndarray, sign: np.ndarray) -> np.ndarray:
    """Return R_y(alpha) R_x(beta) R_z(gamma) of joint angles (N, 3)."""
    alpha, beta, gamma = (angles[:, :3] * sign[:3]).T
    return np.asarray(turn(1, alpha) @ turn(0, beta) @ turn(2, gamma))


def limb(angles: np.ndarray, sign: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the directions of both segments of joint angles (N, 4)."""
    R = ball(angles, sign)
    return R @ DOWN, R @ turn(1, angles[:, 3] * sign[3]) @ DOWN


def assert_reproduced(
    angles: np.ndarray, limits: Limits, *, inside: bool = True, atol: float = 3 * STRAIGHT_LIMB_SINE
) -> np.ndarray:
    # A bend below STRAIGHT_LIMB_SINE has its axial rotation set to zero: that, and rounding, is all that may differ.
    upper, lower = limb(angles, limits.sign)
    found = limb_angles(upper, lower, limits)
    upper_found, lower_found = limb(found, limits.sign)
    np.testing.assert_allclose(upper_found, upper, rtol=0, atol=atol)
    np.testing.assert_allclose(lower_found, lower, rtol=0, atol=atol)
    if inside:
        assert limits.violation(found).max() <= NEGLIGIBLE_VIOLATION_RADIANS
    return found


@st.composite
def fractions(draw: st.DrawFn, n: int) -> np.ndarray:
    """Draw places in n ranges, edges and all."""
    edge = st.sampled_from([0.0, 1.0, 0.5, 1e-12, 1e-9, 1e-6, 1 - 1e-12])
    return np.array([draw(st.one_of(edge, st.floats(0, 1, allow_subnormal=False))) for _ in range(n)])


@pytest.mark.parametrize("joint", LIMBS)
@given(at=fractions(4))
def test_a_limb_inside_its_limits_is_found_inside(joint: str, at: np.ndarray) -> None:
    limits = limits_of(joint)
    assert_reproduced((limits.lower + at * (limits.upper - limits.lower))[None], limits)


@pytest.mark.parametrize("joint", BALLS)
@given(at=fractions(3))
def test_a_part_inside_its_limits_is_found_exactly(joint: str, at: np.ndarray) -> None:
    limits = limits_of(joint)
    angles = (limits.lower + at * (limits.upper - limits.lower))[None]
    found = ball_angles(ball(angles, limits.sign), limits)
    # Bending stays below 90 deg, so there is one answer only.
    np.testing.assert_allclose(found, angles, rtol=0, atol=1e-12)


@pytest.mark.parametrize("joint", LIMBS)
@given(angles=st.tuples(*[st.floats(-3.2, 3.2, allow_subnormal=False)] * 4))
def test_any_limb_is_reproduced(joint: str, angles: tuple[float, ...]) -> None:
    # Outside the limits a free angle may be turned towards them, and the end moves by less than FREE_ANGLE_SINE.
    assert_reproduced(np.array([angles]), limits_of(joint), inside=False, atol=4 * FREE_ANGLE_SINE)


@pytest.mark.parametrize("joint", BALLS)
@given(angles=st.tuples(*[st.floats(-3.2, 3.2, allow_subnormal=False)] * 3))
def test_any_rotation_is_reproduced(joint: str, angles: tuple[float, ...]) -> None:
    limits = limits_of(joint)
    R = ball(np.array([angles]), limits.sign)
    np.testing.assert_allclose(ball(ball_angles(R, limits), limits.sign), R, rtol=0, atol=1e-12)


@pytest.mark.parametrize("joint", LIMBS)
def test_every_quarter_turn_is_reproduced(joint: str) -> None:
    quarters = np.radians(list(itertools.product([-90, 0, 90, 180], repeat=4)))
    assert_reproduced(quarters, limits_of(joint), inside=False)


@pytest.mark.parametrize("joint", LIMBS)
def test_corners_of_the_limits_are_inside(joint: str) -> None:
    limits = limits_of(joint)
    corners = np.array(list(itertools.product(*zip(limits.lower, limits.upper, strict=True))))
    assert_reproduced(corners, limits)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("off", [0.0, 1e-15, 1e-10, 1e-8, 1e-7, 9e-7, 1.1e-6, 1e-4])
def test_an_arm_held_sideways_is_found_inside(rng: np.random.Generator, side: str, off: float) -> None:
    limits = limits_of(f"{side}_shoulder")
    angles = limits.lower + rng.random((2000, 4)) * (limits.upper - limits.lower)
    angles[:, 1] = np.pi / 2 + off * rng.choice([-1, 1], 2000)
    assert_reproduced(angles, limits)


@pytest.mark.parametrize("pole", [-1.0, 1.0])
def test_an_arm_along_its_second_axis_is_found_inside_whatever_its_limits_are(
    rng: np.random.Generator, pole: float
) -> None:
    """Also where neither zero nor an end of the first angle leaves the third inside its limits, or the other way."""
    sign = limits_of("right_shoulder").sign
    for k in range(200):
        narrow, wide = rng.uniform(-2.5, 2.5) + np.array([0.0, 0.05]), np.sort(rng.uniform(-2.5, 2.5, 2))
        first, third = (narrow, wide) if k % 2 else (wide, narrow)
        limits = Limits(
            sign=sign,
            lower=np.array([first[0], -1.8, third[0], 0.1]),
            upper=np.array([first[1], 1.8, third[1], 2.5]),
        )
        angles = limits.lower + rng.random((20, 4)) * (limits.upper - limits.lower)
        angles[:, 1] = pole * np.pi / 2
        upper, lower = limb(angles, sign)
        found = limb_angles(upper.round(9), lower, limits)  # rounding would tell the first angle
        assert limits.violation(found).max() <= NEGLIGIBLE_VIOLATION_RADIANS
        np.testing.assert_allclose(limb(found, sign), (upper, lower), rtol=0, atol=1e-8)


@pytest.mark.parametrize("side", SIDES)
def test_noise_on_an_arm_held_sideways_does_not_put_it_outside(rng: np.random.Generator, side: str) -> None:
    # A ray tangent to a segment leaves some 1e-7 of noise in its direction: the first angle is noise then.
    limits = limits_of(f"{side}_shoulder")
    angles = limits.lower + rng.random((2000, 4)) * (limits.upper - limits.lower)
    angles[:, 1] = np.pi / 2
    upper, lower = limb(angles, limits.sign)
    noisy = upper + rng.uniform(-3e-7, 3e-7, upper.shape)
    noisy /= np.linalg.norm(noisy, axis=1, keepdims=True)
    assert limits.violation(limb_angles(noisy, lower, limits)).max() < np.radians(1e-3)
    assert limits.violation(np.pad(direction_angles(noisy, limits), ((0, 0), (0, 2)))).max() < np.radians(
        1e-3
    )


@pytest.mark.parametrize("joint", LIMBS)
@pytest.mark.parametrize("bend", [0.0, 1e-16, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5])
def test_a_straight_limb_is_found_inside(rng: np.random.Generator, joint: str, bend: float) -> None:
    limits = limits_of(joint)
    angles = limits.lower + rng.random((2000, 4)) * (limits.upper - limits.lower)
    angles[:, 3] = bend
    found = assert_reproduced(angles, limits, atol=1e-9)
    np.testing.assert_allclose(np.abs(found[:, 3]), bend, rtol=0, atol=1e-12)


@pytest.mark.parametrize("joint", LIMBS)
def test_the_rotation_of_a_straight_limb_is_none(rng: np.random.Generator, joint: str) -> None:
    limits = limits_of(joint)
    angles = limits.lower + rng.random((100, 4)) * (limits.upper - limits.lower)
    angles[:, 3] = 0.0
    upper, _ = limb(angles, limits.sign)
    found = limb_angles(upper, upper, limits)
    np.testing.assert_array_equal(found[:, 2], 0.0)


def test_standing_is_neutral() -> None:
    q = FIGURE.configurations(FIGURE.neutral_points[None]).q
    np.testing.assert_allclose(q[0, FIGURE.angle_index], 0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("joint", LIMBS)
def test_outside_the_limits_the_least_violating_branch_is_taken(rng: np.random.Generator, joint: str) -> None:
    limits = limits_of(joint)
    angles = rng.uniform(-np.pi, np.pi, (3000, 4))
    angles[:, 3] = rng.uniform(0.1, 3.0, 3000) * rng.choice([-1, 1], 3000)
    upper, lower = limb(angles, limits.sign)
    found = limits.cost(limb_angles(upper, lower, limits))
    # Every way to write the same limb: Euler branch times sign of the hinge.
    same = [angles, (angles + np.array([0, 0, np.pi, 0])) * [1, 1, 1, -1]]
    same += [
        np.stack([a + np.pi, np.pi * b - b_, g + np.pi, e], axis=-1)
        for (a, b_, g, e), b in ((branch.T, limits.sign[1]) for branch in same)
    ]
    for other in same:
        for one, two in zip(limb(other, limits.sign), (upper, lower), strict=True):
            np.testing.assert_allclose(one, two, rtol=0, atol=1e-12)
    best = np.min([limits.cost(limits.nearest_turn(other)) for other in same], axis=0)
    np.testing.assert_allclose(found, best, rtol=0, atol=1e-9)


@pytest.mark.parametrize("joint", LIMBS)
def test_the_upper_segment_alone_is_never_worse_than_with_the_lower(
    rng: np.random.Generator, joint: str
) -> None:
    limits = limits_of(joint)
    angles = rng.uniform(-np.pi, np.pi, (3000, 4))
    angles[:500, 1] = np.pi / 2
    angles[500:700, 3] = 0.0
    upper, lower = limb(angles, limits.sign)
    two = Limits(sign=limits.sign[:2], lower=limits.lower[:2], upper=limits.upper[:2])
    with_lower = limb_angles(upper, lower, limits)
    assert (
        two.violation(direction_angles(upper, limits))
        <= limits.violation(with_lower) + NEGLIGIBLE_VIOLATION_RADIANS
    ).all()


@pytest.mark.parametrize("joint", LIMBS)
def test_the_upper_segment_alone_is_reproduced(rng: np.random.Generator, joint: str) -> None:
    limits = limits_of(joint)
    angles = rng.uniform(-np.pi, np.pi, (1000, 4))
    upper, _ = limb(angles, limits.sign)
    found = np.pad(direction_angles(upper, limits), ((0, 0), (0, 2)))
    np.testing.assert_allclose(limb(found, limits.sign)[0], upper, rtol=0, atol=1e-12)


@pytest.mark.parametrize("joint", ["shoulder", "hip"])
@given(angles=st.tuples(*[st.floats(-3, 3, allow_subnormal=False)] * 4))
def test_a_mirrored_limb_has_the_same_angles(joint: str, angles: tuple[float, ...]) -> None:
    right, left = (limits_of(f"{side}_{joint}") for side in SIDES)
    upper, lower = limb(np.array([angles]), right.sign)
    mirror = np.array([1.0, -1.0, 1.0])
    ours, theirs = limb_angles(upper, lower, right), limb_angles(upper * mirror, lower * mirror, left)
    np.testing.assert_allclose(right.violation(ours), left.violation(theirs), rtol=0, atol=1e-9)
    # Two equally good answers may be chosen differently; each must be right.
    mirrored = limb(theirs, left.sign)
    np.testing.assert_allclose(mirrored[0] * mirror, upper, rtol=0, atol=4 * FREE_ANGLE_SINE)
    np.testing.assert_allclose(mirrored[1] * mirror, lower, rtol=0, atol=4 * FREE_ANGLE_SINE)


def test_a_mirrored_figure_has_mirrored_angles(rng: np.random.Generator) -> None:
    swap = [name.replace("right", "L").replace("left", "right").replace("L", "left") for name in DOFS]
    rows = [DOFS.index(name) for name in swap]
    sign = np.array([-1.0 if name in MIDDLE_TURNS else 1.0 for name in DOFS])
    limits = FIGURE.limits
    np.testing.assert_allclose(
        limits.lower[rows], np.where(sign > 0, limits.lower, -limits.upper), atol=1e-15
    )
    np.testing.assert_allclose(
        limits.upper[rows], np.where(sign > 0, limits.upper, -limits.lower), atol=1e-15
    )
    q = np.zeros((200, FIGURE.model.nq))
    q[:, 6] = 1
    q[:, FIGURE.angle_index] = limits.lower + rng.random((200, 22)) * (limits.upper - limits.lower)
    mirrored = q.copy()
    mirrored[:, FIGURE.angle_index] = (q[:, FIGURE.angle_index] * sign)[:, rows]
    points = FIGURE.forward_kinematics(q)
    flipped = FIGURE.forward_kinematics(mirrored) * [1, -1, 1]
    order = [SWAPPED.index(k) for k in range(19)]
    np.testing.assert_allclose(flipped[:, order], points, rtol=0, atol=1e-12)


MIDDLE_TURNS = ("neck.bending", "neck.rotation", "pelvis.bending", "pelvis.rotation")
SWAPPED = [0, 2, 1, 3, 5, 4, 7, 6, 9, 8, 11, 10, 13, 12, 14, 16, 15, 18, 17]


@pytest.mark.parametrize("joint", LIMBS)
def test_an_unknown_direction_gives_unknown_angles(joint: str) -> None:
    limits = limits_of(joint)
    upper, lower = np.tile(DOWN, (3, 1)), np.tile([1.0, 0, 0], (3, 1))
    upper[0] = lower[1] = np.nan
    found = limb_angles(upper, lower, limits)
    assert np.isnan(found[0]).all()
    assert np.isnan(found[1]).any()
    assert np.isfinite(found[2]).all()
    assert np.isnan(direction_angles(upper, limits)[0]).all()


@given(turns=st.integers(-3, 3), at=fractions(4))
def test_full_turns_are_taken_off(turns: int, at: np.ndarray) -> None:
    limits = limits_of("right_shoulder")
    angles = limits.lower + at * (limits.upper - limits.lower)
    np.testing.assert_allclose(limits.nearest_turn(angles + turns * 2 * np.pi), angles, rtol=0, atol=1e-12)


def test_the_violation_is_the_worst_angles() -> None:
    limits = Limits(sign=np.ones(2), lower=np.array([-1.0, 0.0]), upper=np.array([1.0, 2.0]))
    angles = np.array([[0.0, 1.0], [1.0, 0.0], [1.5, 2.1], [-1.25, -0.5], [np.nan, 0]])
    np.testing.assert_allclose(limits.violation(angles), [0, 0, 0.5, 0.5, np.nan])
