"""OpenPose's files: what they carry comes back exactly, the two orders of 25 points are told apart, damage is told."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.formats.keypoints import KeyPoints
from posekit.formats.keypoints.reading import read_keypoints
from posekit.formats.skeleton_maps import load_skeleton_map
from tests.detector_files import suiting, write_keypoints

BODY_25, BODY_25B, COCO_18 = map(load_skeleton_map, ("body_25", "body_25b", "coco_18"))
FACES = {
    "Nose": (0, 0),
    "REye": (-0.03, 0.04),
    "LEye": (0.03, 0.04),
    "REar": (-0.07, 0.02),
    "LEar": (0.07, 0.02),
}


def bodies(rng: np.random.Generator, count: int) -> dict[str, np.ndarray]:
    """Make people in pixels (count, 2) by point: limbs of human lengths in directions of their own, seen from afar."""

    def step(start: np.ndarray, length: float, spread: float) -> np.ndarray:
        way = np.array([0.0, -1.0, 0.0]) + spread * rng.normal(size=(count, 3))
        end: np.ndarray = start + length * way / np.linalg.norm(way, axis=1, keepdims=True)
        return end

    yaw = rng.uniform(0, 2 * np.pi, count)
    across = np.stack([np.cos(yaw), np.zeros(count), np.sin(yaw)], axis=1)
    ahead = np.stack([-np.sin(yaw), np.zeros(count), np.cos(yaw)], axis=1)
    hips = np.zeros((count, 3))
    chest = hips + np.array([0, 0.5, 0])
    points = {"MidHip": hips, "Neck": chest}
    for side, sign in (("R", -1), ("L", 1)):
        points[side + "Shoulder"] = chest + 0.18 * sign * across
        points[side + "Hip"] = hips + 0.1 * sign * across
        points[side + "Elbow"] = step(points[side + "Shoulder"], 0.3, 0.6)
        points[side + "Wrist"] = step(points[side + "Elbow"], 0.26, 0.8)
        points[side + "Knee"] = step(points[side + "Hip"], 0.42, 0.3)
        points[side + "Ankle"] = step(points[side + "Knee"], 0.42, 0.3)
        points[side + "Heel"] = points[side + "Ankle"] - np.array([0, 0.06, 0]) - 0.04 * ahead
        points[side + "BigToe"] = points[side + "Ankle"] - np.array([0, 0.08, 0]) + 0.15 * ahead
        points[side + "SmallToe"] = points[side + "BigToe"] + 0.05 * sign * across
    for name, (right, up) in FACES.items():
        points[name] = chest + np.array([0, 0.2 + up, 0]) + right * across + 0.1 * ahead
    points["UpperNeck"], points["HeadTop"] = chest + np.array([0, 0.12, 0]), chest + np.array([0, 0.4, 0])
    place = rng.uniform(400, 900, (count, 2))
    return {name: place + 300 * value[:, :2] * [1, -1] for name, value in points.items()}


def detections(rng: np.random.Generator, layout, count: int, missing: float = 0.0) -> np.ndarray:
    found = bodies(rng, count)
    points = np.stack([found[name] for name in layout.points], axis=1)
    points[rng.random(points.shape[:2]) < missing] = np.nan
    return points


def person(points: np.ndarray, confidence: float = 0.5, **more: object) -> dict:
    rows = [[0, 0, 0] if np.isnan(x) else [float(x), float(y), confidence] for x, y in points]
    return {"person_id": [-1], "pose_keypoints_2d": [value for row in rows for value in row], **more}


def folder(path: Path, files: Mapping[str, object]) -> Path:
    path.mkdir(parents=True)
    for name, content in files.items():
        text = content if isinstance(content, str) else json.dumps({"version": 1.3, "people": content})
        (path / name).write_text(text, encoding="utf-8")
    return path


def same(one: KeyPoints, other: KeyPoints) -> None:
    assert one.pictures == other.pictures and one.layout.points == other.layout.points
    assert one.normalised == other.normalised
    for name in ("frame", "person", "points", "confidence"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


@st.composite
def found(draw: st.DrawFn) -> KeyPoints:
    layout = draw(st.sampled_from([BODY_25, BODY_25B, COCO_18]))
    pictures = draw(st.integers(1, 4))
    frame = sorted(draw(st.lists(st.integers(0, pictures - 1), max_size=5)))
    count = len(layout.points)
    number = st.floats(2, 4000, allow_nan=False, width=64)
    points = np.array(
        draw(st.lists(number, min_size=2 * count * len(frame), max_size=2 * count * len(frame)))
    ).reshape(len(frame), count, 2)
    lost = np.array(
        draw(st.lists(st.booleans(), min_size=count * len(frame), max_size=count * len(frame))), bool
    )
    lost = lost.reshape(len(frame), count)
    lost[:, 0] = False
    points[lost] = np.nan
    confidence = np.where(lost, np.nan, draw(st.floats(0, 6)))
    return KeyPoints(
        format="openpose",
        source="made",
        layout=layout,
        pictures=tuple(f"clip_{k:012d}" for k in range(pictures)),
        frame=np.array(frame, dtype=np.intp),
        points=points,
        confidence=confidence,
        person=np.array([draw(st.integers(-1, 9)) for _ in frame], dtype=np.intp),
    )


@settings(deadline=None, max_examples=25)
@given(found())
def test_what_is_written_is_read_again(
    tmp_path_factory: pytest.TempPathFactory, keypoints: KeyPoints
) -> None:
    path = tmp_path_factory.mktemp("out") / "json"
    write_keypoints(path, keypoints, "openpose")
    assert suiting(path) == ["openpose"]
    again = read_keypoints(path, layout=keypoints.layout)
    same(again, keypoints)


def test_a_picture_is_read_as_a_plain_loop_over_its_json_reads_it(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    points = detections(rng, BODY_25, 3, missing=0.2)
    path = folder(
        tmp_path / "in",
        {
            "v_000000000000_keypoints.json": [person(points[0], person_id=[7]), person(points[1])],
            "v_000000000001_keypoints.json": [],
            "v_000000000002_keypoints.json": [person(points[2], person_id=3)],
        },
    )
    read = read_keypoints(path, "openpose-body_25")
    assert read.frame.tolist() == [0, 0, 2] and read.person.tolist() == [7, -1, 3]
    assert read.pictures == ("v_000000000000", "v_000000000001", "v_000000000002")
    for row, one in enumerate(points):
        for k in range(25):
            if np.isnan(one[k, 0]):
                assert np.isnan(read.points[row, k]).all() and np.isnan(read.confidence[row, k])
            else:
                assert read.points[row, k].tolist() == one[k].tolist() and read.confidence[row, k] == 0.5
    assert np.isnan(read.size).all() and np.isnan(read.score).all() and not read.normalised


@pytest.mark.parametrize("layout", [BODY_25, BODY_25B])
@pytest.mark.parametrize("seed", range(5))
def test_the_two_orders_of_25_points_are_told_apart(tmp_path: Path, layout, seed: int) -> None:
    points = detections(np.random.default_rng(seed), layout, 12, missing=0.15)
    path = folder(tmp_path / "in", {f"{k}.json": [person(one)] for k, one in enumerate(points)})
    assert read_keypoints(path).layout.name == layout.name


def test_eighteen_points_are_openposes_coco(tmp_path: Path, rng: np.random.Generator) -> None:
    path = folder(tmp_path / "in", {"a.json": [person(detections(rng, COCO_18, 1)[0])]})
    assert read_keypoints(path).layout.name == "coco_18"


def test_a_head_alone_is_of_either_order_and_the_user_can_say_which(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    points = detections(rng, BODY_25B, 1)[0]
    points[5:] = np.nan
    path = folder(tmp_path / "in", {"a.json": [person(points)]})
    with pytest.raises(InputError, match=r"openpose-body_25 or openpose-body_25b.*--format"):
        read_keypoints(path)
    assert read_keypoints(path, "openpose-body_25b").layout.name == "body_25b"
    assert read_keypoints(path, layout=BODY_25).layout.name == "body_25"


def test_a_point_at_the_origin_is_missing_whatever_its_confidence(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    one = person(detections(rng, BODY_25, 1)[0])
    one["pose_keypoints_2d"][3:6] = [0, 0, 0.9]
    one["pose_keypoints_2d"][6:9] = [None, None, None]
    one["pose_keypoints_2d"][9:12] = [0, 17.5, 0.25]  # on the picture's left edge: no missing point
    one["pose_keypoints_2d"][12:15] = [12.0, 9.0, 0.0]  # placed without any confidence: still placed
    read = read_keypoints(folder(tmp_path / "in", {"a.json": [one]}), "openpose-body_25")
    assert np.isnan(read.points[0, 1:3]).all() and np.isnan(read.confidence[0, 1:3]).all()
    assert read.points[0, 3].tolist() == [0, 17.5] and read.confidence[0, 4] == 0


def test_a_point_that_is_at_the_origin_is_not_lost_in_writing(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    points = detections(rng, BODY_25, 1)
    points[0, 4] = 0
    keypoints = KeyPoints(
        format="", source="", layout=BODY_25, pictures=("a",), frame=np.zeros(1, np.intp), points=points
    )
    write_keypoints(tmp_path / "a.json", keypoints, "openpose")
    read = read_keypoints(tmp_path / "a.json", layout=BODY_25)
    np.testing.assert_allclose(read.points, points, atol=2e-6)
    assert (read.confidence == 1).all()  # not known, and written as sure


def test_no_people_at_all_is_no_error(tmp_path: Path) -> None:
    read = read_keypoints(folder(tmp_path / "in", {"0.json": [], "1.json": []}))
    assert len(read) == 0 and read.pictures == ("0", "1") and read.points.shape == (0, 25, 2)


def test_a_person_without_any_point_is_left_out(tmp_path: Path, rng: np.random.Generator) -> None:
    points = detections(rng, COCO_18, 2)
    points[0] = np.nan
    read = read_keypoints(folder(tmp_path / "in", {"0.json": [person(points[0]), person(points[1])]}))
    assert len(read) == 1


def test_files_are_ordered_by_number_and_gaps_are_no_pictures(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    points = detections(rng, COCO_18, 4)
    names = ["f10.json", "f2.json", "f1.json", "f7.json"]
    path = folder(tmp_path / "in", {name: [person(one)] for name, one in zip(names, points, strict=True)})
    (path / ".hidden.json").write_text("no JSON", encoding="utf-8")
    read = read_keypoints(path)
    assert read.pictures == ("f1", "f2", "f7", "f10")
    np.testing.assert_array_equal(read.points, points[[2, 1, 3, 0]])


@pytest.mark.parametrize(
    "names",
    [
        ("cam1.0001.json", "cam1.0002.json", "cam2.0001.json", "cam2.0002.json"),
        ("left_7_keypoints.json", "right_7_keypoints.json"),
        ("0001_cam1.json", "0001_cam2.json", "0002_cam1.json", "0002_cam2.json"),
        ("cam1_01.json", "cam1_02.json", "webcam_01.json", "webcam_02.json"),
    ],
)
def test_a_folder_of_several_cameras_is_refused(tmp_path: Path, names: tuple[str, ...]) -> None:
    path = folder(tmp_path / "in", {name: [] for name in names})
    with pytest.raises(InputError, match=r"more than one series.*folder of its own"):
        read_keypoints(path)


@pytest.mark.parametrize(
    "names",
    [
        ("alice.json", "bob.json"),
        ("IMG_20240101_101500.json", "IMG_20240101_101501.json", "IMG_20240102_090000.json"),
        ("cam1.0001.json", "cam1.0002.json"),
        ("0001_cam1.json", "0002_cam1.json"),
        ("a1.json", "b.json"),
    ],
)
def test_pictures_of_one_camera_are_not_refused(tmp_path: Path, names: tuple[str, ...]) -> None:
    assert len(read_keypoints(folder(tmp_path / "in", {name: [] for name in names})).pictures) == len(names)


def test_a_folder_of_folders_names_them(tmp_path: Path) -> None:
    folder(tmp_path / "pose" / "cam01", {"0.json": []})
    with pytest.raises(InputError, match="give cam01"):
        read_keypoints(tmp_path / "pose")


def test_a_folder_of_several_detectors_is_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    mixed = {
        "0.json": [person(detections(rng, BODY_25, 1)[0])],
        "1.json": [person(detections(rng, COCO_18, 1)[0])],
    }
    with pytest.raises(InputError, match=r"1\.json: people\[0\].*18 points; expected 25.*0\.json"):
        read_keypoints(folder(tmp_path / "counts", mixed))
    other = {"0.json": [], "1.json": '{"annotations": [], "images": []}'}
    with pytest.raises(InputError, match=r"1\.json: people.*other formats out of the folder"):
        read_keypoints(folder(tmp_path / "formats", other))


def test_numbers_of_people_may_differ_from_picture_to_picture(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    points = detections(rng, BODY_25, 6)
    files = {"0.json": points[:3], "1.json": points[:0], "2.json": points[3:4], "3.json": points[4:]}
    read = read_keypoints(
        folder(tmp_path / "in", {name: list(map(person, some)) for name, some in files.items()})
    )
    assert read.frame.tolist() == [0, 0, 0, 2, 3, 3]


def test_old_files_and_extra_fields_are_read(tmp_path: Path, rng: np.random.Generator) -> None:
    one = person(detections(rng, COCO_18, 1)[0])
    old = {"pose_keypoints": one["pose_keypoints_2d"], "face_keypoints": []}
    read = read_keypoints(folder(tmp_path / "in", {"0.json": [old]}))
    assert read.layout.name == "coco_18" and read.person.tolist() == [-1]


@pytest.mark.parametrize("scale", [3, 4])
def test_scaled_points_are_fractions(tmp_path: Path, rng: np.random.Generator, scale: int) -> None:
    """As src/openpose/core/keypointScaler.cpp: with 4, a missing point at (0, 0, 0) goes to (-1, -1, 0)."""
    width, height = 1920, 1080
    points = detections(rng, BODY_25, 2, missing=0.2)
    pixels = np.nan_to_num(points)
    fractions = pixels / [width - 1, height - 1]
    scaled = fractions if scale == 3 else 2 * fractions - 1
    people = [
        {"pose_keypoints_2d": np.concatenate([xy, ~np.isnan(raw[:, :1]) * 0.5], axis=1).ravel().tolist()}
        for xy, raw in zip(scaled, points, strict=True)
    ]
    read = read_keypoints(folder(tmp_path / "in", {"0.json": people}), layout=BODY_25)
    assert read.normalised
    np.testing.assert_allclose(read.points, np.where(np.isnan(points), np.nan, fractions), atol=1e-12)


def test_fractions_are_read_as_such(tmp_path: Path, rng: np.random.Generator) -> None:
    fractions = detections(rng, BODY_25, 1) / 2000
    keypoints = KeyPoints(
        format="",
        source="",
        layout=BODY_25,
        pictures=("a",),
        frame=np.zeros(1, np.intp),
        points=fractions,
        normalised=True,
    )
    write_keypoints(tmp_path / "a.json", keypoints, "openpose")
    np.testing.assert_array_equal(read_keypoints(tmp_path / "a.json", layout=BODY_25).points, fractions)


@pytest.mark.parametrize("name", ["openpose", "openpose-body_25", "openpose-body_25b", "openpose-coco_18"])
def test_another_layout_is_converted(tmp_path: Path, rng: np.random.Generator, name: str) -> None:
    coco = load_skeleton_map("coco_17")
    points = rng.uniform(10, 900, (1, 17, 2))
    keypoints = KeyPoints(
        format="", source="", layout=coco, pictures=("a",), frame=np.zeros(1, np.intp), points=points
    )
    write_keypoints(tmp_path / "a", keypoints, name)
    layout = load_skeleton_map(name.partition("-")[2] or "body_25")
    read = read_keypoints(tmp_path / "a", layout=layout)
    np.testing.assert_array_equal(read.landmarks, keypoints.landmarks)
    assert np.isnan(read.points[0, 19:]).all()


PEOPLE = [
    ('{"people": 3}', "people"),
    ('{"people": [3]}', "people"),
    ('{"people": [{"pose_keypoints_2d": [1, 2]}]}', "2 numbers"),
    ('{"people": [{"pose_keypoints_2d": [1, 2, "3"]}]}', r"pose_keypoints_2d\[2\]: got \"3\""),
    ('{"people": [{"pose_keypoints_2d": [1, 2, true]}]}', r"\[2\]: got true"),
    ('{"people": [{"pose_keypoints_2d": [[1, 2, 3]]}]}', "1 numbers|flat list"),
    ('{"people": [{"pose_keypoints_2d": {"a": 1}}]}', "a list"),
    ('{"people": [{"pose_keypoints_2d": []}]}', "body detector"),
    (
        '{"people": [{"pose_keypoints_2d": [1, 2, 3, 4, 5, 6]}]}',
        "2 a person, unnamed; expected 18, 25 points",
    ),
    ('{"people": [{"person_id": [[1]], "pose_keypoints_2d": [1, 2, 3]}]}', "person_id"),
    ('{"people": [{"person_id": [1, 2], "pose_keypoints_2d": [1, 2, 3]}]}', "person_id"),
    ('{"people": [{"person_id": [-5], "pose_keypoints_2d": [1, 2, 3]}]}', "person_id"),
    ('{"people": [{"pose_keypoints_2d": [1, NaN, 3]}]}', "NaN"),
    ('{"people": [{"pose_keypoints_2d": [1, 2, 3', "line 1 column"),
    (json.dumps({"people": [{"pose_keypoints_2d": [5, None, 1] * 18}]}), "two numbers"),
    (json.dumps({"people": [{"pose_keypoints_2d": [1e308, -1e308, 1] * 25}]}), "two numbers|either order"),
    (json.dumps({"people": [{"pose_keypoints_2d": [1e9, 1, 1] * 18}]}), "two numbers up to 1,000,000"),
]


@pytest.mark.parametrize(("text", "said"), PEOPLE)
def test_a_damaged_file_is_told_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "a.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said) as caught:
        read_keypoints(tmp_path / "a.json", "openpose")
    assert "\n" not in str(caught.value) and str(caught.value).startswith(str(tmp_path))


def test_a_map_of_another_number_of_points_is_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    path = folder(tmp_path / "in", {"a.json": [person(detections(rng, BODY_25, 1)[0])]})
    with pytest.raises(InputError, match="expected 18"):
        read_keypoints(path, layout=COCO_18)


def test_a_folder_that_may_not_be_read_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = folder(tmp_path / "in", {"a.json": []})

    def refuse(self: Path) -> list[Path]:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "iterdir", refuse)
    with pytest.raises(InputError, match="Permission denied; expected a readable folder"):
        read_keypoints(path)
