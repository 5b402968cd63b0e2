"""COCO-WholeBody: 133 points in parts or in one list, labelled or detected."""

from __future__ import annotations

import json
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

LAYOUT = load_skeleton_map("coco_wholebody_133")
PARTS = (
    ("keypoints", 17),
    ("foot_kpts", 6),
    ("face_kpts", 68),
    ("lefthand_kpts", 21),
    ("righthand_kpts", 21),
)


def save(path: Path, content: object) -> Path:
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def in_parts(values: np.ndarray) -> dict[str, list[float]]:
    """Part 133 triples by the published order."""
    parts, start = {}, 0
    for name, count in PARTS:
        parts[name] = values[start : start + count].ravel().tolist()
        start += count
    assert start == 133
    return parts


def labelled(rng: np.random.Generator) -> np.ndarray:
    """Make triples as the data set has them: flags for body and feet, 0, 1 or a fraction for face and hands."""
    values = np.column_stack([rng.uniform(1, 600, (133, 2)), rng.integers(0, 3, 133)])
    values[23:, 2] = np.where(rng.random(110) < 0.3, rng.uniform(0.01, 0.99, 110), rng.integers(0, 2, 110))
    values[0, 2] = 2
    values[values[:, 2] == 0] = 0
    return values


def document(people: list[dict]) -> dict:
    return {
        "images": [{"id": 1, "file_name": "1.jpg", "width": 640, "height": 480}],
        "annotations": [
            {"id": k, "image_id": 1, "category_id": 1, "iscrowd": 0} | one for k, one in enumerate(people)
        ],
        "categories": [{"id": 1, "name": "person", "keypoints": list(LAYOUT.points[:17])}],
    }


def test_labels_are_read_part_by_part(tmp_path: Path, rng: np.random.Generator) -> None:
    values = labelled(rng)
    path = save(tmp_path / "x.json", document([in_parts(values) | {"face_valid": True}]))
    assert suiting(path) == ["coco-wholebody"]
    read = read_keypoints(path)
    assert read.layout.name == "coco_wholebody_133" and read.size.tolist() == [[640, 480]]
    for k, (x, y, v) in enumerate(values):
        if v == 0:
            assert np.isnan(read.points[0, k]).all() and np.isnan(read.confidence[0, k])
            continue
        assert read.points[0, k].tolist() == [x, y]
        assert bool(read.occluded[0, k]) == (k < 23 and v == 1)
        assert read.confidence[0, k] == v if k >= 23 and v < 1 else np.isnan(read.confidence[0, k])


@pytest.mark.parametrize("flag", ["foot_valid", "face_valid", "lefthand_valid", "righthand_valid"])
def test_a_part_that_is_not_valid_or_not_there_is_missing(
    tmp_path: Path, rng: np.random.Generator, flag: str
) -> None:
    values = labelled(rng)
    values[:, 2] = 2
    part = flag.replace("_valid", "_kpts")
    whole = in_parts(values)
    invalid = read_keypoints(save(tmp_path / "x.json", document([whole | {flag: False}])))
    absent = read_keypoints(
        save(tmp_path / "y.json", document([{name: one for name, one in whole.items() if name != part}]))
    )
    empty = read_keypoints(save(tmp_path / "z.json", document([whole | {part: []}])))
    start = sum(count for name, count in PARTS[: [name for name, _ in PARTS].index(part)])
    gone = np.zeros(133, bool)
    gone[start : start + dict(PARTS)[part]] = True
    for read in (invalid, absent, empty):
        np.testing.assert_array_equal(np.isnan(read.points[0, :, 0]), gone)


def test_one_list_of_133_is_the_same_as_the_parts(tmp_path: Path, rng: np.random.Generator) -> None:
    values = labelled(rng)
    parts = read_keypoints(save(tmp_path / "x.json", document([in_parts(values)])))
    whole = save(tmp_path / "y.json", document([{"keypoints": values.ravel().tolist()}]))
    assert suiting(whole) == ["coco-wholebody"]
    read = read_keypoints(whole)
    for name in ("points", "confidence", "occluded"):
        np.testing.assert_array_equal(getattr(read, name), getattr(parts, name))


def test_results_have_confidences_in_all_parts(tmp_path: Path, rng: np.random.Generator) -> None:
    values = np.column_stack([rng.uniform(1, 600, (133, 2)), rng.uniform(0, 1, 133)])
    values[5], values[6, 2], values[30, 2] = 0, 1, 1
    path = save(tmp_path / "x.json", [{"image_id": 4, "category_id": 1, "score": 0.5} | in_parts(values)])
    assert suiting(path) == ["coco-wholebody"]
    read = read_keypoints(path)
    known = np.arange(133) != 5
    np.testing.assert_array_equal(read.points[0, known], values[known, :2])
    np.testing.assert_array_equal(read.confidence[0, known], values[known, 2])
    assert np.isnan(read.points[0, 5]).all() and read.score[0] == 0.5 and not read.occluded.any()
    assert read.pictures == ("4",)


