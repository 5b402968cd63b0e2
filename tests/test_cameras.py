"""Laws of the three cameras, of views and of detections; OpenCV is the oracle of the lenses."""

import numpy as np
import pytest

from posekit.cameras import (
    LeeChenCamera,
    PinholeCamera,
    ScaledOrthographicCamera,
    View,
    camera_from_fov,
)
from posekit.cameras.lee_chen import (
    camera_position,
    points_to_paper,
    transformation_matrix,
)
from posekit.cameras.lens import distort, fold_radius, undistort
from posekit.errors import CameraError, InputError
from posekit.following.detections import Detections

K = np.array([[1000.0, 0.7, 640.0], [0.0, 1100.0, 360.0], [0.0, 0.0, 1.0]])
LENSES = {
    "none": ([], False),
    "four": ([-0.3, 0.1, 0.001, -0.002], False),
    "brown": ([-0.3, 0.1, 0.001, -0.002, 0.02], False),
    "rational": ([0.1, -0.2, 0.001, 0.002, 0.03, 0.05, -0.1, 0.02], False),
    "prism": ([0.1, -0.2, 0.001, 0.002, 0.03, 0.05, -0.1, 0.02, 0.01, 0.02, -0.01, 0.003], False),
    "tilted": (
        [0.1, -0.2, 0.001, 0.002, 0.03, 0.05, -0.1, 0.02, 0.01, 0.02, -0.01, 0.003, 0.02, -0.03],
        False,
    ),
    "fisheye without coefficients": ([], True),
    "fisheye": ([-0.02, 0.01, 0.003, -0.001], True),
}
CAMERAS = {
    **{name: PinholeCamera(K=K, distortion=d, fisheye=fisheye) for name, (d, fisheye) in LENSES.items()},
    "orthographic": ScaledOrthographicCamera(scale=120.0, aspect=1.25),
    "orthographic per frame": ScaledOrthographicCamera(scale=np.linspace(80, 120, 50)),
    "lee-chen": LeeChenCamera(f=0.05),
    "lee-chen per frame": LeeChenCamera(f=np.linspace(0.03, 0.06, 50)),
}
any_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)


def points(seed=0, shape=(50, 20)):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(*shape, 3)) * [1.0, 1.0, 0.5] + [0.0, 0.0, 4.0]


@any_camera
def test_a_ray_goes_through_its_point(camera):
    p = points()
    origin, direction = camera.rays(camera.project(p))
    along = np.einsum("...i,...i->...", p - origin, direction)
    np.testing.assert_allclose(origin + along[..., None] * direction, p, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=-1), 1.0)


@any_camera
def test_the_jacobian_is_the_difference_quotient(camera):
    p = points(1)
    n = camera.normalize(camera.project(p))
    for axis in range(2):
        ends = []
        for sign in (1, -1):
            moved = n + sign * 1e-6 * np.eye(2)[axis]
            lifted = np.concatenate([moved, np.ones_like(moved[..., :1])], axis=-1)
            ends.append(camera.project(lifted))
        np.testing.assert_allclose(
            camera.jacobian(n)[..., axis], (ends[0] - ends[1]) / 2e-6, rtol=1e-6, atol=1e-5
        )


@any_camera
def test_both_lifts_have_the_length_and_project_onto_the_point(camera):
    start, end = points(2), points(3)
    length = np.linalg.norm(end - start, axis=-1)
    image = camera.project(end)
    lift = camera.lift(start, camera.rays(image), length, tolerance=0.0)
    found = np.linalg.norm(lift.points - start[..., None, :], axis=-1)
    np.testing.assert_allclose(
        found[lift.valid], np.broadcast_to(length[..., None], found.shape)[lift.valid], atol=1e-9
    )
    assert lift.valid[..., :].any(axis=-1).all()
    gap = np.linalg.norm(lift.points - end[..., None, :], axis=-1)
    assert (np.where(lift.valid, gap, np.inf).min(axis=-1) < 1e-6).all()
    for side in range(2):
        seen = camera.project(lift.points[..., side, :])
        rows = lift.valid[..., side]
        np.testing.assert_allclose(seen[rows], image[rows], atol=1e-6)


