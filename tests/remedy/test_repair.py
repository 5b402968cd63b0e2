"""Laws of the remedy for single postures."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import posekit
from posekit.body import load_figure
from posekit.errors import InputError
from posekit.geometry import Array, rotation_from_vector
from posekit.remedy.constraints import MarginConstraints, margins_of
from posekit.remedy.pieces import N_UNKNOWNS, jacobian_of, moved
from posekit.remedy.record import Repaired, spans_of
from posekit.skeleton import HEAD_POINTS, JOINT, JOINTS, LIMB_JOINTS, SEGMENTS, other_side
from posekit.validators import Validator

FIGURE = load_figure()
STRICT = Validator(strict=True)
CENTIMETRE = 0.01
AS_NEAR = 2e-3
"""Metres: the distance from a posture hardly changes along what it is projected onto."""


def standing(bend: float = 0.3) -> Array:
    """Return a standing figure with somewhat bent limbs (19, 3)."""
    q = np.zeros((1, FIGURE.model.nq))
    q[:, 6] = 1.0
    angles = np.zeros(22)
    angles[[9, 13, 17, 21]] = bend
    angles[[14, 18]] = 0.2
    angles[[6, 7, 8, 10, 11, 12]] = 0.35, 0.25, 0.1, -0.2, 0.3, 0.15
    q[:, FIGURE.angle_index] = angles
    return np.asarray(FIGURE.forward_kinematics(q)[0])


def hinge_beyond(degrees: float, limb: int) -> Array:
    """Return the joints (14, 3) of a posture whose elbow or knee is bent the wrong way."""
    points = standing()
    start, middle, end = LIMB_JOINTS[limb]
    upper, lower = points[middle] - points[start], points[end] - points[middle]
    axis = np.cross(upper, lower)
    turn = rotation_from_vector(-np.radians(degrees) * axis / np.linalg.norm(axis))
    points[end] = points[middle] + np.linalg.norm(lower) * (turn @ (upper / np.linalg.norm(upper)))
    return points[: len(JOINTS)]


def illegal() -> Array:
    """Return postures (N, 14, 3) beyond ranges, with a wrong length, and with an arm in the trunk."""
    long_arm = standing()[:14]
    elbow, wrist = JOINT["right_elbow"], JOINT["right_wrist"]
    long_arm[wrist] += 0.25 * (long_arm[wrist] - long_arm[elbow])
    inside = standing()[:14]
    inside[JOINT["left_wrist"]] = inside[JOINT["left_elbow"]] + np.array([0.03, -0.24, 0.0])
    return np.stack([hinge_beyond(20, 0), hinge_beyond(35, 3), long_arm, inside])


@cache
def repaired_illegal() -> Repaired:
    """Return what they are repaired to."""
    return posekit.repair(illegal(), STRICT)


def lengths_of(postures: Array) -> Array:
    """Return the 17 lengths (N, 17)."""
    ends = np.array(SEGMENTS)
    return np.asarray(np.linalg.norm(postures[:, ends[:, 0]] - postures[:, ends[:, 1]], axis=-1))


def test_constructions_are_illegal() -> None:
    """Every posture of these tests is rejected, and the one they are made from is not."""
    assert STRICT.check(illegal()).invalid.all()
    assert STRICT.check(standing()[None, :14]).valid.all()


def test_legal_postures_come_back_as_they_were() -> None:
    """What passes is not touched."""
    joints = standing()[None, :14]
    repaired = posekit.repair(joints, STRICT)
    np.testing.assert_array_equal(repaired.joints, joints)
    assert repaired.spans == () and repaired.left == ()
    assert not repaired.changed.any()


@pytest.mark.parametrize("ranges", ["anatomical", "urdf"])
def test_illegal_postures_come_back_valid_by_a_fresh_validator(ranges: str) -> None:
    """A validator that has not seen them before passes them."""
    repaired = posekit.repair(illegal(), Validator(ranges=ranges, strict=True))
    assert Validator(ranges=ranges, strict=True).check(repaired.joints).valid.all()
    assert repaired.valid.all() and repaired.left == ()


def test_repairing_again_changes_nothing() -> None:
    """A repaired posture is a legal one."""
    once = repaired_illegal()
    np.testing.assert_array_equal(posekit.repair(once.joints, STRICT).joints, once.joints)


def test_lengths_that_were_right_stay() -> None:
    """Turned pieces keep their lengths; a length that was wrong comes within its tolerance."""
    given = illegal()
    before, after = lengths_of(given), lengths_of(posekit.repair(given, STRICT).joints)
    np.testing.assert_allclose(after[[0, 1, 3]], before[[0, 1, 3]], rtol=0, atol=1e-12)
    own = np.array(list(FIGURE.lengths.values()))
    assert (np.abs(after - own) <= 0.03).all()


def test_mirror_images_are_repaired_alike() -> None:
    """Left and right are exchanged, and the repaired posture with them."""
    exchanged = [JOINT[other_side(name)] for name in JOINTS]
    mirrored = (illegal() * [1, -1, 1])[:, exchanged]
    repaired = repaired_illegal().joints
    np.testing.assert_allclose(
        posekit.repair(mirrored, STRICT).joints, (repaired * [1, -1, 1])[:, exchanged], rtol=0, atol=AS_NEAR
    )


def test_a_turned_and_shifted_world_changes_nothing() -> None:
    """The remedy knows no frame."""
    R, shift = rotation_from_vector(np.array([0.3, -1.2, 0.7])), np.array([2.0, -1.0, 0.5])
    repaired = repaired_illegal().joints
    np.testing.assert_allclose(
        posekit.repair(illegal() @ R.T + shift, STRICT).joints, repaired @ R.T + shift, rtol=0, atol=AS_NEAR
    )


@pytest.mark.parametrize("degrees", [5, 15, 40])
@pytest.mark.parametrize("limb", [0, 1, 2, 3])
def test_the_change_is_no_more_than_to_a_known_legal_posture(degrees: float, limb: int) -> None:
    """The straight limb is legal: the nearest legal posture is not farther."""
    given, straight = hinge_beyond(degrees + 10, limb), hinge_beyond(0, limb)
    assert STRICT.check(straight[None]).valid.all()
    repaired = posekit.repair(given, STRICT).joints[0]
    assert np.linalg.norm(repaired - given) <= np.linalg.norm(straight - given) + 1e-6


def test_the_record_says_which_joints_moved_and_how_far() -> None:
    """The most that a span says is the distance that its joint moved."""
    given, repaired = illegal(), repaired_illegal()
    apart = np.linalg.norm(repaired.joints - given, axis=-1)
    assert repaired.changed.all()
    for span in repaired.spans:
        column = JOINTS.index(span.place)
        assert span.most == pytest.approx(apart[span.first : span.last + 1, column].max())
    assert repaired.told().startswith("4 of 4 frames changed; ")
    assert repaired.as_dict()["valid"] == 4


def test_weights_say_which_joints_move_less() -> None:
    """A joint that weighs a hundred times as much moves less."""
    given = hinge_beyond(30, 0)
    weights = np.ones(14)
    weights[JOINT["right_wrist"]] = 100.0
    wrist = [
        np.linalg.norm(posekit.repair(given, STRICT, weights=one).joints[0] - given, axis=-1)[
            JOINT["right_wrist"]
        ]
        for one in (None, weights)
    ]
    assert wrist[1] < 0.5 * wrist[0]


def test_the_head_moves_as_one_piece() -> None:
    """Distances between its points stay, and a neck that is turned too far is turned back."""
    points = standing()
    turn = rotation_from_vector(np.array([0.0, 0.0, np.radians(140.0)]))
    head = points[0] + (points[14:] - points[0]) @ turn.T
    assert STRICT.check(points[None, :14], head[None]).invalid.all()
    repaired = posekit.repair(points[:14], STRICT, head=head[None])
    assert repaired.head is not None and repaired.valid.all()
    gaps = [np.linalg.norm(one[:, None] - one, axis=-1) for one in (head, repaired.head[0])]
    np.testing.assert_allclose(gaps[1], gaps[0], rtol=0, atol=1e-12)
    assert head.shape == (len(HEAD_POINTS), 3)


def test_unknown_joints_stay_unknown() -> None:
    """A posture without a wrist has none afterwards, and one without torso stays as it is."""
    given = np.stack([hinge_beyond(20, 3), hinge_beyond(20, 3)])
    given[0, JOINT["left_wrist"]] = np.nan
    given[1, JOINT["neck"]] = np.nan
    repaired = posekit.repair(given, STRICT)
    assert np.array_equal(np.isnan(repaired.joints), np.isnan(given))
    np.testing.assert_array_equal(repaired.joints[1], given[1])
    assert not STRICT.check(repaired.joints).invalid[0]


def test_a_robot_is_sent_to_its_configurations() -> None:
    """The stick figure's postures are what is repaired here."""
    with pytest.raises(InputError, match="repair_configurations"):
        posekit.repair(standing()[:14], Validator("human"))


