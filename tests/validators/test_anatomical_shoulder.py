"""Elevation, plane and turn of an arm: against rotation matrices, at the clinic's positions and at the poles."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posekit.validators.anatomical_shoulder import SEAM_DEGREES, elevation_and_plane, turn_offset


def wrapped(degrees: np.ndarray) -> np.ndarray:
    return np.asarray((degrees + 180.0) % 360.0 - 180.0)


def arm(flexion: np.ndarray, abduction: np.ndarray, rotation: np.ndarray) -> Rotation:
    """Turn a right arm by the URDF's three joints: axes -y, -x, +z."""
    turns = np.stack([-flexion, -abduction, rotation], axis=-1)
    return Rotation.from_euler("YXZ", turns, degrees=True)


def test_they_are_those_of_the_rotation_matrix(rng: np.random.Generator) -> None:
    flexion, abduction, rotation = rng.uniform(-180, 180, (3, 5000))
    R = arm(flexion, abduction, rotation)
    forward, left, up = R.apply([0.0, 0.0, -1.0]).T
    elevation, plane = elevation_and_plane(flexion, abduction)
    np.testing.assert_allclose(elevation, np.degrees(np.arccos(np.clip(-up, -1, 1))), atol=1e-6)
    np.testing.assert_allclose(wrapped(plane - np.degrees(np.arctan2(-left, forward))), 0, atol=1e-9)
    # The twist: what is left after the shortest swing that takes the hanging arm to its direction.
    x, y, z, w = R.as_quat().T
    twist = 2 * np.degrees(np.arctan2(z, w))
    side = 90.0 - np.where(plane < SEAM_DEGREES, plane + 360.0, plane)
    turn = twist - (1 - np.cos(np.radians(elevation))) * side
    np.testing.assert_allclose(wrapped(turn_offset(flexion, abduction) + rotation - turn), 0, atol=1e-6)
    assert np.abs(x).max() > 0.5 < np.abs(y).max()


def test_both_ways_to_write_a_rotation_have_one_turn(rng: np.random.Generator) -> None:
    flexion, abduction = rng.uniform(-180, 180, (2, 5000))
    here, there = turn_offset(flexion, abduction), turn_offset(flexion + 180, 180 - abduction) + 180
    np.testing.assert_allclose(wrapped(here - there), 0, atol=1e-6)


@pytest.mark.parametrize("rotation", [-100.0, -30.0, 0.0, 55.0])
@pytest.mark.parametrize("abduction", [0.0, 30.0, 90.0, 120.0])
def test_in_the_frontal_plane_the_turn_is_the_goniometers_angle(abduction: float, rotation: float) -> None:
    offset = turn_offset(np.array([0.0]), np.array([abduction]))
    assert wrapped(offset + rotation - rotation)[0] == pytest.approx(0.0, abs=1e-9)


def test_with_the_arm_raised_forward_zero_is_a_forearm_across_the_body() -> None:
    # Carried from sideways to forward at the height of the shoulder, the forearm that pointed forward points inward.
    offset = turn_offset(np.array([90.0]), np.array([0.0]))
    assert offset[0] + 90.0 == pytest.approx(0.0, abs=1e-9)
    R = arm(np.array([90.0]), np.array([0.0]), np.array([90.0]))
    np.testing.assert_allclose(R.apply([1.0, 0.0, 0.0])[0], [0.0, 1.0, 0.0], atol=1e-12)


def test_the_turn_has_no_pole_sideways_nor_overhead(rng: np.random.Generator) -> None:
    """Near the pole of flexion and abduction, and at the vertical, a small change of direction changes it little."""
    for pole, forearm, wild in (
        ([0.0, -1.0, 0.0], [1.0, 0.0, 0.0], True),
        ([0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], False),
    ):
        upper = np.array(pole) + 1e-4 * rng.normal(size=(500, 3))
        upper /= np.linalg.norm(upper, axis=1, keepdims=True)
        front = np.array(forearm) - (upper @ np.array(forearm))[:, None] * upper
        front /= np.linalg.norm(front, axis=1, keepdims=True)
        R = Rotation.from_matrix(np.stack([front, np.cross(-upper, front), -upper], axis=-1))
        flexion, abduction, rotation = R.as_euler("YXZ", degrees=True).T * [[-1], [-1], [1]]
        turn = turn_offset(flexion, abduction) + rotation
        assert (np.ptp(flexion % 360.0) > 100) == wild
        assert np.abs(wrapped(turn - turn[0])).max() < 0.5


def test_the_seam_is_behind_the_back() -> None:
    def turn_at(plane: float, elevation: float = 60.0) -> float:
        p, e = np.radians(plane), np.radians(elevation)
        abduction = np.arcsin(np.sin(e) * np.sin(p))
        flexion = np.arctan2(np.sin(e) * np.cos(p), np.cos(e))
        return float(turn_offset(np.degrees([flexion]), np.degrees([abduction]))[0])

    for plane in np.arange(-179.0, 180.0, 5.0):
        step = wrapped(np.array([turn_at(plane + 0.01) - turn_at(plane)]))[0]
        assert abs(step) < 0.1
    jump = wrapped(np.array([turn_at(SEAM_DEGREES + 1e-6) - turn_at(SEAM_DEGREES - 1e-6)]))[0]
    assert abs(jump) == pytest.approx(180.0, abs=1e-3)  # 360 (1 - cos 60)
