"""Fields of the schemas: hints name fields, bounds are kept at and refused beyond, cameras are cameras."""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.errors import CameraError, InputError
from posekit.formats import own
from posekit.formats.own import schema
from posekit.formats.own.camera_model import (
    LeeChenModel,
    OpenCVModel,
    ScaledOrthographicModel,
    camera_fields,
    check_intrinsics,
    check_rotation,
)
from posekit.formats.own.live_schema import LiveFrame, LiveHeader, live_frame, live_header
from posekit.formats.own.object_result_schema import ObjectFile
from posekit.formats.own.object_view_schema import ObjectFrameFields, ObjectViewFile
from posekit.formats.own.postures_q_schema import ConfigurationsFile
from posekit.formats.own.postures_schema import PosturesFile
from posekit.formats.own.result_schema import ResultFile
from posekit.formats.own.view_schema import ViewFile, is_head_name
from posekit.skeleton import POINTS
from posekit.tables.file_model import FileModel, validated

HINTED = [
    ViewFile,
    PosturesFile,
    ConfigurationsFile,
    ObjectFile,
    ObjectViewFile,
    ResultFile,
    LiveHeader,
    LiveFrame,
]
K = [[1000.0, 0.0, 320.0], [0.0, 1000.0, 240.0], [0.0, 0.0, 1.0]]


def properties(document: Any) -> Iterator[str]:
    if isinstance(document, dict):
        yield from document.get("properties", {})
        yield from (name for value in document.values() for name in properties(value))
    elif isinstance(document, list):
        yield from (name for value in document for name in properties(value))


def texts(document: Any) -> Iterator[str]:
    if isinstance(document, dict):
        yield from (text for value in document.values() for text in texts(value))
    elif isinstance(document, list):
        yield from (text for value in document for text in texts(value))
    elif isinstance(document, str):
        yield document


@pytest.mark.parametrize("model", HINTED)
def test_every_hint_is_that_of_a_field_and_every_tag_one_of_a_variant(model: type[FileModel]) -> None:
    document = model.model_json_schema()
    assert set(model.hints) <= set(properties(document)), set(model.hints) - set(properties(document))
    named = {tag for tag in model.tags if " " not in tag}
    assert named <= set(texts(document))
    assert model.hints


@pytest.mark.parametrize("model", [ObjectFrameFields, ObjectViewFile, LiveHeader, LiveFrame])
def test_every_field_of_what_is_not_published_says_what_it_is(model: type[FileModel]) -> None:
    for name, field in model.model_json_schema()["properties"].items():
        assert {"description", "const", "$ref"} & set(field), name


def line(**changes: Any) -> dict[str, Any]:
    return {"time": 0.0, "points": [[1.0, 2.0]], **changes}


LIVE_FRAMES: list[tuple[dict[str, Any], str]] = [
    ({}, ""),
    ({"points": {"neck": [1.0, 2.0]}}, ""),
    ({"points": {"neck": None}, "root": [0.0, 0.0, 3.0]}, ""),
    ({"points": [[1.0, 2.0, 0.5], None]}, ""),
    ({"points": [[1.0, None]]}, ""),
    ({"points": [None] * 1000}, ""),
    ({"points": [None] * 1001}, "at most 1000 entries"),
    ({"points": [[1.0]]}, "at least 2 entries; a point is [x, y] or [x, y, confidence]"),
    ({"points": {"neck": [1.0, 2.0, 3.0, 4.0]}}, "at most 3 entries"),
    ({"points": {"neck": 1.0}}, "points.neck"),
    ({"root": [0.0, 0.0]}, "root: got [0.0, 0.0]; expected at least 3 entries; the root is [x, y, z]"),
    ({"time": "now"}, "expected a number; give it in seconds"),
    ({"frame": 1}, "frame"),
]


@pytest.mark.parametrize(("changes", "words"), LIVE_FRAMES)
def test_a_picture_of_a_stream(changes: dict[str, Any], words: str) -> None:
    if not words:
        found = live_frame(line(**changes), "line 2")
        assert found.points == line(**changes)["points"] and found.root == changes.get("root")
        return
    with pytest.raises(InputError) as caught:
        live_frame(line(**changes), "line 2")
    assert words in str(caught.value) and "line 2" in str(caught.value)


