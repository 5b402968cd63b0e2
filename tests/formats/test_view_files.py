"""Views: what is written is read back, and what is wrong is said in one line."""

import copy
import json
import pickle
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.cameras.lee_chen import pinhole, points_from_paper
from posekit.errors import CameraError, InputError
from posekit.formats.own import (
    LeeChenModel,
    OpenCVModel,
    ScaledOrthographicModel,
    View,
    read_view,
    write_view,
)
from posekit.skeleton import HEAD_POINTS, JOINTS, SEGMENT_NAMES

ARRAYS = ("time", "image", "head_image", "root", "truth")
K = np.array([[800.0, 0.5, 320.0], [0.0, 810.0, 240.0], [0.0, 0.0, 1.0]])
R = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
CAMERAS = {
    "lee-chen": LeeChenModel(f=0.05),
    "lee-chen without f": LeeChenModel(f=None),
    "opencv": OpenCVModel(
        K=K, distortion=np.arange(5) / 100, R=R, t=np.array([0.1, 0.2, 4.0]), size=(640, 480)
    ),
    "opencv with K alone": OpenCVModel(K=K),
    "opencv that knows up": OpenCVModel(K=K, R=R, t=np.zeros(3), up="-y"),
    "orthographic": ScaledOrthographicModel(scale=123.4),
    "orthographic without scale": ScaledOrthographicModel(scale=None),
}


def a_view(rng, camera, frames=4) -> View:
    image = rng.normal(size=(frames, 14, 2))
    image[:, 1:][rng.random((frames, 13)) < 0.2] = np.nan
    head_image, truth, root = (
        rng.normal(size=(frames, 5, 2)),
        rng.normal(size=(frames, 14, 3)),
        rng.normal(size=(frames, 3)),
    )
    head_image[0] = truth[1] = root[2] = np.nan
    image[1, 0] = image[3] = np.nan  # a frame may lack the neck, or show nothing at all
    head_image[1, 2] = truth[2, 3] = np.nan
    return View(
        camera=camera,
        time=np.arange(frames) * 0.2,
        image=image,
        head_image=head_image,
        root=root,
        truth=truth,
        lengths={"neck-pelvis": 0.502, "right_hip-right_knee": 0.4},
        stature=1.75,
        head_points={"neck": np.zeros(3), "nose": np.array([0.1, 0.2, 0.0])},
    )


def assert_same_camera(one, other, rtol):
    assert type(one) is type(other)
    for name, value in vars(one).items():
        if value is None or isinstance(value, str):
            assert getattr(other, name) == value
        else:
            np.testing.assert_allclose(getattr(other, name), value, rtol=rtol)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_a_view_is_read_back(tmp_path, rng, camera, unit):
    view = a_view(rng, camera)
    write_view(tmp_path / "view.json", view, unit)
    back = read_view(tmp_path / "view.json")
    rtol = 0.0 if unit == "m" else 3e-16
    for name in ARRAYS:
        np.testing.assert_allclose(getattr(back, name), getattr(view, name), rtol=rtol, err_msg=name)
        assert not getattr(back, name).flags.writeable
    assert back.lengths == pytest.approx(view.lengths, rel=rtol)
    assert back.stature == pytest.approx(view.stature, rel=rtol)
    assert view.head_points is not None
    assert back.head_points is not None
    for name, point in view.head_points.items():
        np.testing.assert_allclose(back.head_points[name], point, rtol=rtol)
    assert_same_camera(view.camera, back.camera, rtol)


@given(st.lists(st.floats(-1e300, 1e300), min_size=2, max_size=2))
def test_any_float_survives_in_metres(tmp_path_factory, point):
    path = tmp_path_factory.mktemp("views") / "view.json"
    image = np.full((1, 14, 2), np.nan)
    image[0, 0] = point
    write_view(path, View(camera=LeeChenModel(f=1e-3), time=np.zeros(1), image=image))
    assert np.array_equal(read_view(path).image[0, 0], image[0, 0])


def test_least_view_has_nothing_else(tmp_path):
    image = np.full((2, 14, 2), np.nan)
    image[:, 0] = 1.0
    view = View(camera=LeeChenModel(f=None), time=np.arange(2.0), image=image)
    assert np.isnan(view.head_image).all()
    assert view.truth.shape == (2, 14, 3)
    write_view(tmp_path / "view.json", view)
    document = json.loads((tmp_path / "view.json").read_text())
    assert set(document) == {"schema", "unit", "camera", "frames"}
    assert document["frames"][0] == {"time": 0.0, "image": {"neck": [1.0, -1.0]}}
    back = read_view(tmp_path / "view.json")
    assert (back.lengths, back.stature, back.head_points, len(back)) == ({}, None, None, 2)


