"""The head and the camera: laws first, then the paper's tables, OpenCV as an oracle, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.cameras import PinholeCamera, lee_chen
from posekit.cameras.head import (
    TABLE_A2,
    HeadPoints,
    HeadWarning,
    calibrate,
    dlt,
    head_points_cam,
    solve_pose,
)
from posekit.cameras.head.perspective import HeadPlacement, Heads, look
from posekit.errors import CameraError, HeadError
from posekit.geometry import rotation_from_vector
from posekit.skeleton import HEAD_POINTS

CM = 0.01
PRINTED_A2B = CM * np.array(
    [
        [-0.00024, 0.59320],
        [-0.00025, 0.70944],
        [-0.06329, 0.74631],
        [0.06280, 0.74631],
        [-0.09680, 0.68273],
        [0.09631, 0.68273],
    ]
)
"""Table A.2(b), metres, y up as printed."""
MISPRINTED = TABLE_A2.with_points({"right_eye": CM * np.array([-32.168, 65.103, 5.5])})
FRONT = np.array([[0.0, 0, -1], [0, -1, 0], [-1, 0, 0]])
"""R_cam_head of the paper's camera, which looks the person in the face."""
F = 5 * CM
AHEAD = np.array([0.0, 0.0, 4.05])
"""t_cam_head of the paper's camera: its image plane's origin is 4 m in front of the head frame's origin."""

PIXELS = PinholeCamera(K=np.array([[1000.0, 0, 640], [0, 1000, 360], [0, 0, 1]]))
SKEWED = PinholeCamera(K=np.array([[900.0, 3, 640], [0, 1100, 360], [0, 0, 1]]))
DISTORTED = PinholeCamera(
    K=np.array([[900.0, 0, 640], [0, 1100, 360], [0, 0, 1]]),
    distortion=np.array([-0.2, 0.05, 0.001, -0.002, 0.01]),
)


def random_poses(rng, count, nearest=1.0, farthest=8.0):
    """Draw heads turned any way, somewhere in view, with the middle of the head this far away."""
    R = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    R *= np.sign(np.linalg.det(R))[:, None, None]
    z = rng.uniform(nearest, farthest, count)
    middle = np.column_stack([rng.uniform(-0.4, 0.4, (count, 2)) * z[:, None], z])
    return R, middle - R @ TABLE_A2.points.mean(axis=0)


def view(camera, R, t, head=TABLE_A2):
    return camera.project(head_points_cam(R, t, head))


def paper_image(R=FRONT, t=AHEAD, f=F, head=TABLE_A2):
    return view(lee_chen.pinhole(f), R[None], t[None], head)[0]


# Laws ---------------------------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1), st.floats(0.005, 0.5), st.floats(0.25, 12))
def test_exact_projections_give_the_camera_back(seed, f, distance):
    R, t = random_poses(np.random.default_rng(seed), 1, distance, distance)
    image = view(lee_chen.pinhole(f), R, t)
    for known in (None, f):
        pose = calibrate(TABLE_A2, image[0], known)
        assert abs(pose.f[0] / f - 1) < 1e-10
        np.testing.assert_allclose(pose.R_cam_head, R, rtol=0, atol=1e-11)
        np.testing.assert_allclose(pose.t_cam_head, t, rtol=0, atol=1e-9)
        np.testing.assert_allclose(pose.points_cam, head_points_cam(R, t, TABLE_A2), rtol=0, atol=1e-9)
        assert pose.rms[0] < 1e-14
        assert pose.misfit == (None,)


@pytest.mark.parametrize("camera", [PIXELS, SKEWED, DISTORTED])
def test_exact_pixels_give_the_pose_back(camera, rng):
    R, t = random_poses(rng, 200, 0.4)
    pose = solve_pose(TABLE_A2, view(camera, R, t), camera)
    assert pose.found.all()
    np.testing.assert_allclose(pose.R_cam_head, R, rtol=0, atol=1e-11)
    np.testing.assert_allclose(pose.t_cam_head, t, rtol=0, atol=1e-11)


