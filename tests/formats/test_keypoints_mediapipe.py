"""MediaPipe: every layout that people save, fractions and pixels, world landmarks, round trips and damage."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.formats.keypoints import KeyPoints
from posekit.formats.keypoints.mediapipe_names import LANDMARK_NAMES
from posekit.formats.keypoints.reading import read_keypoints
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.views.opening import open_views
from posekit.views.source import Source
from tests.detector_files import suiting, write_keypoints

MEDIAPIPE = load_skeleton_map("mediapipe_33")
PLACES = np.random.default_rng(33).uniform(-0.1, 1.2, (33, 4)).round(4)
"""x, y, z, visibility of somebody who is partly outside the picture."""


def person(k: int = 0) -> list[dict[str, float]]:
    """Return the landmarks of somebody, a little further on in frame k."""
    return [
        {"x": x + 0.01 * k, "y": y, "z": z, "visibility": v, "presence": 0.5}
        for x, y, z, v in PLACES.tolist()
    ]


def world() -> list[dict[str, float]]:
    """Return landmarks around the middle of the hips, metres."""
    points = PLACES[:, :3] - PLACES[[23, 24], :3].mean(axis=0)
    return [{"x": x, "y": y, "z": z, "visibility": 0.9} for x, y, z in points.tolist()]


def saved(path: Path, document: object) -> Path:
    path.write_text(json.dumps(document))
    return path


LISTS = [[[x, y, z, v] for x, y, z, v in PLACES.tolist()] for _ in range(2)]
LAYOUTS: dict[str, object] = {
    "frames": [{"frame": k, "landmarks": person(k)} for k in range(2)],
    "Solutions": [{"frame_id": k, "pose_landmarks": person(k), "fps": 30} for k in range(2)],
    "protobuf": [{"frame_number": k, "pose_landmarks": {"landmark": person(k)}} for k in range(2)],
    "Tasks": [
        {"pose_landmarks": [person(k)], "pose_world_landmarks": [world()], "segmentation_masks": None}
        for k in range(2)
    ],
    "web": {"frames": [{"landmarks": [person(k)], "worldLandmarks": [world()]} for k in range(2)]},
    "by name": {
        "pose_data": [{"landmarks": dict(zip(LANDMARK_NAMES, person(k), strict=True))} for k in range(2)]
    },
    "NAMES": [
        {
            "landmarks": [{"name": n.upper(), **p} for n, p in zip(LANDMARK_NAMES, person(k), strict=True)][
                ::-1
            ]
        }
        for k in (0, 1)
    ],
    "ids": {
        "frames": [{"poseLandmarks": [{"id": i, **p} for i, p in enumerate(person(k))]} for k in range(2)]
    },
    "people": {"frames": [{"people": [{"pose_landmarks": person(k)}]} for k in range(2)]},
    "lists": [person(0), person(1)],
    "lists of people": [[person(0)], [person(1)]],
}


@pytest.mark.parametrize("case", LAYOUTS)
def test_json_in_any_of_the_usual_layouts(case: str, tmp_path: Path) -> None:
    path = saved(tmp_path / "pose.json", LAYOUTS[case])
    assert suiting(path) == ["mediapipe"]
    found = read_keypoints(path)
    assert (found.layout.name, found.pictures, found.normalised) == ("mediapipe_33", ("0", "1"), True)
    np.testing.assert_array_equal(found.points[0], PLACES[:, :2])
    np.testing.assert_allclose(found.points[1, :, 0], PLACES[:, 0] + 0.01, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(found.confidence[0], PLACES[:, 3])


def test_bare_lists_of_numbers(tmp_path: Path) -> None:
    found = read_keypoints(saved(tmp_path / "pose.json", LISTS))
    np.testing.assert_array_equal(found.points[1], PLACES[:, :2])
    np.testing.assert_array_equal(found.confidence[1], PLACES[:, 3])


@pytest.mark.parametrize("document", [{"pose_landmarks": [person()]}, person(), {"landmarks": person()}])
def test_one_picture_alone(document: object, tmp_path: Path) -> None:
    found = read_keypoints(saved(tmp_path / "photo.json", document))
    np.testing.assert_array_equal(found.points[0], PLACES[:, :2])


def test_a_folder_of_pictures(tmp_path: Path) -> None:
    for k in (10, 2):
        saved(tmp_path / f"{k}.json", {"pose_landmarks": [person(k)]})
    found = read_keypoints(tmp_path)
    assert found.pictures == ("2", "10")
    assert found.points[0, 0, 0] == pytest.approx(PLACES[0, 0] + 0.02)


def wide(name: Callable[[int, str], str], lead: str = "frame,timestamp_ms") -> str:
    """Write a table with a row a frame, frame 7 before frame 3."""
    head = [name(k, part) for k in range(33) for part in ("x", "y", "z", "visibility")]
    lines = [",".join([*lead.split(","), *head])]
    for frame in (7, 3):
        lines.append(",".join([str(frame), str(frame * 40), *map(repr, PLACES.ravel().tolist())]))
    return "\n".join(lines) + "\n"


TABLES = {
    "names": wide(lambda k, part: f"{LANDMARK_NAMES[k]}_{part}"),
    "NAMES": wide(lambda k, part: f"{LANDMARK_NAMES[k].upper()}_{part}"),
    "names after": wide(lambda k, part: f"{part}_{LANDMARK_NAMES[k]}"),
    "numbers": wide(lambda k, part: f"{part[0]}{k}"),
    "from one": wide(lambda k, part: f"{part[0]}{k + 1}"),
    "landmarks": wide(lambda k, part: f"landmark_{k}_{part}"),
    "dots": wide(lambda k, part: f"{LANDMARK_NAMES[k]}.{part}", "Frame,Timestamp_ms"),
}


@pytest.mark.parametrize("case", TABLES)
def test_wide_tables(case: str, tmp_path: Path) -> None:
    path = tmp_path / "pose.csv"
    path.write_text(TABLES[case])
    assert suiting(path) == ["mediapipe"]
    found = read_keypoints(path)
    assert found.pictures == ("3", "7")
    assert found.time.tolist() == [0.12, 0.28]
    for row in range(2):
        np.testing.assert_array_equal(found.points[row], PLACES[:, :2])
        np.testing.assert_array_equal(found.confidence[row], PLACES[:, 3])


@pytest.mark.parametrize("named", [True, False])
def test_long_tables(named: bool, tmp_path: Path) -> None:
    lines = io.StringIO()
    writer = csv.writer(lines)
    writer.writerow(
        ["frame_index", "timestamp", "landmark_name" if named else "landmark", "x", "y", "z", "visibility"]
    )
    for frame in (1, 0):
        for k, (x, y, z, v) in enumerate(PLACES.tolist()):
            writer.writerow(
                [frame, frame * 33.3, LANDMARK_NAMES[k].upper() if named else k, x, y, z, "" if k == 2 else v]
            )
    (tmp_path / "pose.csv").write_text(lines.getvalue())
    found = read_keypoints(tmp_path / "pose.csv")
    assert found.pictures == ("0", "1")
    np.testing.assert_allclose(
        found.time, [0, 0.0333], rtol=0, atol=1e-12, err_msg="a timestamp in milliseconds"
    )
    np.testing.assert_array_equal(found.points[0], PLACES[:, :2])
    assert np.isnan(found.confidence[0, 2])


def test_pixels_are_told_from_fractions(tmp_path: Path) -> None:
    pixels = [{**p, "x": p["x"] * 1920, "y": p["y"] * 1080} for p in person()]
    found = read_keypoints(saved(tmp_path / "p.json", [{"landmarks": pixels}]))
    assert not found.normalised
    np.testing.assert_allclose(found.points[0], PLACES[:, :2] * [1920, 1080], rtol=1e-15)


@pytest.mark.parametrize(
    "document",
    [
        {"metadata": {"image_width": 640, "image_height": 480}, "frames": [{"landmarks": person()}]},
        {"width": 640, "height": 480, "frames": [{"landmarks": person()}]},
        {"resolution": [640, 480], "frames": [{"landmarks": person()}]},
        [{"landmarks": person(), "image_width": 640, "image_height": 480}],
    ],
)
def test_the_size_in_the_file_is_used(document: object, tmp_path: Path) -> None:
    found = read_keypoints(saved(tmp_path / "p.json", document))
    assert (found.normalised, found.size.tolist()) == (False, [[640, 480]])
    np.testing.assert_array_equal(found.points[0], PLACES[:, :2] * [640, 480])


def test_a_picture_without_anybody_keeps_its_place(tmp_path: Path) -> None:
    document = [
        {"frame": 2, "pose_landmarks": None},
        {"frame": 0, "pose_landmarks": []},
        {"frame": 1, "pose_landmarks": person()},
    ]
    found = read_keypoints(saved(tmp_path / "p.json", document))
    assert (found.pictures, found.frame.tolist()) == (("0", "1", "2"), [1])


def test_a_point_that_is_null_is_missing(tmp_path: Path) -> None:
    points: list[Any] = person()
    points[5] = {"x": None, "y": 0.5}
    found = read_keypoints(saved(tmp_path / "p.json", [{"landmarks": points}]))
    assert np.flatnonzero(np.isnan(found.points[0, :, 0])).tolist() == [5]


def test_presence_stands_in_for_visibility(tmp_path: Path) -> None:
    points = [{"x": p["x"], "y": p["y"], "presence": 0.25} for p in person()]
    assert (read_keypoints(saved(tmp_path / "p.json", [{"landmarks": points}])).confidence == 0.25).all()


@pytest.mark.parametrize(
    "document", [[{"pose_world_landmarks": world()}], [{"landmarks": world()}], [world()]]
)
def test_world_landmarks_are_in_no_picture(document: object, tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"world landmarks.*expected landmarks in the picture; save pose_landmarks"
    ):
        read_keypoints(saved(tmp_path / "p.json", document), "mediapipe")


@given(
    seed=st.integers(0, 2**32 - 1),
    ending=st.sampled_from([".json", ".csv"]),
    size=st.sampled_from([None, (640, 480), (1023, 767)]),
)
def test_what_is_written_is_read_again(seed: int, ending: str, size: Any, tmp_path_factory: Any) -> None:
    rng = np.random.default_rng(seed)
    frame = np.sort(rng.integers(0, 5, int(rng.integers(1, 8))))
    points = np.where(
        rng.random((len(frame), 33, 1)) < 0.2, np.nan, rng.uniform(0.05, 1.5, (len(frame), 33, 2))
    )
    points[:, :3] = 0.5  # nobody is without any point
    there = KeyPoints(
        format="test",
        source="test",
        layout=MEDIAPIPE,
        pictures=tuple(map(str, range(5))),
        frame=frame,
        points=points * (size or 1),
        confidence=np.where(np.isnan(points[..., 0]), np.nan, rng.random((len(frame), 33))),
        time=np.arange(5) / 30,
        size=np.empty(0) if size is None else np.tile(np.array(size, dtype=float), (5, 1)),
        normalised=size is None,
    )
    path = tmp_path_factory.mktemp("mediapipe") / f"pose{ending}"
    write_keypoints(path, there, "mediapipe")
    assert suiting(path) == ["mediapipe"]
    back = read_keypoints(path)
    if ending == ".csv":  # it has no size, and no pictures without people
        assert back.normalised
        wanted = there.points / (size or 1)
        assert back.pictures == tuple(str(k) for k in np.unique(frame))
    else:
        wanted = there.points
        assert (back.normalised, back.pictures) == (size is None, there.pictures)
        np.testing.assert_array_equal(back.time, there.time)
        np.testing.assert_array_equal(back.size, there.size)
    np.testing.assert_allclose(back.points, wanted, rtol=1e-15)
    np.testing.assert_array_equal(back.confidence, there.confidence)


BAD: dict[str, tuple[object, str]] = {
    "upper body": ([{"landmarks": person()[:25]}], "25 landmarks without names; expected 33"),
    "text": ([{"landmarks": [{**p, "x": "0.5"} for p in person()]}], r"nose: got \"0.5\""),
    "true": ([{"landmarks": [{**p, "x": True} for p in person()]}], "nose: got true"),
    "huge": ([{"landmarks": [{**p, "y": 1e9} for p in person()]}], "expected a fraction"),
    "numbers": ([{"landmarks": list(range(33))}], "got 0; expected {x, y"),
    "nothing": ({"shoes": 2}, "expected frames with pose_landmarks"),
    "a number": ([{"landmarks": 3}], "got 3; expected a list of 33"),
}


@pytest.mark.parametrize("case", BAD)
def test_damage_is_told_in_one_line(case: str, tmp_path: Path) -> None:
    document, told = BAD[case]
    with pytest.raises(InputError, match=told) as caught:
        read_keypoints(saved(tmp_path / "p.json", document), "mediapipe")
    assert "\n" not in str(caught.value)


BAD_TABLES = {
    "short line": ("frame,landmark,x,y\n0,0,1\n", "line 2: got 3 fields; expected 4"),
    "text": ("frame,landmark,x,y\n0,0,a,1\n", 'line 2: x: got "a"'),
    "unknown landmark": (
        "frame,landmark,x,y\n0,tail,1,1\n",
        'landmark: got "tail"; expected a landmark\'s name',
    ),
    "number 33": ("frame,landmark,x,y\n0,33,1,1\n", "number 0 to 32"),
    "twice": ("frame,landmark,x,y\n0,3,1,1\n0,3,1,1\n", "left_eye_outer twice in a picture"),
    "other columns": ("a,b\n1,2\n", "expected columns as nose_x"),
    "infinite": ("frame,landmark,x,y\n0,0,inf,1\n", "expected a number, or nothing"),
}


@pytest.mark.parametrize("case", BAD_TABLES)
def test_damaged_tables_are_told_in_one_line(case: str, tmp_path: Path) -> None:
    text, told = BAD_TABLES[case]
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(InputError, match=told) as caught:
        read_keypoints(tmp_path / "p.csv", "mediapipe")
    assert "\n" not in str(caught.value)


@given(
    document=st.recursive(
        st.none()
        | st.booleans()
        | st.integers()
        | st.floats(allow_nan=False, allow_infinity=False)
        | st.text(max_size=3),
        lambda inner: (
            st.lists(inner, max_size=4)
            | st.dictionaries(
                st.sampled_from(
                    [
                        "pose_landmarks",
                        "landmarks",
                        "frames",
                        "people",
                        "x",
                        "y",
                        "frame",
                        "time",
                        "width",
                        "height",
                        "name",
                    ]
                ),
                inner,
                max_size=4,
            )
        ),
        max_leaves=20,
    )
)
def test_any_json_is_read_or_refused(document: object, tmp_path_factory: Any) -> None:
    path = saved(tmp_path_factory.mktemp("any") / "p.json", document)
    suiting(path)
    try:
        read_keypoints(path, "mediapipe")
    except InputError as error:
        assert "\n" not in str(error)


def of_caliscope(path: Path, ports: tuple[int, ...]) -> Path:
    """Write what cameras saw of one person, as caliscope does: each the landmarks elsewhere, and a point of a hand."""
    rows = ["sync_index,port,frame_index,frame_time,point_id,img_loc_x,img_loc_y,obj_loc_x,obj_loc_y"]
    for k in range(2):
        for port in ports:
            for index, (x, y, *_) in enumerate(PLACES.tolist()):
                rows.append(f"{k},{port},{k + port},{4000 + k / 20},{index},{1000 * x + port},{1000 * y},,")
            rows.append(f"{k},{port},{k + port},{4000 + k / 20},105,1,1,,")
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.mark.filterwarnings("ignore:.*left and right")  # of a body that is none
def test_what_cameras_saw_is_told_apart_by_the_camera(tmp_path: Path) -> None:
    path = of_caliscope(tmp_path / "xy.csv", (0, 2))
    found = read_keypoints(path)
    assert found.by_camera and found.person.tolist() == [0, 2, 0, 2] and found.pictures == ("0", "1")
    np.testing.assert_allclose(found.points[1], 1000 * PLACES[:, :2] + [2, 0])
    np.testing.assert_allclose(found.time, [0, 0.05])
    config = tmp_path / "config.toml"
    camera = "matrix = [[900, 0, 640], [0, 900, 360], [0, 0, 1]]\nsize = [1280, 720]\n"
    config.write_text(f"[cam_2]\n{camera}[cam_3]\n{camera}")
    (seen,) = open_views(path, Source(camera=f"{config}:cam_2", stature=1.7))
    expected = open_views(path, Source(camera=f"{config}:cam_2", stature=1.7, person="2"))[0].view.image
    np.testing.assert_array_equal(seen.view.image, expected)
    for one in (
        Source(stature=1.7),
        Source(stature=1.7, person="all"),
        Source(camera=f"{config}:cam_3", stature=1.7),
    ):
        with pytest.raises(InputError, match=r"what cameras 0, 2 saw; expected one of them; .* --person 0"):
            open_views(path, one)


def test_a_port_of_another_table_is_no_camera(tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    rows = [f"0,7,{name},{x},{y}" for name, (x, y, *_) in zip(LANDMARK_NAMES, PLACES.tolist(), strict=True)]
    path.write_text("\n".join(["frame,port,landmark,x,y", *rows]) + "\n")
    found = read_keypoints(path)
    assert not found.by_camera and found.person.tolist() == [-1]