def test_the_papers_image_plane_is_turned_over_once(tmp_path):
    """Lee & Chen 1985, eq. (5): x' = f x / (z + f), y up, here in centimetres."""
    f, point = 5.0, np.array([30.0, 40.0, 400.0])
    image = f * point[:2] / (point[2] + f)
    document = copy.deepcopy(GOOD)
    document["frames"] = [{"time": 0, "image": {"neck": image.tolist()}}]
    (tmp_path / "view.json").write_text(json.dumps(document))
    view = read_view(tmp_path / "view.json")
    expected = pinhole(0.05).project(points_from_paper(point / 100, 0.05)[None])
    np.testing.assert_allclose(view.image[0, 0], expected[0], rtol=1e-15)
    assert view.image[0, 0, 1] < 0
    write_view(tmp_path / "again.json", view, "cm")
    again = json.loads((tmp_path / "again.json").read_text())
    np.testing.assert_allclose(again["frames"][0]["image"]["neck"], image, rtol=3e-16)
    assert again["camera"] == {"model": "lee-chen", "f": 5.0}


def test_pixels_stay_pixels_and_lengths_do_not(tmp_path):
    document = copy.deepcopy(GOOD)
    document["unit"] = "mm"
    document["camera"] = {"model": "opencv", "K": K.tolist(), "t": [0, 0, 4000]}
    document["frames"][0] |= {"root": [1, 2, 3000], "truth": {"pelvis": [0, 500, 3000]}}
    (tmp_path / "view.json").write_text(json.dumps(document))
    view = read_view(tmp_path / "view.json")
    assert isinstance(view.camera, OpenCVModel)
    assert view.image[0, 0].tolist() == [0.1, 0.2]
    assert view.camera.t is not None
    assert view.camera.t.tolist() == [0, 0, 4]
    assert view.root[0].tolist() == [0.001, 0.002, 3.0]
    assert view.truth[0, JOINTS.index("pelvis")].tolist() == [0, 0.5, 3.0]


def test_a_scale_is_in_pixels_a_unit(tmp_path):
    document = copy.deepcopy(GOOD)
    document["camera"] = {"model": "scaled-orthographic", "scale": 2.5}
    (tmp_path / "view.json").write_text(json.dumps(document))
    camera = read_view(tmp_path / "view.json").camera
    assert isinstance(camera, ScaledOrthographicModel)
    assert camera.scale == 250.0


def test_a_view_travels_to_another_process(rng):
    view = a_view(rng, CAMERAS["opencv"])
    back = pickle.loads(pickle.dumps(view))
    assert np.array_equal(back.image, view.image, equal_nan=True)


def test_the_boundary_needs_no_pinocchio():
    code = "import sys, posekit.formats.own; sys.exit('pinocchio' in sys.modules or 'coal' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


GOOD: dict[str, Any] = {
    "schema": "posekit.view/1",
    "unit": "cm",
    "camera": {"model": "lee-chen", "f": 5.0},
    "figure": {"lengths": {"neck-pelvis": 50.2}, "stature": 175, "head_points": {"nose": [1, 2, 3]}},
    "frames": [{"time": 0.2 * i, "image": {"neck": [0.1, 0.2], "left_elbow": [1, 2]}} for i in range(4)],
}
OPENCV = {"model": "opencv", "K": K.tolist()}


def put(document, path, value):
    *parents, last = path
    for part in parents:
        document = document[part]
    if value is ...:
        del document[last]
    else:
        document[last] = value