def test_a_detectors_confidences_for_the_body_are_not_flags(tmp_path: Path, rng: np.random.Generator) -> None:
    values = labelled(rng)
    values[:23, 2] = rng.uniform(0.1, 0.9, 23)
    values[:23, :2] = rng.uniform(1, 9, (23, 2))
    values[3, 2] = 1.0
    read = read_keypoints(save(tmp_path / "x.json", document([in_parts(values)])))
    assert read.confidence[0, 3] == 1 and not read.occluded.any()


@st.composite
def people(draw: st.DrawFn) -> KeyPoints:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    pictures, count = draw(st.integers(1, 3)), draw(st.integers(0, 4))
    shape = (count, 133)
    points = rng.uniform(-50, 4000, (*shape, 2))
    missing = rng.random(shape) < draw(st.floats(0, 1))
    missing[:, 0] = False
    points[missing] = np.nan
    confidence = np.where(missing | (rng.random(shape) < 0.5), np.nan, rng.uniform(0.01, 0.99, shape))
    confidence[:, :23] = np.nan
    occluded = ~missing & (rng.random(shape) < 0.3)
    occluded[:, 23:] = False
    return KeyPoints(
        format="made",
        source="made",
        layout=LAYOUT,
        pictures=tuple(f"{k}.png" for k in range(pictures)),
        size=rng.integers(1, 5000, (pictures, 2)).astype(float),
        frame=np.sort(rng.integers(0, pictures, count)),
        points=points,
        confidence=confidence,
        occluded=occluded,
        score=rng.random(count),
        person=rng.integers(-1, 4, count),
    )


@settings(deadline=None, max_examples=30)
@given(people())
def test_what_is_written_is_read_again(
    tmp_path_factory: pytest.TempPathFactory, keypoints: KeyPoints
) -> None:
    path = tmp_path_factory.mktemp("out") / "people.json"
    write_keypoints(path, keypoints, "coco-wholebody")
    if len(keypoints):
        assert suiting(path) == ["coco-wholebody"]
    again = read_keypoints(path, "coco-wholebody")
    assert again.pictures == keypoints.pictures and again.layout.points == LAYOUT.points
    for name in ("frame", "points", "confidence", "occluded", "score", "person", "size"):
        np.testing.assert_array_equal(getattr(again, name), getattr(keypoints, name), err_msg=name)


def test_what_is_written_has_the_fields_of_the_data_set(tmp_path: Path, rng: np.random.Generator) -> None:
    points = rng.uniform(1, 9, (1, 133, 2))
    points[0, 91:112] = np.nan
    keypoints = KeyPoints(
        format="", source="", layout=LAYOUT, pictures=("a",), frame=np.zeros(1, np.intp), points=points
    )
    write_keypoints(tmp_path / "a.json", keypoints, "coco-wholebody")
    content = json.loads((tmp_path / "a.json").read_text("utf-8"))
    (one,) = content["annotations"]
    assert {name: len(one[name]) for name, _ in PARTS} == {name: 3 * count for name, count in PARTS}
    assert one["lefthand_valid"] is False and one["righthand_valid"] is True and one["face_valid"] is True
    assert one["lefthand_kpts"] == [0] * 63
    assert content["categories"][0]["keypoints"] == list(LAYOUT.points[:17])


def test_another_layout_is_converted_in_writing_and_refused_in_reading(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    coco = load_skeleton_map("coco_17")
    keypoints = KeyPoints(
        format="",
        source="",
        layout=coco,
        pictures=("a",),
        frame=np.zeros(1, np.intp),
        points=rng.uniform(1, 9, (1, 17, 2)),
    )
    write_keypoints(tmp_path / "a.json", keypoints, "coco-wholebody")
    read = read_keypoints(tmp_path / "a.json")
    np.testing.assert_array_equal(read.points[:, :17], keypoints.points)
    with pytest.raises(InputError, match="coco_wholebody_133"):
        read_keypoints(tmp_path / "a.json", layout=coco)


ZEROS = {name: [0] * (3 * count) for name, count in PARTS}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            document([ZEROS | {"foot_kpts": [1, 2, 2]}]),
            r"annotations\[0\].foot_kpts: got 3 numbers; expected 18",
        ),
        (document([ZEROS | {"face_kpts": "x"}]), r"face_kpts: got \"x\""),
        (
            document([ZEROS | {"face_kpts": [1, "x", 2] * 68}]),
            r"annotations\[0\].face_kpts\[1\]: got \"x\"",
        ),
        (document([ZEROS | {"keypoints": [1, 2, 3] * 17}]), "v: got 3"),
        (document([ZEROS | {"keypoints": [1, 2, -0.5] * 17}]), "v: got -0.5"),
        (document([ZEROS | {"image_id": 9}]), "image_id: got 9"),
        ([3], r"\[0\]: got 3"),
        ({"images": []}, "annotations"),
        ("text", "annotations"),
    ],
)
def test_damaged_files_are_told_in_one_line(tmp_path: Path, content: object, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        read_keypoints(save(tmp_path / "x.json", content), "coco-wholebody")
    assert "\n" not in str(caught.value)