CAMERA = {"model": "opencv", "K": K}
LIVE_HEADERS: list[tuple[dict[str, Any], str]] = [
    ({}, ""),
    ({"camera": CAMERA, "size": [1, 10**6], "stature": 1.7, "deviation": 0.1, "layout": "coco_17"}, ""),
    ({"lengths": {"neck-pelvis": 0.5}}, ""),
    ({"size": [0, 480]}, "size is [width, height] in whole pixels"),
    ({"size": [640, 10**6 + 1]}, "a number of at most 1e+06; size is"),
    ({"size": [640]}, "at least 2 entries; size is"),
    ({"size": [640, 480, 3]}, "at most 2 entries; size is"),
    ({"stature": 0.0}, "a number greater than 0; give it in metres"),
    ({"deviation": 0.0}, "a number greater than 0; give it in pixels, or leave it out"),
    ({"lengths": {"neck-pelvis": 0.0}}, "a length is in metres, named a-b"),
    ({"lengths": {"neck-knee": 0.5}}, "the name of a segment"),
    ({"layout": 17}, "name a skeleton map, as coco_17 or mediapipe_33, or leave it out"),
    ({"camera": {**CAMERA, "K": K[:2]}}, "camera.K: got"),
    ({"camera": {**CAMERA, "model": "lee-chen"}}, "a camera is {"),
]


@pytest.mark.parametrize(("changes", "words"), LIVE_HEADERS)
def test_a_header_of_a_stream(changes: dict[str, Any], words: str) -> None:
    if not words:
        found = live_header(changes, "line 1")
        for name in LiveHeader.model_fields:
            if name != "camera":
                assert getattr(found, name) == changes.get(name)
        assert (found.camera is None) == ("camera" not in changes)
        return
    with pytest.raises(InputError) as caught:
        live_header(changes, "line 1")
    assert words in str(caught.value)


def object_view(**changes: Any) -> dict[str, Any]:
    camera = {"model": "scaled-orthographic", "scale": None}
    frames = [{"time": 0.0, "image": {"tip": [1.0, 2.0]}}]
    return {"schema": "posekit.view/1", "camera": camera, "frames": frames, **changes}


@pytest.mark.parametrize(("changes", "words"), [
    ({}, ""),
    ({"unit": "cm"}, ""),
    ({"frames": [{"time": 0.0, "image": {}, "truth": {"tip": [0.0, 0.0, 1.0]}}]}, ""),
    ({"unit": "ell"}, "write m, cm or mm"),
    ({"frames": []}, "a view has at least one frame"),
    ({"frames": [{"time": 0.0, "image": {"tip": [1.0]}}]}, "an image point is [u, v]; leave out a point"),
    ({"frames": [{"time": 0.0, "image": {}, "truth": {"tip": [1.0, 2.0]}}]}, "a point is [x, y, z]; leave out"),
    ({"frames": [{"time": None, "image": {}}]}, "give it in seconds"),
    ({"camera": {"model": "opencv", "scale": None}}, "another object than a person is recovered from uncalibrated"),
    ({"camera": {"model": "scaled-orthographic", "scale": 0.0}}, "give it in pixels a unit"),
    ({"camera": {"model": "scaled-orthographic", "scale": 1.0, "aspect": 0.0}}, "camera.aspect"),
])  # fmt: skip
def test_a_view_of_an_object(changes: dict[str, Any], words: str) -> None:
    if not words:
        found = validated(ObjectViewFile, object_view(**changes), "view.json")
        assert found.unit == changes.get("unit") and found.camera.aspect == 1.0
        return
    with pytest.raises(InputError) as caught:
        validated(ObjectViewFile, object_view(**changes), "view.json")
    assert words in str(caught.value)


# --- views of people ------------------------------------------------------------------------------------


def view(frames: list[dict[str, Any]] | None = None, **changes: Any) -> dict[str, Any]:
    frame = {"time": 0.0, "image": {"neck": [1.0, 2.0]}}
    camera = {"model": "opencv", "K": K}
    return {"schema": "posekit.view/1", "unit": "m", "camera": camera, "frames": frames or [frame], **changes}


def refused(document: dict[str, Any]) -> str:
    with pytest.raises(InputError) as caught:
        validated(ViewFile, document, "view.json")
    return str(caught.value)


@pytest.mark.parametrize(("name", "can_be"), [
    ("neck", True), ("nose", True), ("chin", True), ("my point", True),
    ("a" * 60, True), ("a" * 61, False), ("", False), ("  ", False), ("a\n", False),
    ("left_wrist", False), ("pelvis", False),
])  # fmt: skip
def test_names_of_head_points(name: str, can_be: bool) -> None:
    assert is_head_name(name) == can_be
    points = {"head_points": {name: [0.0, 0.0, 0.1]}}
    if can_be:
        validated(ViewFile, view(figure=points), "view.json")
    else:
        assert "up to 60 characters that no joint has" in refused(view(figure=points))