FRAME, IMAGE = ("frames", 3), ("frames", 3, "image")
BAD = [
    (("camera", "f"), 0, "camera.f: got 0; expected a number greater than 0"),
    (("camera", "f"), -5.0, "camera.f: got -5.0; expected a number greater than 0"),
    (("camera", "f"), "5", 'camera.f: got "5"; expected a number'),
    (("camera", "f"), True, "camera.f: got true; expected a number"),
    (("camera", "f"), ..., "camera.f: got nothing; expected this field"),
    (("camera", "model"), "leechen", "camera.model: got \"leechen\"; expected one of 'lee-chen'"),
    (("camera", "model"), ..., "camera.model: got nothing"),
    (("camera", "focal"), 5, "camera.focal: got 5; expected no field of this name"),
    (("camera",), None, "camera: got null; expected an object"),
    (("camera",), ..., "camera: got nothing; expected this field; add it"),
    (
        ("camera",),
        {"model": "scaled-orthographic", "scale": 0},
        "camera.scale: got 0; expected a number greater",
    ),
    (("camera",), OPENCV | {"K": [[0, 0, 0], [0, 1, 0], [0, 0, 1]]}, "focal lengths must be positive"),
    (("camera",), OPENCV | {"K": [[1, 0, 0], [0, -1, 0], [0, 0, 1]]}, "focal lengths must be positive"),
    (("camera",), OPENCV | {"K": [[1, 0, 0], [0, 1, 0], [0, 0, 2]]}, "camera.K: got a list of 3 entries"),
    (
        ("camera",),
        OPENCV | {"K": [[1, 0, 0], [0, 1, 0], [0, 0]]},
        "camera.K[2]: got [0, 0]; expected at least 3",
    ),
    (("camera",), OPENCV | {"R": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, "its determinant is -1, so it mirrors"),
    (("camera",), OPENCV | {"R": [[1, 0, 0], [0, 1, 0], [0, 0.01, 1]]}, "R R^T is off the identity by 0.01"),
    (("camera",), OPENCV | {"R": [[1e200, 0, 0], [0, 1, 0], [0, 0, 1]]}, "R R^T is off the identity by inf"),
    (
        ("camera",),
        OPENCV | {"distortion": [0, 0, 0, 0]},
        "camera.distortion: got [0, 0, 0, 0]; expected at least 5",
    ),
    (("camera",), OPENCV | {"size": [0, 480]}, "camera.size[0]: got 0"),
    (("camera",), OPENCV | {"size": [640.5, 480]}, "camera.size[0]: got 640.5; expected a whole number"),
    (
        ("camera",),
        {"model": "scaled-orthographic", "scale": 1e308},
        "camera: got scale must be from 1e-09 to 1e+09",
    ),
    (("unit",), "inch", "unit: got \"inch\"; expected 'm', 'cm' or 'mm'"),
    (("unit",), ..., "unit: got nothing"),
    (("schema",), ..., 'schema: got nothing; expected "posekit.view/1"; add "schema"'),
    (("schema",), "posekit.view/2", "the file is of another version"),
    (("schema",), "posekit.result/1", "give a file of schema posekit.view/1 instead"),
    (("schema",), ["x"], 'schema: got ["x"]'),
    (("frame",), [], "frame: got []; expected no field of this name; did you mean frames?"),
    (("frames",), [], "frames: got []; expected at least 1 entries; a view has at least one frame"),
    (("frames",), {}, "frames: got an object of 0 entries (); expected a list"),
    (("frames", 1), 7, "frames[1]: got 7; expected an object"),
    ((*FRAME, "time"), ..., "frames[3].time: got nothing; expected this field; give it in seconds"),
    ((*FRAME, "time"), "now", 'frames[3].time: got "now"; expected a number'),
    ((*FRAME, "image"), ..., "frames[3].image: got nothing"),
    (
        ("frames",),
        [{"time": 0.0, "image": {"left_elbow": [1, 2]}}] * 2,
        "frames[0].image.neck: got nothing, in none of 2 frames; expected the neck in one frame at least",
    ),
    (
        (*IMAGE, "lef_elbow"),
        [1, 2],
        'frames[3].image.lef_elbow: got "lef_elbow"; expected the name of a joint; did you mean left_elbow',
    ),
    (
        (*IMAGE, "nose"),
        [1, 2],
        'frames[3].image.nose: got "nose"; expected the name of a joint; valid names are neck,',
    ),
    (
        (*IMAGE, "left_elbow"),
        [1],
        "frames[3].image.left_elbow: got [1]; expected at least 2 entries; an image point is [u, v]",
    ),
    (
        (*IMAGE, "left_elbow"),
        [1, 2, 3],
        "frames[3].image.left_elbow: got [1, 2, 3]; expected at most 2 entries",
    ),
    ((*IMAGE, "left_elbow"), [1, "2"], 'frames[3].image.left_elbow[1]: got "2"; expected a number'),
    ((*IMAGE, "left_elbow"), [1, None], "frames[3].image.left_elbow[1]: got null; expected a number"),
    ((*IMAGE, "left_elbow"), None, "frames[3].image.left_elbow: got null; expected a list"),
    (
        (*IMAGE, "left_elbow"),
        [1, float("nan")],
        "frames[3].image.left_elbow[1]: got NaN; expected a finite number",
    ),
    (
        (*IMAGE, "left_elbow"),
        [float("-inf"), 1],
        "frames[3].image.left_elbow[0]: got -Infinity; expected a finite number",
    ),
    (
        (*FRAME, "head_image"),
        {"noze": [1, 2]},
        'frames[3].head_image.noze: got "noze"; expected the name of a head point; did you mean nose?',
    ),
    ((*FRAME, "root"), [1, 2], "frames[3].root: got [1, 2]; expected at least 3 entries"),
    (
        (*FRAME, "truth"),
        {"neck": [1, 2, 3, 4]},
        "frames[3].truth.neck: got [1, 2, 3, 4]; expected at most 3 entries",
    ),
    (
        (*FRAME, "truth"),
        {"head": [1, 2, 3]},
        'frames[3].truth.head: got "head"; expected the name of a joint',
    ),
    (
        ("figure", "lengths", "neck-pelvis"),
        0,
        "figure.lengths.neck-pelvis: got 0; expected a number greater than 0",
    ),
    (("figure", "lengths", "neck-pelvis"), -50.2, "figure.lengths.neck-pelvis: got -50.2"),
    (("figure", "lengths", "pelvis-neck"), 5, "expected the name of a segment; did you mean neck-pelvis?"),
    (("figure", "lengths", "right_hip-knee"), 5, "did you mean right_hip-right_knee"),
    (("figure", "stature"), 0, "figure.stature: got 0; expected a number greater than 0"),
    (("figure", "head_points"), {"left_hip": [1, 2, 3]}, 'figure.head_points.left_hip: got "left_hip"'),
    (
        ("figure", "head_points"),
        {"noze": [1, 2, 3]},
        'figure.head_points.noze: got "noze"; expected the name of a head',
    ),
    (
        ("figure", "head_points"),
        {"c" * 61: [1, 2, 3]},
        "expected the name of a head point; give a name of up to 60",
    ),
    (
        ("figure", "head_points"),
        {"\x07": [1, 2, 3]},
        "expected the name of a head point; give a name of up to 60",
    ),
    (("figure", "head_points"), {"nose": [1, 2]}, "figure.head_points.nose: got [1, 2]"),
    (("figure", "height"), 5, "figure.height: got 5; expected no field of this name"),
]


@pytest.mark.parametrize(("place", "value", "text"), BAD, ids=[f"{i}-{b[0][-1]}" for i, b in enumerate(BAD)])
def test_what_breaks_the_schema_is_one_clear_line(tmp_path, place, value, text):
    document = copy.deepcopy(GOOD)
    put(document, place, value)
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(document))
    with pytest.raises(InputError) as caught:
        read_view(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert text in message
    assert message.isprintable()
    assert "more error" not in message


@pytest.mark.parametrize("document", [[], 1, "x", None])
def test_what_is_no_object_is_refused(tmp_path, document):
    (tmp_path / "bad.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"expected an object of schema posekit\.view/1"):
        read_view(tmp_path / "bad.json")


def test_further_errors_are_counted(tmp_path):
    document = copy.deepcopy(GOOD)
    put(document, ("camera", "f"), -1)
    put(document, ("figure", "stature"), -1)
    put(document, ("unit",), "inch")
    (tmp_path / "bad.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"unit: .*\(and 2 more errors at least\)$"):
        read_view(tmp_path / "bad.json")


def test_a_flood_of_errors_costs_little(tmp_path):
    for flood in (
        {"frames": GOOD["frames"] + [0] * 300_000},
        {f"field{i}": 0 for i in range(100_000)},
        {"frames": [{"time": 0, "image": {f"joint{i}": [] for i in range(100_000)}}]},
        {"frames": [{"time": 0, "image": {"neck": [None] * 300_000}}]},
    ):
        (tmp_path / "bad.json").write_text(json.dumps(GOOD | flood))
        with pytest.raises(InputError) as caught:
            read_view(tmp_path / "bad.json")
        assert len(str(caught.value)) < 400 + len(str(tmp_path))


def view_with(**changes) -> View:
    fields: dict[str, Any] = {
        "camera": LeeChenModel(f=0.05),
        "time": np.zeros(2),
        "image": np.zeros((2, 14, 2)),
    }
    return View(**(fields | changes))


half_known = np.full((2, 14, 3), np.nan)
half_known[1, 3, 0] = 1.0


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"time": np.zeros(0)}, "time: got no frame"),
        ({"time": np.array([0, np.nan])}, "time: got NaN"),
        ({"time": np.array([0, np.inf])}, r"time\[1\]: got Infinity"),
        ({"image": np.zeros((3, 14, 2))}, r"image: got shape \(3, 14, 2\); expected \(2, 14, 2\)"),
        ({"image": np.full((2, 14, 2), np.nan)}, r"image\[:, 0\]: got NaN; expected the neck in one frame"),
        ({"root": np.full((2, 3), np.inf)}, r"root\[0, 0\]: got Infinity"),
        (
            {"truth": half_known},
            r"truth\[1, 3, 1\]: got NaN; expected finite points, or NaN in all of a point",
        ),
        ({"lengths": {"neck-pelvi": 1.0}}, "did you mean neck-pelvis"),
        ({"lengths": {"neck-pelvis": 0.0}}, "lengths.neck-pelvis: got 0.0; expected a positive length"),
        ({"lengths": {"neck-pelvis": np.nan}}, "lengths.neck-pelvis: got NaN"),
        ({"stature": -1.0}, "stature: got -1.0"),
        ({"head_points": {"left_hip": np.zeros(3)}}, 'head_points: got "left_hip"'),
        (
            {"head_points": {"chin": np.zeros(3)}, "own_head_image": np.zeros((2, 2, 2))},
            "own_head_image: got shape",
        ),
        ({"head_points": {"nose": np.zeros(2)}}, "head_points.nose: got"),
    ],
)
def test_a_view_that_cannot_be_is_refused_in_memory_too(changes, text):
    with pytest.raises(InputError, match=text):
        view_with(**changes)