@any_camera
def test_a_segment_that_is_too_short_has_no_end_and_a_tangent_one(camera):
    start, end = points(4, (50, 1))[:, 0], points(5, (50, 1))[:, 0]
    origin, direction = camera.rays(camera.project(end))
    offset = start - origin
    height = np.linalg.norm(offset - np.einsum("ni,ni->n", offset, direction)[:, None] * direction, axis=1)
    lift = camera.lift(start, camera.rays(camera.project(end)), height * 0.9, tolerance=0.0)
    assert not lift.valid.any()
    np.testing.assert_allclose(lift.excess, 0.1 * height, atol=1e-9)
    near = camera.lift(start, camera.rays(camera.project(end)), height, tolerance=1e-9)
    assert near.valid[:, 0].all()
    assert not near.valid[:, 1].any()


@any_camera
def test_frames_are_taken_with_their_camera(camera):
    p = points(6)
    rows = np.array([7, 3])
    np.testing.assert_array_equal(camera.take(rows).project(p[rows]), camera.project(p)[rows])


@pytest.mark.parametrize("name", LENSES)
def test_lenses_are_opencvs(name):
    cv2 = pytest.importorskip("cv2")
    d, fisheye = LENSES[name]
    straight = K * [[1, 0, 1], [1, 1, 1], [1, 1, 1]]
    p = points(8, (200,))
    project = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    seen = project(p[:, None], np.zeros(3), np.zeros(3), straight, np.array(d or [0.0] * 4))[0][:, 0]
    np.testing.assert_allclose(
        PinholeCamera(K=straight, distortion=d, fisheye=fisheye).project(p), seen, atol=1e-8
    )


def test_what_is_behind_or_beyond_the_fold_is_not_seen():
    camera = PinholeCamera(K=K, distortion=[-0.3, 0, 0, 0, 0])
    fold = fold_radius(camera.distortion)
    assert fold == pytest.approx(np.sqrt(1 / 0.9))
    beyond = np.array([[1.01 * fold, 0.0, 1.0], [0.99 * fold, 0.0, 1.0], [0.0, 0.0, -1.0]])
    assert np.isnan(camera.project(beyond)).any(axis=1).tolist() == [True, False, True]
    edge = distort(np.array([fold, 0.0]), camera.distortion)
    assert np.isnan(undistort(edge * 1.01, camera.distortion)).all()


def test_the_paper_camera_is_a_pinhole_with_another_frame():
    f, p = 0.05, points(9)
    q = points_to_paper(p, f)
    image = f * q[..., :2] / (q[..., 2:] + f) * [1, -1]  # Lee & Chen 1985, eqs. 1-6; y down
    np.testing.assert_allclose(LeeChenCamera(f=f).project(p), image, atol=1e-15)
    R, t = np.eye(3)[None], np.array([[0.1, 0.2, 3.0]])
    h = np.concatenate([p[0], np.ones((20, 1))], axis=1) @ transformation_matrix(R, t, f)[0]
    np.testing.assert_allclose(
        h[:, :2] / h[:, 2:] * [1, -1], LeeChenCamera(f=f).project(p[0] + t), atol=1e-15
    )
    np.testing.assert_allclose(camera_position(R, t, f), [0, 0, f] - t)


def test_guessed_cameras():
    camera = camera_from_fov((640, 480), 90, "horizontal")
    assert camera.K[0, 0] == pytest.approx(320)
    assert camera.guessed
    assert camera.fields()["deviation"] == camera.deviation
    assert camera.K[:2, 2] == pytest.approx([319.5, 239.5])  # the middle of pixels 0 to 639 and 0 to 479