def test_rotations_are_orthonormal(rng):
    R, t = random_poses(rng, 100)
    image = view(PIXELS, R, t) + rng.normal(size=(100, 6, 2))
    pose = solve_pose(TABLE_A2, image, PIXELS)
    np.testing.assert_allclose(
        pose.R_cam_head @ pose.R_cam_head.mT, np.broadcast_to(np.eye(3), (100, 3, 3)), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(pose.R_cam_head), 1, atol=1e-14)
    linear = dlt(TABLE_A2, image - [640, 360])
    R_linear = linear.R[linear.found]
    assert linear.found.sum() > 50
    np.testing.assert_allclose(R_linear @ R_linear.mT, np.broadcast_to(np.eye(3), R_linear.shape), atol=1e-13)
    np.testing.assert_allclose(np.linalg.det(R_linear), 1, atol=1e-13)


def test_direct_linear_transformation_of_exact_points(rng):
    R, t = random_poses(rng, 100)
    f = rng.uniform(0.01, 0.5, 100)
    points = head_points_cam(R, t, TABLE_A2)
    linear = dlt(TABLE_A2, lee_chen.pinhole(f).project(points))
    assert linear.found.all()
    np.testing.assert_allclose(linear.f, f, rtol=1e-8)
    np.testing.assert_allclose(linear.R, R, rtol=0, atol=1e-8)
    np.testing.assert_allclose(linear.t, t, rtol=0, atol=1e-7)
    homogeneous = TABLE_A2.points @ linear.P[:, :, :3].mT + linear.P[:, None, :, 3]
    np.testing.assert_allclose(
        homogeneous[..., :2] / homogeneous[..., 2:], lee_chen.pinhole(f).project(points), rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(homogeneous[..., 2], points[..., 2], rtol=1e-8)


def test_a_batch_is_its_frames(rng):
    R, t = random_poses(rng, 8, 1, 3)
    image = view(PIXELS, R, t) + 0.1 * rng.normal(size=(8, 6, 2))
    batch = solve_pose(TABLE_A2, image, PIXELS)
    free = calibrate(TABLE_A2, image - [640, 360])
    for k in range(8):
        alone = solve_pose(TABLE_A2, image[k], PIXELS)
        np.testing.assert_allclose(alone.t_cam_head[0], batch.t_cam_head[k], rtol=1e-9)
        np.testing.assert_allclose(alone.residuals[0], batch.residuals[k], rtol=1e-7)
        if free.found[k]:
            np.testing.assert_allclose(calibrate(TABLE_A2, image[k] - [640, 360]).f[0], free.f[k], rtol=1e-7)
        else:
            with pytest.raises(HeadError):
                calibrate(TABLE_A2, image[k] - [640, 360])


def test_one_camera_a_frame(rng):
    R, t = random_poses(rng, 5)
    f = rng.uniform(0.02, 0.1, 5)
    image = lee_chen.pinhole(f).project(head_points_cam(R, t, TABLE_A2))
    pose = calibrate(TABLE_A2, image, f)
    np.testing.assert_allclose(pose.t_cam_head, t, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(pose.f, f)
    assert (pose.f_deviation == 0).all()


def test_known_f_is_a_pinhole_camera(rng):
    R, t = random_poses(rng, 20)
    image = view(PIXELS, R, t) + rng.normal(size=(20, 6, 2))
    pixels, plane = solve_pose(TABLE_A2, image, PIXELS), calibrate(TABLE_A2, image - [640, 360], 1000.0)
    np.testing.assert_allclose(pixels.t_cam_head, plane.t_cam_head, rtol=1e-4)
    np.testing.assert_allclose(pixels.rms, plane.rms, rtol=1e-9)


def test_the_order_of_points_does_not_matter(rng):
    order = rng.permutation(6)
    shuffled = HeadPoints(names=tuple(TABLE_A2.names[k] for k in order), points=TABLE_A2.points[order])
    image = paper_image() + 1e-6 * rng.normal(size=(6, 2))
    one, other = calibrate(TABLE_A2, image), calibrate(shuffled, image[order])
    np.testing.assert_allclose(one.t_cam_head, other.t_cam_head, rtol=1e-5)
    np.testing.assert_allclose(one.point("neck"), other.point("neck"), rtol=1e-5)
    np.testing.assert_allclose(one.residuals[0, order], other.residuals[0], rtol=1e-4)


def test_the_unit_of_the_image_goes_with_f(rng):
    image = paper_image() + 1e-6 * rng.normal(size=(6, 2))
    metres, pixels = calibrate(TABLE_A2, image), calibrate(TABLE_A2, image * 1e5)
    np.testing.assert_allclose(pixels.f, metres.f * 1e5, rtol=1e-5)
    np.testing.assert_allclose(pixels.t_cam_head, metres.t_cam_head, rtol=1e-5)
    np.testing.assert_allclose(pixels.rms, metres.rms * 1e5, rtol=1e-8)


def test_where_the_head_frame_is_does_not_matter(rng):
    turn = rotation_from_vector(np.array([[0.3, -1.2, 2.0]]))[0]
    moved = HeadPoints(names=TABLE_A2.names, points=TABLE_A2.points @ turn.T + [1.0, -2.0, 3.0])
    image = paper_image() + 1e-6 * rng.normal(size=(6, 2))
    np.testing.assert_allclose(
        calibrate(TABLE_A2, image).points_cam, calibrate(moved, image).points_cam, rtol=1e-5, atol=1e-6
    )


def test_more_points_are_more_exact(rng):
    extra = {
        f"mark_{k}": place
        for k, place in enumerate(TABLE_A2.points.mean(axis=0) + rng.normal(0, 0.08, (20, 3)))
    }
    many = TABLE_A2.with_points(extra)
    R, t = random_poses(rng, 200, 1, 3)
    image = view(PIXELS, R, t, many) + 0.5 * rng.normal(size=(200, 26, 2))
    error = [
        np.median(np.linalg.norm(solve_pose(head, image[:, :count], PIXELS).t_cam_head - t, axis=-1))
        for head, count in ((TABLE_A2, 6), (many, 26))
    ]
    assert error[1] < error[0] / 1.5


def test_deviation_of_f_is_what_it_says(rng):
    """Repeated with fresh noise, f spreads as its deviation says: the pull has Student's t distribution."""
    R, t = random_poses(rng, 1, 0.8, 0.8)
    image = view(PIXELS, R, t) - [640, 360] + 0.02 * rng.normal(size=(2000, 6, 2))
    pose = calibrate(TABLE_A2, image)
    assert pose.found.all()
    pull = (pose.f - 1000) / pose.f_deviation
    # Half of a t distribution with 5 degrees of freedom lies within 0.727.
    assert 0.45 < np.mean(np.abs(pull) < 0.727) < 0.55


# The paper's numbers ------------------------------------------------------------------------------------


def test_head_points_of_the_paper():
    assert TABLE_A2.names == ("neck", *HEAD_POINTS)
    # With the right eye corrected, A.2(b) is the projection of A.2(a) to its printed digits, but for the
    # 0.00024 cm by which Table 2's camera is aside.
    image = lee_chen.image_from_paper(paper_image()) / CM
    np.testing.assert_allclose(image, PRINTED_A2B / CM, rtol=0, atol=3.5e-4)
    assert abs(lee_chen.image_from_paper(paper_image(head=MISPRINTED))[2, 1] / CM - 0.74631) > 1.3e-3


@pytest.mark.parametrize("f", [None, F])
def test_table_2_from_exact_projections(f):
    pose = calibrate(TABLE_A2, paper_image(), f)
    R, t = pose.R_cam_head[0], pose.t_cam_head[0]
    position = lee_chen.camera_position(R, t, pose.f[0]) / CM
    np.testing.assert_allclose(position, [400, 0, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(pose.f / CM, 5, rtol=0, atol=1e-11)
    # The print (its data were a little coarser than ours): (a), in centimetres, (b), (c) and (d).
    in_cm = lee_chen.transformation_matrix(R, t, pose.f[0]) * np.array(
        [[1, 1, CM]] * 3 + [[1 / CM, 1 / CM, 1]]
    )
    printed_T = [
        [0.00003, -0.00002, -0.20000],
        [0.00000, 0.99999, 0.00001],
        [-1.00000, -0.00001, -0.00001],
        [-0.02061, 0.00085, 80.99937],
    ]
    np.testing.assert_allclose(in_cm, printed_T, rtol=0, atol=0.021)
    np.testing.assert_allclose(in_cm[:3], printed_T[:3], rtol=0, atol=4e-5)
    printed_R = [[0.00003, -0.00002, 1.00001], [0.00000, 0.99999, -0.00004], [-1.00000, -0.00001, 0.00007]]
    np.testing.assert_allclose(lee_chen.rotation_to_paper(R), printed_R, rtol=0, atol=8e-5)
    np.testing.assert_allclose(position, [400.00116, -0.01535, 0.00595], rtol=0, atol=0.016)
    printed_points = [
        [-0.00499, 52.12662, 434.17551],
        [-0.00485, 61.62641, 429.17581],
        [-5.50490, 65.12637, 431.17560],
        [5.49510, 65.12647, 431.17633],
        [-8.50501, 60.12647, 435.17526],
        [8.49499, 60.12663, 435.17639],
    ]
    points = lee_chen.points_to_paper(pose.points_cam, pose.f)[0] / CM
    np.testing.assert_allclose(points, printed_points, rtol=0, atol=0.025)


@pytest.mark.parametrize(
    ("f", "focal_length", "position"),
    [(None, 4.996, (399.69, 0.04, -0.02)), (F, 5.0, (399.998, -0.009, -0.023))],
)
def test_printed_digits(f, focal_length, position):
    pose = calibrate(TABLE_A2, lee_chen.image_from_paper(PRINTED_A2B), f)
    assert pose.f[0] / CM == pytest.approx(focal_length, abs=5e-4)
    place = lee_chen.camera_position(pose.R_cam_head, pose.t_cam_head, pose.f)[0] / CM
    np.testing.assert_allclose(place, position, rtol=0, atol=5e-3 if f is None else 5e-4)
    assert pose.rms[0] / CM < 4e-6  # the rounding of the digits
    assert pose.misfit == (None,)


def test_plain_direct_linear_transformation_of_the_printed_digits():
    """As the paper solves it, eqs. 4-5, with no rotation made orthonormal: 4.2 cm away."""
    linear = dlt(TABLE_A2, lee_chen.image_from_paper(PRINTED_A2B))
    assert linear.f[0] / CM == pytest.approx(5.047, abs=5e-4)
    S = linear.P[0] * [[1 / CM], [-1 / CM], [1]] * [CM, CM, CM, 1]
    S /= np.linalg.norm(S[0, :3])
    f = 1 / np.linalg.norm(S[2, :3])
    assert f == pytest.approx(5.047, abs=5e-4)
    rotation_printed = np.stack([S[0, :3], S[1, :3], -f * S[2, :3]], axis=1)
    place = rotation_printed @ [-S[0, 3], -S[1, 3], (S[2, 3] - 1) * f]
    np.testing.assert_allclose(place, [404.18, 0.35, 0.82], rtol=0, atol=0.01)


@pytest.mark.parametrize("f", [None, F])
@pytest.mark.parametrize("image", [lee_chen.image_from_paper(PRINTED_A2B), paper_image()])
def test_the_misprinted_eye_is_named(f, image):
    with pytest.warns(
        HeadWarning, match=r"^head point right_eye does not fit the others: residual .*, rms "
    ) as caught:
        pose = calibrate(MISPRINTED, image, f)
    assert len(caught) == 1
    assert caught[0].filename == __file__
    assert pose.misfit == ("right_eye",)
    assert pose.rms_without[0] < pose.rms[0] / 100
    assert pose.residuals[0].argmax() == TABLE_A2.index("right_eye")


# Independent oracles ------------------------------------------------------------------------------------


@pytest.mark.parametrize("camera", [None, PIXELS, SKEWED, DISTORTED])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_jacobian_against_finite_differences(camera, side, rng):
    count = 5
    points = rng.normal(size=(count, 7, 3))
    seen = np.ones((count, 7))
    seen[0, 3] = 0
    points[0, 3] = 0
    K = None if camera is None else np.broadcast_to(camera.K, (count, 3, 3))
    distortion = None if camera is None else camera.distortion
    heads = Heads(points, rng.normal(size=(count, 7, 2)), seen, K, distortion, np.full(count, side))
    scale = rng.uniform(0.02, 0.1, count)
    slope = side * scale if camera is not None else rng.normal(0, 0.05, count)
    R = rotation_from_vector(rng.normal(size=(count, 3)))
    here = HeadPlacement(R, rng.normal(0, 0.3, (count, 2)), scale, slope)
    residual, jacobian, possible = look(heads, here)
    assert possible.all()
    assert (residual.reshape(count, 2, 7)[0, :, 3] == 0).all()
    for k in range(heads.unknowns):
        step = np.zeros((count, heads.unknowns))
        step[:, k] = 1e-5
        ahead, back = look(heads, here.moved(step, heads))[0], look(heads, here.moved(-step, heads))[0]
        size = np.abs(jacobian[:, :, k]).max()
        np.testing.assert_allclose((ahead - back) / 2e-5, jacobian[:, :, k], rtol=0, atol=1e-7 * size)


@pytest.mark.parametrize(("camera", "noise"), [(PIXELS, 0.3), (PIXELS, 2.0), (DISTORTED, 1.0)])
def test_no_pose_of_opencv_fits_better(camera, noise, rng):
    cv2 = pytest.importorskip("cv2")
    R, t = random_poses(rng, 150, 0.4)
    image = view(camera, R, t) + noise * rng.normal(size=(150, 6, 2))
    pose = solve_pose(TABLE_A2, image, camera)
    assert pose.found.all()

    def opencv_rms(k, rotation_vector, translation):
        seen = cv2.projectPoints(TABLE_A2.points, rotation_vector, translation, camera.K, camera.distortion)[
            0
        ]
        return np.sqrt(((seen[:, 0] - image[k]) ** 2).sum(axis=-1).mean())

    agree = 0
    for k in range(150):
        ours = opencv_rms(k, cv2.Rodrigues(pose.R_cam_head[k])[0], pose.t_cam_head[k])
        assert pose.rms[k] == pytest.approx(ours, rel=1e-9)
        truth = cv2.Rodrigues(R[k])[0], t[k][:, None].copy()
        for start in ((), (*truth, True)):
            found, *theirs = cv2.solvePnP(
                TABLE_A2.points, image[k], camera.K, camera.distortion, *start, flags=cv2.SOLVEPNP_ITERATIVE
            )
            assert found
            # From its own start OpenCV often ends with the head behind the camera.
            if (head_points_cam(cv2.Rodrigues(theirs[0])[0], theirs[1][:, 0], TABLE_A2)[:, 2] > 0).all():
                assert pose.rms[k] <= opencv_rms(k, *theirs) * (1 + 1e-6)
        agree += opencv_rms(k, *theirs) <= pose.rms[k] * (1 + 1e-3)
    assert agree > 140  # from the truth OpenCV comes to the same minimum


# Misfits ------------------------------------------------------------------------------------------------


def test_sound_heads_are_seldom_accused(rng):
    R, t = random_poses(rng, 1000)
    image = view(PIXELS, R, t)
    for noise in (1e-3, 0.5):
        noisy = image + noise * rng.normal(size=image.shape)
        known, free = solve_pose(TABLE_A2, noisy, PIXELS), calibrate(TABLE_A2, noisy - [640, 360])
        # Named at a rate of 0.005; and no warning, which would be an error here.
        assert np.mean([name is not None for name in known.misfit]) < 0.01
        assert np.mean([name is not None for name in free.misfit]) < 0.01
    for digits in (1, 3, 6, 9):
        rounded = calibrate(TABLE_A2, np.round(image - [640, 360], digits)[:100], 1000.0)
        assert sum(name is not None for name in rounded.misfit) <= 2


@pytest.mark.filterwarnings("error::posekit.cameras.head.HeadWarning")
def test_exact_heads_are_never_accused(rng):
    R, t = random_poses(rng, 1000)
    image = view(PIXELS, R, t)
    assert solve_pose(TABLE_A2, image, PIXELS).misfit == (None,) * 1000
    assert calibrate(TABLE_A2, image - [640, 360]).misfit == (None,) * 1000


@pytest.mark.parametrize("offset", [30.0, 300.0])
def test_a_wrong_point_is_named(offset, rng):
    R, t = random_poses(rng, 300, 1, 4)
    image = view(PIXELS, R, t) + 0.2 * rng.normal(size=(300, 6, 2))
    wrong, angle = rng.integers(0, 6, 300), rng.uniform(0, 2 * np.pi, 300)
    image[np.arange(300), wrong] += offset * np.column_stack([np.cos(angle), np.sin(angle)])
    with pytest.warns(HeadWarning, match=r"in \d+ of 300 frames, most in frames\[\d+\]") as caught:
        pose = solve_pose(TABLE_A2, image, PIXELS)
    assert len(caught) == 6  # one a point, not one a frame
    named = np.array([TABLE_A2.index(name) if name else -1 for name in pose.misfit])
    assert np.mean(named == wrong) > 0.99


def test_a_refusal_names_the_wrong_point(rng):
    R, t = random_poses(rng, 200, 1, 4)
    image = view(PIXELS, R, t) - [640, 360] + 0.05 * rng.normal(size=(200, 6, 2))
    image[:, 2] += 40
    with pytest.warns(HeadWarning, match="right_eye"):
        pose = calibrate(TABLE_A2, image)
    refused = [reason for reason in pose.reasons if reason]
    assert refused
    assert all(
        reason.endswith("check head point right_eye first, which does not fit the others")
        for reason in refused
    )


# What is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("solve", [dlt, calibrate, lambda head, image: calibrate(head, image, F)])
def test_unseen_points(solve):
    image = paper_image()
    image[1] = np.nan
    image[4, 0] = np.nan
    with pytest.raises(
        HeadError, match=r"^4 of 6 head points are known, at least 6 .*; missing: nose, right_ear$"
    ):
        solve(TABLE_A2, image)


@pytest.mark.parametrize("f", [None, F])
def test_frames_that_cannot_be_used_do_not_stop_the_others(f):
    image = np.stack([paper_image()] * 5)
    image[1, 0] = np.nan
    image[2] = 0.001
    image[3] *= [1, -1]
    pose = calibrate(TABLE_A2, image, f)
    assert pose.found.tolist() == [True, False, False, False, True]
    assert [bool(reason) for reason in pose.reasons] == [False, True, True, True, False]
    assert "missing: neck" in pose.reasons[1]
    assert "in one point" in pose.reasons[2]
    assert "behind the camera" in pose.reasons[3]
    for array in (pose.R_cam_head, pose.t_cam_head, pose.f, pose.points_cam):
        assert np.isnan(array[1:4]).all()
        assert np.isfinite(array[[0, 4]]).all()
    assert np.isnan(pose.residuals[1]).all()
    with pytest.raises(HeadError, match=r"^frame 1: 5 of 6 head points"):
        pose.require()
    linear = dlt(TABLE_A2, image)
    assert linear.found.tolist() == pose.found.tolist()
    assert np.isnan(linear.P[1:4]).all()


def test_no_frame_is_a_batch_too():
    for f in (None, F):
        pose = calibrate(TABLE_A2, np.empty((0, 6, 2)), f)
        assert pose.points_cam.shape == (0, 6, 3)
        assert pose.reasons == ()
    assert not calibrate(TABLE_A2, np.full((3, 6, 2), np.nan)).found.any()


def test_of_more_points_six_must_be_seen_and_suffice():
    head = TABLE_A2.with_points({"chin": [-0.302, 0.565, 0.0], "top": [-0.36, 0.74, 0.01]})
    image = np.stack([paper_image(head=head)] * 3)
    image[0, [0, 6]] = np.nan
    image[1, [0, 1, 2]] = np.nan
    image[2, 7] = np.nan
    pose = calibrate(head, image)
    assert pose.found.tolist() == [True, False, True]
    np.testing.assert_allclose(pose.t_cam_head[[0, 2]], [AHEAD] * 2, atol=1e-9)
    assert np.isnan(pose.residuals[0]).tolist() == [True, *[False] * 5, True, False]
    np.testing.assert_allclose(pose.point("neck")[0], FRONT @ head.points[0] + AHEAD, atol=1e-9)
    assert pose.reasons[1].startswith("5 of 8 head points are known")


def test_seen_points_in_a_plane():
    flat = {
        f"mark_{k}": [x, y, 0.0]
        for k, (x, y) in enumerate([(-0.3, 0.5), (-0.3, 0.7), (-0.4, 0.6), (-0.2, 0.6)])
    }
    head = TABLE_A2.with_points(flat)
    image = np.stack([paper_image(head=head)] * 2)
    image[0, 2:6] = np.nan
    pose = calibrate(head, image)
    assert pose.found.tolist() == [False, True]
    assert pose.reasons[0].startswith("the 6 head points lie in one plane")


@pytest.mark.parametrize("f", [None, F])
def test_heads_behind_the_camera(f):
    """The points behind a camera give the same image equations; so does a mirrored or y-up image."""
    behind = TABLE_A2.points @ FRONT.T - [0, 0, 4.0]
    image = F * behind[:, :2] / behind[:, 2:]
    for wrong in (image, lee_chen.image_from_paper(paper_image()), paper_image() * [-1, 1]):
        with pytest.raises(
            HeadError, match=r"^the points fit only a head behind the camera.*y must point down"
        ):
            calibrate(TABLE_A2, wrong, f)
        with pytest.raises(HeadError, match=r"^the points fit only a head behind the camera"):
            dlt(TABLE_A2, wrong)


def test_f_cannot_be_told_from_afar(rng):
    R, t = random_poses(rng, 200, 60, 60)
    pose = calibrate(TABLE_A2, view(PIXELS, R, t) - [640, 360] + 0.1 * rng.normal(size=(200, 6, 2)))
    weak = [
        reason for reason in pose.reasons if reason.startswith("the perspective is too weak to determine f")
    ]
    assert len(weak) > 50
    # Of those that a chance slope lets pass, f's deviation says how little it is worth.
    assert np.median(pose.f_deviation[pose.found] / pose.f[pose.found]) > 0.5


def test_linear_equations_with_many_solutions():
    """All points but neck and nose are in a plane, and these two in line with the camera."""
    neck, nose = TABLE_A2.points[:2]
    centre = nose + 30 * (nose - neck)
    forward = (neck - centre) / np.linalg.norm(neck - centre)
    right = np.array([0.0, 0.0, -1.0])
    R = np.stack([right, np.cross(forward, right), forward])
    image = paper_image(R, -R @ centre)
    with pytest.raises(HeadError, match=r"the linear equations have many solutions"):
        dlt(TABLE_A2, image)
    for f in (None, F):  # a rotation that is one leaves no doubt
        pose = calibrate(TABLE_A2, image, f)
        np.testing.assert_allclose(pose.t_cam_head[0], -R @ centre, rtol=0, atol=1e-9)


def test_image_on_a_line():
    image = np.linspace(0, 0.01, 6)[:, None] * [1.0, 0.5]
    with pytest.raises(HeadError, match=r"the image points lie on one line or in one point"):
        calibrate(TABLE_A2, image, F)


@pytest.mark.parametrize("shape", [(5, 2), (6, 3), (3, 5, 2), (2, 3, 6, 2), (12,)])
def test_image_of_a_wrong_shape(shape):
    with pytest.raises(HeadError, match=r"expected \(6, 2\) or \(F, 6, 2\), one row for each of neck, nose"):
        calibrate(TABLE_A2, np.zeros(shape))


def test_infinite_image_point():
    image = np.stack([paper_image()] * 2)
    image[1, 3, 1] = np.inf
    with pytest.raises(HeadError, match=r"^frame 1: head point left_eye is at \[.*inf\] in the image"):
        calibrate(TABLE_A2, image)


@pytest.mark.parametrize("f", [0.0, -0.05, np.nan])
def test_f_must_be_positive(f):
    with pytest.raises(CameraError, match="f must be positive and finite"):
        calibrate(TABLE_A2, paper_image(), f)


def test_one_f_a_frame_of_other_frames():
    with pytest.raises(HeadError, match=r"K for 3 frames, the image has 2"):
        calibrate(TABLE_A2, np.stack([paper_image()] * 2), [F, F, F])


def test_a_pixel_that_no_ray_reaches_is_not_seen():
    barrel = PinholeCamera(K=PIXELS.K, distortion=np.array([-0.3, 0, 0, 0, 0]))
    R, t = random_poses(np.random.default_rng(0), 1)
    image = view(barrel, R, t)
    image[0, 2] = [640, 5000]
    pose = solve_pose(TABLE_A2, image, barrel)
    assert pose.reasons == ("5 of 6 head points are known, at least 6 are needed; missing: right_eye",)


# What comes back ----------------------------------------------------------------------------------------


def test_results_are_read_only():
    pose = calibrate(TABLE_A2, paper_image())
    for array in (TABLE_A2.points, pose.R_cam_head, pose.points_cam, pose.f, dlt(TABLE_A2, paper_image()).P):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_head_points_cam(rng):
    R, t = random_poses(rng, 4)
    expected = [[R[k] @ point + t[k] for point in TABLE_A2.points] for k in range(4)]
    np.testing.assert_allclose(head_points_cam(R, t, TABLE_A2), expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(head_points_cam(R[0], t[0], TABLE_A2.points), expected[0], rtol=0, atol=1e-14)


@pytest.mark.filterwarnings("ignore::posekit.cameras.head.HeadWarning")
@pytest.mark.parametrize("size", [1e-300, 1e-8, 1.0, 1e4, 1e30, 1e150])
def test_any_image_points_give_a_pose_or_a_reason(size, rng):
    """No exception, no other warning, and what is found is finite."""
    image = size * rng.normal(size=(60, 6, 2))
    image[::7, 3] = np.nan
    poses = [
        calibrate(TABLE_A2, image),
        calibrate(TABLE_A2, image, F),
        solve_pose(TABLE_A2, image, DISTORTED),
    ]
    linear = dlt(TABLE_A2, image)
    assert linear.found.tolist() == [not reason for reason in linear.reasons]
    assert np.isfinite(linear.P[linear.found]).all()
    for pose in poses:
        assert pose.found.tolist() == [not reason for reason in pose.reasons]
        assert not pose.found[::7].any()
        assert np.isfinite(pose.f[pose.found]).all()
        assert np.isfinite(pose.points_cam[pose.found]).all()
        assert (pose.points_cam[pose.found][..., 2] > 0).all()