@pytest.mark.parametrize(
    "make",
    [
        lambda: LeeChenModel(f=0.0),
        lambda: LeeChenModel(f=np.nan),
        lambda: ScaledOrthographicModel(scale=np.inf),
        lambda: OpenCVModel(K=np.eye(2)),
        lambda: OpenCVModel(K=np.ones((2, 3, 3)) * np.eye(3)),
        lambda: OpenCVModel(K=K, R=2 * np.eye(3)),
        lambda: OpenCVModel(K=K, R=np.eye(2)),
        lambda: OpenCVModel(K=K, t=np.array([np.nan, 0, 0])),
        lambda: OpenCVModel(K=K, size=(0, 1)),
        lambda: OpenCVModel(K=K, distortion=np.zeros(4)),
    ],
)
def test_a_camera_that_cannot_be_is_refused(make):
    with pytest.raises(CameraError):
        make()


def test_every_name_of_the_skeleton_is_accepted(tmp_path):
    document = copy.deepcopy(GOOD)
    document["figure"] = {
        "lengths": dict.fromkeys(SEGMENT_NAMES, 10.0),
        "head_points": {name: [1, 2, 3] for name in ("neck", *HEAD_POINTS)},
    }
    document["frames"] = [
        {
            "time": 0,
            "image": {name: [1, 2] for name in reversed(JOINTS)},
            "head_image": {name: [1, 2] for name in HEAD_POINTS},
            "truth": {name: [1, 2, 3] for name in JOINTS},
        }
    ]
    (tmp_path / "view.json").write_text(json.dumps(document))
    view = read_view(tmp_path / "view.json")
    assert not np.isnan(view.image).any()
    assert set(view.lengths.values()) == {0.1}


def test_thousands_of_frames_are_read_in_seconds(tmp_path, rng):
    view = a_view(rng, CAMERAS["opencv"], frames=3000)
    write_view(tmp_path / "view.json", view)
    assert len(read_view(tmp_path / "view.json")) == 3000


def test_a_view_that_cannot_be_written_leaves_nothing(tmp_path, rng):
    view = a_view(rng, CAMERAS["opencv"])
    with pytest.raises(InputError, match="a directory that does not exist"):
        write_view(tmp_path / "no" / "view.json", view)
    assert not list(tmp_path.iterdir())