def test_a_head_point_is_seen_where_its_place_is_known() -> None:
    seen = [{"time": 0.0, "image": {"neck": [1.0, 2.0]}, "head_image": {"chin": [1.0, 2.0]}}]
    words = refused(view(seen))
    assert "frames[0].head_image.chin" in words and "or give its place in figure.head_points" in words
    validated(ViewFile, view(seen, figure={"head_points": {"chin": [0.0, 0.0, 0.1]}}), "view.json")
    of_neck = [{"time": 0.0, "image": {"neck": [1.0, 2.0]}, "head_image": {"neck": [1.0, 2.0]}}]
    assert "frames[0].head_image.neck" in refused(view(of_neck))
    second = [view()["frames"][0], seen[0]]
    assert "frames[1].head_image.chin" in refused(view(second))


@pytest.mark.parametrize(
    ("name", "meant"), [("noze", "nose"), ("left_ey", "left_eye"), ("chin", ""), ("nostril", "")]
)
def test_a_place_that_is_seen_nowhere_may_be_a_misspelling(name: str, meant: str) -> None:
    document = view(figure={"head_points": {name: [0.0, 0.0, 0.1]}})
    if not meant:
        validated(ViewFile, document, "view.json")
        return
    words = refused(document)
    assert f"figure.head_points.{name}" in words and f"did you mean {meant}?" in words
    seen = [{"time": 0.0, "image": {"neck": [1.0, 2.0]}, "head_image": {name: [1.0, 2.0]}}]
    validated(ViewFile, view(seen, figure={"head_points": {name: [0.0, 0.0, 0.1]}}), "view.json")


def test_the_neck_is_seen_in_one_frame_unless_nothing_is_known_of_the_depth() -> None:
    without = {"time": 0.0, "image": {"pelvis": [1.0, 2.0]}}
    words = refused(view([without, without]))
    assert (
        "frames[0].image.neck: got nothing, in none of 2 frames; expected the neck in one frame at least"
        in words
    )
    validated(ViewFile, view([without, view()["frames"][0]]), "view.json")
    flat = {"model": "scaled-orthographic", "scale": 1.0}
    assert validated(ViewFile, view([without], camera=flat), "view.json").camera.aspect == 1.0  # type: ignore[union-attr]


@pytest.mark.parametrize(("names", "words"), [
    (["neck", "neck"], "joint_names[1]: got \"neck\" again; expected each joint once"),
    (["neck", "nek"], "joint_names[1]: got \"nek\"; expected the name of a joint"),
    ([], "at least 1 entries; name each joint of a posture once"),
])  # fmt: skip
def test_joints_of_postures_are_named_once(names: list[str], words: str) -> None:
    document = {"schema": "posekit.postures/1", "unit": "m", "joint_names": names, "postures": []}
    with pytest.raises(InputError) as caught:
        validated(PosturesFile, document, "postures.json")
    assert words in str(caught.value)
    every = {**document, "joint_names": list(POINTS), "postures": [[None] * len(POINTS)]}
    assert len(validated(PosturesFile, every, "postures.json").postures[0]) == 19


def test_a_schema_is_known_by_its_name_and_its_kind() -> None:
    assert schema("view") == schema("posekit.view/1")
    assert schema("result") == schema("posekit.result/2") != schema("posekit.result/1")
    found = schema("posekit.result/1")
    assert found["$id"] == "urn:posekit:result:1" and found["title"] == "posekit.result/1"
    assert found["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    with pytest.raises(
        InputError, match=r'schema: got "veiw"; expected the name of a schema; did you mean view'
    ):
        schema("veiw")


# --- cameras --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("off", "fits"), [(0.9e-6, True), (1.1e-6, False)])
def test_a_rotation_is_one_to_a_millionth(off: float, fits: bool) -> None:
    matrix = np.eye(3)
    matrix[0, 1] = off
    if fits:
        check_rotation(matrix)
        return
    with pytest.raises(CameraError, match=r"R R\^T is off the identity by 1\.1e-06"):
        check_rotation(matrix)


@pytest.mark.parametrize(("matrix", "words"), [
    (np.diag([1.0, 1.0, -1.0]), "its determinant is -1, so it mirrors"),
    (np.eye(2), "a finite 3x3 matrix"),
    (np.full((3, 3), np.nan), "a finite 3x3 matrix"),
    (np.full((3, 3), 1e300), "off the identity by inf"),
])  # fmt: skip
def test_what_is_no_rotation_is_refused(matrix: np.ndarray, words: str) -> None:
    with pytest.raises(CameraError, match=words):
        check_rotation(matrix)
    with pytest.raises(CameraError):
        check_intrinsics([[0.0] * 3] * 3)
    check_intrinsics(K)


