"""Parts of checks by calculations of another kind: hulls, printed angles, and what is kept from person to person."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from posekit.body import load_figure
from posekit.body.measured import MeasuredPerson
from posekit.validators import Validator
from posekit.validators.projected_angles import projected_plane
from posekit.validators.robot.balance import _plane, convex_hull, inside_hull
from posekit.validators.robot.robot_validator import RobotValidator

FIGURE = load_figure()


@pytest.mark.parametrize("count", [3, 4, 7, 20])
def test_a_place_is_as_far_inside_a_hull_as_its_nearest_side(count: int, rng: np.random.Generator) -> None:
    for _ in range(20):
        points = rng.normal(size=(count, 2))
        sides = ConvexHull(points).equations
        for place in rng.normal(size=(10, 2)):
            inside = -(sides[:, :2] @ place + sides[:, 2]).max()
            found = inside_hull(points, place)
            assert found == pytest.approx(inside) if inside >= 0 else found <= inside + 1e-12
    assert inside_hull(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), np.array([1.3, 1.4])) == (
        pytest.approx(-0.5)
    )


@pytest.mark.parametrize("count", [1, 3])
def test_points_on_an_edge_are_no_corners_of_a_hull(count: int) -> None:
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    shares = np.arange(1, count + 1)[:, None] / 4.0
    between = [a + shares * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    np.testing.assert_array_equal(convex_hull(np.concatenate([corners, *between, [[1.0, 2.0]]])), corners)


def test_a_plane_across_up_is_a_right_handed_pair(rng: np.random.Generator) -> None:
    across = rng.normal(size=(20, 3))
    for up in [*np.eye(3), *across / np.linalg.norm(across, axis=1, keepdims=True)]:
        axes = np.column_stack([_plane(up), up])
        np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) > 0


def test_the_printed_angles_of_a_plane_are_those_of_two_directions(rng: np.random.Generator) -> None:
    normal, along = rng.normal(size=(2, 50, 3))
    for found, (x, y, z), (_, down, left) in zip(
        projected_plane(normal, along, 0.0).tolist(), normal.tolist(), along.tolist(), strict=True
    ):
        angles = math.atan2(-y, x), math.atan2(z, x), math.atan2(left, down)
        np.testing.assert_allclose(found, np.degrees(angles), atol=1e-9)


def test_a_robot_allows_the_noise_of_the_person_who_is_judged() -> None:
    validator = Validator("human", bodies="capsules")

    def robot(noise: float) -> RobotValidator:
        return validator._robot_for(MeasuredPerson(lengths=dict(FIGURE.lengths), behind=None, noise=noise))

    small, large = robot(0.005), robot(0.02)
    assert small.settings.rigid < large.settings.rigid
    assert robot(0.02) is large and robot(0.005).settings == small.settings
    assert robot(0.0) is validator._robot