def test_jacobians_are_differences() -> None:
    """The pieces' derivatives are those of turning them."""
    points = standing()[None]
    exact = jacobian_of(points)[0]
    for k in range(N_UNKNOWNS):
        step = np.zeros((2, N_UNKNOWNS))
        step[:, k] = [1e-6, -1e-6]
        ahead, behind = moved(np.repeat(points, 2, axis=0), step)
        np.testing.assert_allclose(exact[..., k], (ahead - behind) / 2e-6, rtol=0, atol=1e-9)


def test_linearised_margins_are_differences() -> None:
    """Slopes of margins are those of turning pieces."""
    points = np.concatenate([illegal()[1], standing()[14:]])[None]
    _, suite = STRICT.figure_and_suite(points[:, :14])
    constraints = MarginConstraints(checks=[check for check in suite if not check.rigid])
    found = constraints.linearised(points, jacobian_of(points))
    margin = np.concatenate(
        [margins_of(check, points[:, list(check.points)])[0] for check in constraints.checks]
    )
    rng = np.random.default_rng(0)
    step = 1e-6 * rng.normal(size=(1, N_UNKNOWNS))
    after = constraints.margins(moved(points, step))[0]
    for value, slope in zip(found.value[0], found.slope[0], strict=True):
        if value < 0:
            place = int(np.argmin(np.abs(margin - value)))
            assert after[place] - margin[place] == pytest.approx(slope @ step[0], abs=1e-9)
    assert (found.value[0] < 0).any()


def test_spans_are_runs_of_frames() -> None:
    """Frames count from 0, and both ends count."""
    which = np.array([True, True, False, True])
    moved_by = np.zeros((4, 14))
    moved_by[which, 2] = [1 * CENTIMETRE, 2 * CENTIMETRE, 3 * CENTIMETRE]
    first, second = spans_of("turned", moved_by)
    assert (first.place, first.first, first.last, first.most) == (JOINTS[2], 0, 1, 2 * CENTIMETRE)
    assert str(second) == f"{JOINTS[2]} turned by up to 3 cm in frame 3"