@pytest.mark.parametrize(("changes", "words"), [
    ({"K": np.array([K])}, r"K must be of shape \(3, 3\): one for all frames"),
    ({"R": np.diag([1.0, 1.0, -1.0])}, "mirrors"),
    ({"t": np.zeros(2)}, r"t must be three finite numbers; got \[0.0, 0.0\]"),
    ({"t": np.array([0.0, np.inf, 0.0])}, "t must be three finite numbers"),
    ({"size": (640, 0)}, r"size must be a positive width and height in pixels; got \(640, 0\)"),
    ({"size": (640,)}, "size must be a positive"),
    ({"up": "z"}, r'up must be one of \+x, -x, \+y, -y, \+z, -z; got "z"'),
])  # fmt: skip
def test_what_is_no_camera_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(CameraError, match=words):
        OpenCVModel(**{"K": np.array(K), **changes})


def test_a_camera_keeps_arrays_of_its_own() -> None:
    given_: dict[str, Any] = {"K": np.array(K), "distortion": np.zeros(5), "R": np.eye(3), "t": np.zeros(3)}
    camera = OpenCVModel(**given_)
    for name, array in given_.items():
        own = getattr(camera, name)
        assert own is not array and not own.flags.writeable and own.dtype == np.float64
        np.testing.assert_array_equal(own, array)


@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_focal_lengths_scales_and_aspects_are_positive(value: float) -> None:
    for make, words in (
        (lambda: LeeChenModel(f=value), r"f must be from 1e-09 to 1e\+09; got"),
        (lambda: ScaledOrthographicModel(scale=value), r"scale must be from 1e-09 to 1e\+09; got"),
        (
            lambda: ScaledOrthographicModel(scale=None, aspect=value),
            r"aspect must be from 1e-09 to 1e\+09; got",
        ),
    ):
        with pytest.raises(CameraError, match=words):
            make()
    assert LeeChenModel(f=None).f is None and ScaledOrthographicModel(scale=None).aspect == 1.0


@given(unit=st.sampled_from(["m", "cm", "mm"]), metres=st.floats(0.01, 10.0))
def test_cameras_are_spelt_in_the_unit_of_the_file(unit: Any, metres: float) -> None:
    a_metre = {"m": 1.0, "cm": 100.0, "mm": 1000.0}[unit]
    assert camera_fields(LeeChenModel(f=None), unit) == {"model": "lee-chen", "f": None}
    assert camera_fields(LeeChenModel(f=metres), unit)["f"] == pytest.approx(metres * a_metre)
    flat = camera_fields(ScaledOrthographicModel(scale=metres), unit)
    assert set(flat) == {"model", "scale"} and flat["scale"] == pytest.approx(metres / a_metre)
    wide = camera_fields(ScaledOrthographicModel(scale=None, aspect=1.5), unit)
    assert wide == {"model": "scaled-orthographic", "scale": None, "aspect": 1.5}
    assert camera_fields(OpenCVModel(K=np.array(K)), unit) == {"model": "opencv", "K": K}
    whole = OpenCVModel(
        K=np.array(K),
        distortion=np.arange(5) / 10.0,
        R=np.eye(3),
        t=np.array([metres, 0.0, 1.0]),
        size=(640, 480),
        up="-y",
    )
    assert not (whole.R.flags.writeable or whole.t.flags.writeable)  # type: ignore[union-attr]
    fields = camera_fields(whole, unit)
    assert fields.pop("t") == pytest.approx([metres * a_metre, 0.0, a_metre])
    assert fields == {
        "model": "opencv",
        "K": K,
        "distortion": [0.0, 0.1, 0.2, 0.3, 0.4],
        "R": np.eye(3).tolist(),
        "size": [640, 480],
        "up": "-y",
    }


def test_every_module_that_names_a_schema_names_one_that_is_published() -> None:
    kept = {
        path.stem.replace(".", "/").replace("/", ".", 1)
        for path in (Path(__file__).parent / "schemas").iterdir()
    }
    named: dict[tuple[str, str], str] = {}
    for each in pkgutil.iter_modules(own.__path__):
        module = importlib.import_module(f"posekit.formats.own.{each.name}")
        named |= {
            (each.name, name): value
            for name, value in vars(module).items()
            if name.endswith("_SCHEMA") and isinstance(value, str)
        }
    assert len(named) > 10
    assert set(named.values()) == kept
