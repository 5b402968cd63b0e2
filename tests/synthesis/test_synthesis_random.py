"""Random postures and cameras: legal, seen whole, reproducible, uniform."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.errors import FigureError, InputError
from posekit.skeleton import DOFS, SEGMENTS, segment_name
from posekit.synthesis import CameraSphere, random_postures, random_views
from posekit.synthesis.viewpoints import look_at, to_camera, uniform_directions

FIGURE = load_figure()
VIEWS = random_views(FIGURE, 400, np.random.default_rng(7))


def test_postures_are_inside_every_limit_and_free_of_collision():
    q = random_postures(FIGURE, 300, np.random.default_rng(0))
    assert q.shape == (300, FIGURE.model.nq)
    angles = q[:, FIGURE.angle_index]
    assert (angles >= FIGURE.limits.lower).all()
    assert (angles <= FIGURE.limits.upper).all()
    data, geometry_data = FIGURE.model.createData(), FIGURE.geometry.createData()
    for row in q:
        assert not pin.computeCollisions(FIGURE.model, data, FIGURE.geometry, geometry_data, row, True)


def test_angles_that_no_collision_depends_on_are_uniform():
    q = random_postures(FIGURE, 5000, np.random.default_rng(1))
    k = DOFS.index("left_knee.flexion")
    share = (q[:, FIGURE.angle_index[k]] - FIGURE.limits.lower[k]) / np.ptp(
        [FIGURE.limits.lower[k], FIGURE.limits.upper[k]]
    )
    # Knees hit little: within 5 % of the uniform distribution function everywhere.
    assert np.abs(np.sort(share) - np.linspace(0, 1, len(share))).max() < 0.05


def test_batch_verdicts_are_those_of_single_calls():
    rng = np.random.default_rng(2)
    q = np.tile(pin.neutral(FIGURE.model), (300, 1))
    q[:, FIGURE.angle_index] = rng.uniform(FIGURE.limits.lower, FIGURE.limits.upper, (300, len(DOFS)))
    data, geometry_data = FIGURE.model.createData(), FIGURE.geometry.createData()
    single = [
        pin.computeCollisions(FIGURE.model, data, FIGURE.geometry, geometry_data, row, True) for row in q
    ]
    assert 0 < sum(single) < 300
    np.testing.assert_array_equal(FIGURE.collides(q), single)


def test_narrower_limits_are_kept():
    figure = FIGURE.with_limits({"right_elbow.flexion": (0.1, 0.2)})
    elbow = random_postures(figure, 50, np.random.default_rng(0))[
        :, figure.angle_index[DOFS.index("right_elbow.flexion")]
    ]
    assert (elbow >= 0.1).all()
    assert (elbow <= 0.2).all()


def test_views_keep_lengths_and_project_and_come_back_from_q():
    for a, b in SEGMENTS:
        length = np.linalg.norm(VIEWS.joints_cam[:, a] - VIEWS.joints_cam[:, b], axis=-1)
        np.testing.assert_allclose(length, FIGURE.lengths[segment_name((a, b))], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(VIEWS.image, VIEWS.camera.project(VIEWS.joints_cam))
    np.testing.assert_array_equal(VIEWS.head_image, VIEWS.camera.project(VIEWS.head_cam))
    points = FIGURE.forward_kinematics(VIEWS.q)
    np.testing.assert_allclose(points[:, :14], VIEWS.joints_cam, rtol=0, atol=1e-12)
    np.testing.assert_allclose(points[:, 14:], VIEWS.head_cam, rtol=0, atol=1e-12)


def test_views_show_the_whole_person():
    image = np.concatenate([VIEWS.image, VIEWS.head_image], axis=1)
    assert (image >= 0).all()
    assert (image <= VIEWS.size).all()
    assert (VIEWS.joints_cam[..., 2] > 0).all()


def test_cameras_are_where_the_sphere_allows_and_upright():
    points = np.concatenate([VIEWS.joints_cam, VIEWS.head_cam], axis=1)
    world = np.einsum("fji,fpj->fpi", VIEWS.R_cam_world, points - VIEWS.t_cam_world[:, None])
    middle = (world.min(axis=1) + world.max(axis=1)) / 2
    place = -np.einsum("fji,fj->fi", VIEWS.R_cam_world, VIEWS.t_cam_world)
    distance = np.linalg.norm(place - middle, axis=1)
    assert (distance >= 2.5 - 1e-12).all()
    assert (distance <= 6.0 + 1e-12).all()
    aimed = to_camera(middle[:, None], VIEWS.R_cam_world, place)[:, 0]
    np.testing.assert_allclose(aimed[:, :2], 0, rtol=0, atol=1e-12)
    # No roll: the camera's x axis is horizontal, and world up points up in the image.
    np.testing.assert_allclose(VIEWS.R_cam_world[:, 0, 2], 0, rtol=0, atol=1e-12)
    assert (VIEWS.R_cam_world[:, 1, 2] <= 0).all()


def test_the_same_seed_gives_the_same_views():
    again = random_views(FIGURE, 400, np.random.default_rng(7))
    other = random_views(FIGURE, 400, np.random.default_rng(8))
    np.testing.assert_array_equal(again.joints_cam, VIEWS.joints_cam)
    assert not np.array_equal(other.joints_cam, VIEWS.joints_cam)


def test_directions_are_uniform_on_the_sphere():
    directions = uniform_directions(20000, np.random.default_rng(0))
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, rtol=0, atol=1e-12)
    np.testing.assert_allclose(directions.mean(axis=0), 0, atol=4 / np.sqrt(3 * 20000))
    np.testing.assert_allclose(directions.T @ directions / 20000, np.eye(3) / 3, atol=0.01)


@given(
    st.tuples(*[st.sampled_from([0.0, 1.0, -1.0, 1e-9]) | st.floats(-5, 5)] * 3),
    st.sampled_from([(0.0, 0.0, 1.0), (0.0, -2.0, 0.0), (1.0, 1.0, 0.0)]),
)
def test_look_at_is_a_rotation_towards_the_target(offset, up):
    position = np.array(offset)
    if np.linalg.norm(position) < 1e-6:
        with pytest.raises(InputError, match="move it"):
            look_at(np.zeros(3), np.zeros(3), np.array(up))
        return
    R = look_at(position, np.zeros(3), np.array(up))
    np.testing.assert_allclose(R @ R.T, np.eye(3), rtol=0, atol=1e-9)
    assert np.linalg.det(R) == pytest.approx(1)
    np.testing.assert_allclose(R @ -position, np.array([0, 0, np.linalg.norm(position)]), rtol=0, atol=1e-9)
    assert R[1] @ up <= 1e-9


@pytest.mark.parametrize(
    "options",
    [
        {"distance": (0.0, 3.0)},
        {"distance": (3.0, 2.0)},
        {"distance": (np.nan, 2.0)},
        {"f": -1.0},
        {"size": (0, 100)},
    ],
)
def test_impossible_spheres_are_refused(options):
    with pytest.raises(InputError) as refused:
        CameraSphere(**options)
    assert "\n" not in str(refused.value)


def test_a_person_that_cannot_fit_is_said_to_be():
    near = CameraSphere(distance=(0.3, 0.4))
    with pytest.raises(InputError, match=r"does not fit .* move away or lower f"):
        random_views(FIGURE, 3, np.random.default_rng(0), near)


def test_impossible_numbers_are_refused():
    with pytest.raises(InputError, match="one or more"):
        random_postures(FIGURE, 0, np.random.default_rng(0))
    with pytest.raises(FigureError, match="not finite"):
        FIGURE.collides(np.full((1, FIGURE.model.nq), np.nan))


def test_limits_that_leave_nothing_are_said_to():
    # Both forearms held across the torso's axis: every posture collides.
    limits = {
        f"{side}_{angle}": (value, value + 1e-3)
        for side in ("right", "left")
        for angle, value in (
            ("shoulder.flexion", 0.0),
            ("shoulder.abduction", -0.8),
            ("shoulder.rotation", 0.0),
            ("elbow.flexion", 0.0),
        )
    }
    with pytest.raises(InputError, match="free of collision"):
        random_postures(FIGURE.with_limits(limits), 10, np.random.default_rng(0))