def test_pose_and_fields():
    R = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    camera = PinholeCamera(K=K, R=R.round(4), t=[0.0, 1.0, 4.0], up="+z", size=[640, 480], name="left")
    np.testing.assert_allclose(R @ camera.position + camera.t, 0, atol=1e-12)
    fields = camera.fields("cm")
    assert fields["t"] == [0.0, 100.0, 400.0]
    assert (
        PinholeCamera(**{k: v for k, v in (fields | {"t": camera.t}).items() if k != "model"}).fields("cm")
        == fields
    )
    assert ScaledOrthographicCamera(scale=100.0).fields("cm") == {
        "model": "scaled-orthographic",
        "scale": 1.0,
    }
    assert LeeChenCamera(f=None).fields() == {"model": "lee-chen", "f": None}
    assert "array" not in repr(camera)
    with pytest.raises(ValueError, match="read-only"):
        camera.K[0, 0] = 1


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: PinholeCamera(K=np.eye(3) * -1), "K"),
        (lambda: PinholeCamera(K=[[1, 0, 0], [0, np.nan, 0], [0, 0, 1]]), "K"),
        (lambda: PinholeCamera(K=K.T), "upper triangular"),
        (lambda: PinholeCamera(K=K, distortion=[0.1, 0.2, 0.3]), "3 coefficients"),
        (lambda: PinholeCamera(K=K, distortion=[0.1] * 5, fisheye=True), "fisheye"),
        (lambda: PinholeCamera(K=K, R=np.diag([1, 1, -1])), "mirror"),
        (lambda: PinholeCamera(K=K, R=2 * np.eye(3)), "rotation"),
        (lambda: PinholeCamera(K=K, t=[0, 0]), "t"),
        (lambda: PinholeCamera(K=K, size=(640, 0)), "size"),
        (lambda: PinholeCamera(K=K, up="z"), "up"),
        (lambda: PinholeCamera(K=K, deviation=np.nan), "deviation"),
        (lambda: ScaledOrthographicCamera(scale=-1.0), "scale"),
        (lambda: ScaledOrthographicCamera(scale=1.0, aspect=np.inf), "aspect"),
        (lambda: ScaledOrthographicCamera(scale=None).project(np.ones((1, 3))), "scale"),
        (lambda: LeeChenCamera(f=0.0), "f"),
        (lambda: camera_from_fov((640, 480), 180), "fov"),
    ],
)
def test_impossible_cameras_are_refused_in_one_line(make, says):
    with pytest.raises(CameraError, match=says) as raised:
        make()
    assert "\n" not in str(raised.value)
    assert "; expected " in str(raised.value)


def view(**fields):
    given = {"camera": PinholeCamera(K=K), "time": [0.0, 0.5, 1.0], "image": np.ones((3, 14, 2))}
    return View(**(given | fields))


def test_a_view_fills_what_is_unknown_and_takes_frames():
    one = view(pictures=("a", "b", "c"), head_points={"chin": [0.1, 0, 0]}, own_head_image=np.ones((3, 1, 2)))
    assert np.isnan(one.root).all()
    assert one.truth.shape == (3, 14, 3)
    assert one.own_head_names == ("chin",)
    part = one.take([2, 0])
    assert (part.time.tolist(), part.pictures, len(part)) == ([1.0, 0.0], ("c", "a"), 2)
    assert "3 frames" in repr(one)
    assert "1 frame," in repr(one.take(slice(1)))


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"time": []}, "no frame"),
        ({"image": np.ones((3, 13, 2))}, r"image: got shape \(3, 13, 2\)"),
        ({"image": np.full((3, 14, 2), np.nan)}, "a joint in at least one frame"),
        ({"image": np.where(np.eye(2)[0], np.nan, np.ones((3, 14, 2)))}, "image"),
        ({"root": np.full((3, 3), np.inf)}, "root"),
        ({"confidence": -np.ones((3, 19))}, "confidence"),
        ({"lengths": {"neck-knee": 1.0}}, "neck-knee"),
        ({"lengths": {"neck-pelvis": 0.0}}, "positive length"),
        ({"length_deviation": 0.5}, "length_deviation"),
        ({"stature": -1.0}, "stature"),
        ({"derived": ("nose",)}, "derived"),
        ({"head_points": {"left_knee": [0, 0, 0]}}, "head_points"),
        ({"pictures": ("a",)}, "pictures"),
    ],
)
def test_impossible_views_are_refused(fields, says):
    with pytest.raises(InputError, match=says):
        view(**fields)


NAMES = ("nose", "neck", "pelvis", "right_shoulder", "left_shoulder", "right_hip", "left_hip", "left_knee")


def crowd(pictures=20, seed=0):
    """Three people who walk past each other, in random order in each picture."""
    rng = np.random.default_rng(seed)
    shape = rng.uniform(0, 200, (3, len(NAMES), 2))
    rows = [(k, who) for k in range(pictures) for who in rng.permutation(3)]
    seen = [
        shape[who] + [400 * who + 5 * k * (who - 1), 0] + rng.normal(0, 1, shape[who].shape)
        for k, who in rows
    ]
    return np.array(seen), *np.array(rows).T


def test_people_are_followed_through_a_film():
    seen, frame, who = crowd()
    detections = Detections(
        points=seen, names=NAMES, frame=frame, confidence=0.5 + 0.1 * np.tile(who[:, None], (1, 8))
    )
    rows = detections.person_rows("surest")
    assert set(who[rows]) == {2}
    assert frame[rows].tolist() == list(range(20))
    one = detections.view(PinholeCamera(K=K), person="surest", stature=1.8, rate=10.0)
    np.testing.assert_array_equal(one.image[:, 0], seen[rows, 1])
    np.testing.assert_array_equal(one.head_image[:, 0], seen[rows, 0])
    assert (one.stature, one.time[1]) == (1.8, 0.1)
    assert np.isnan(one.image[:, 6]).all()


def test_pictures_without_the_person_keep_their_place():
    seen, frame, who = crowd()
    kept = (who == 1) & (frame != 4)
    person = np.zeros(kept.sum(), dtype=int)
    one = Detections(points=seen[kept], names=NAMES, frame=frame[kept], person=person).view(person=0, rate=30)
    assert len(one) == 20
    assert np.isnan(one.image[4]).all()
    assert np.isfinite(one.image[5, 0]).all()


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"frame": [1, 0]}, "frame"),
        ({"names": ("nose", "toe")}, "toe"),
        ({"points": np.full((2, 2, 2), np.inf)}, "two numbers"),
        ({"points": np.ones((2, 3, 2))}, "points"),
        ({"pictures": ("a",)}, "pictures"),
    ],
)
def test_impossible_detections_are_refused(fields, says):
    given = {"points": np.ones((2, 2, 2)), "names": ("nose", "neck"), "frame": [0, 1]}
    with pytest.raises(InputError, match=says):
        Detections(**(given | fields))


@pytest.mark.parametrize("name", [name for name, (d, _) in LENSES.items() if d])
def test_lenses_are_undone_up_to_the_fold(name):
    coefficients, fisheye = LENSES[name]
    d = np.array(coefficients)
    turn = np.linspace(0, 2 * np.pi, 24)
    far = min(0.9 * fold_radius(d, fisheye=fisheye), 1.2)
    straight = far * np.stack([np.cos(turn), np.sin(turn)], axis=-1) * np.linspace(0.1, 1, 24)[:, None]
    back = undistort(distort(straight, d, fisheye=fisheye), d, fisheye=fisheye)
    np.testing.assert_allclose(back, straight, atol=1e-12)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("fisheye", [False, True])
def test_the_fold_is_where_the_image_first_stops_growing(fisheye, seed):
    rng = np.random.default_rng(seed)
    d = rng.uniform(-0.3, 0.3, 4) if fisheye else np.zeros(8)
    if not fisheye:
        d[[0, 1, 4, 5, 6, 7]] = rng.uniform(-0.4, 0.4, 6)
    # The argument is r, or the angle of a fisheye lens.
    argument = np.linspace(1e-4, 1.5 if fisheye else 4.0, 40_000)
    radius = np.tan(argument) if fisheye else argument
    place = distort(np.stack([radius, 0 * radius], axis=-1), d, fisheye=fisheye)[:, 0]
    falls = np.flatnonzero((np.diff(place) <= 0) | (place[1:] < 0))
    fold = fold_radius(d, fisheye=fisheye)
    if falls.size:
        assert fold == pytest.approx(argument[falls[0]], abs=2e-3)
    else:
        assert fold > argument[-1] - 2e-3


@pytest.mark.parametrize("aside", [0.0, 3.0, 200.0, 1e4])
@pytest.mark.parametrize("camera", [CAMERAS["orthographic"], ScaledOrthographicCamera(scale=3.7)])
def test_a_segment_along_the_image_has_one_end_wherever_it_lies(camera, aside):
    rng = np.random.default_rng(5)
    turn, length = rng.uniform(0, 2 * np.pi, 200), rng.uniform(0.1, 0.5, 200)
    start = np.column_stack(
        [aside + rng.uniform(size=200), -aside + rng.uniform(size=200), np.full(200, 2.0)]
    )
    end = start + length[:, None] * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(200)])
    lift = camera.lift(start, camera.rays(camera.project(end)), length, tolerance=0.0)
    assert lift.valid.tolist() == [[True, False]] * 200
    np.testing.assert_allclose(lift.points[:, 0], end, atol=1e-9 * (1 + aside))
