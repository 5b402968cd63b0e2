"""AlphaPose: the flat list, the layouts by pictures, who is who, and damage."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.formats.keypoints import KeyPoints
from posekit.formats.keypoints.reading import read_keypoints
from posekit.formats.skeleton_maps import load_skeleton_map
from tests.detector_files import suiting, write_keypoints


def row(name: str, count: int = 17, **more: Any) -> dict[str, Any]:
    """Return a person in a picture: point k at (k + 1, 10 k), sure by 2.5."""
    flat = [value for k in range(count) for value in (k + 1.0, 10.0 * k, 2.5)]
    return {"image_id": name, "category_id": 1, "keypoints": flat, "score": 3.1, **more}


def saved(path: Path, document: object) -> Path:
    path.write_text(json.dumps(document))
    return path


@given(seed=st.integers(0, 2**32 - 1), names=st.sampled_from(["coco_17", "halpe_26", "halpe_136"]))
def test_what_is_written_is_read_again(seed: int, names: str, tmp_path_factory: Any) -> None:
    rng = np.random.default_rng(seed)
    layout = load_skeleton_map(names)
    frame = np.sort(np.concatenate([np.arange(4), rng.integers(0, 4, 3)]))
    count = (len(frame), len(layout.points))
    points = np.where(rng.random((*count, 1)) < 0.2, np.nan, rng.uniform(-50, 2000, (*count, 2)))
    there = KeyPoints(
        format="test",
        source="test",
        layout=layout,
        pictures=tuple(f"{k}.jpg" for k in (1, 2, 10, 11)),
        frame=frame,
        points=points,
        confidence=np.where(
            np.isnan(points[..., 0]) | (rng.random(count) < 0.1), np.nan, rng.uniform(0, 6, count)
        ),
        person=rng.integers(-1, 9, len(frame)),
        score=np.where(rng.random(len(frame)) < 0.3, np.nan, rng.random(len(frame))),
    )
    path = tmp_path_factory.mktemp("alphapose") / "alphapose-results.json"
    write_keypoints(path, there, "alphapose")
    assert suiting(path) == ["alphapose"]
    back = read_keypoints(path)
    assert (back.layout.name, back.pictures) == (names, there.pictures)
    for name in ("frame", "points", "confidence", "person", "score"):
        np.testing.assert_array_equal(getattr(back, name), getattr(there, name))


@pytest.mark.parametrize(
    ("count", "name"), [(17, "coco_17"), (26, "halpe_26"), (68, "halpe_68"), (136, "halpe_136")]
)
def test_the_number_of_points_tells_the_layout(count: int, name: str, tmp_path: Path) -> None:
    found = read_keypoints(saved(tmp_path / "a.json", [row("1.jpg", count)]))
    assert (found.layout.name, len(found.layout.points)) == (name, count)
    assert found.confidence.max() == 2.5, "old models' confidences stay as they are"
    assert np.isfinite(found.landmarks[0, :, 0]).sum() >= 17


def test_sixty_eight_points_have_hands_and_no_face(tmp_path: Path) -> None:
    points = read_keypoints(saved(tmp_path / "a.json", [row("1.jpg", 68)])).layout.points
    assert points[26] == "left_hand_root"
    assert points[-1] == "right_pinky_finger4"


@pytest.mark.parametrize(
    ("idx", "person"),
    [
        (3, 3),
        (2.0, 2),
        ([5, 6], 5),
        ([[4.0], [1.0]], 4),
        ([], -1),
        (None, -1),
        ("x", -1),
        (-2, -1),
        (True, -1),
    ],
)
def test_who_it_is_may_be_a_list(idx: object, person: int, tmp_path: Path) -> None:
    found = read_keypoints(saved(tmp_path / "a.json", [row("1.jpg", idx=idx)]))
    assert found.person.tolist() == [person]


def test_pictures_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    people = [row(f"{k}.jpg") for k in (10, 2, 2, 1)]
    found = read_keypoints(saved(tmp_path / "a.json", people))
    assert found.pictures == ("1.jpg", "2.jpg", "10.jpg")
    assert found.frame.tolist() == [0, 1, 1, 2]


def test_a_point_at_zero_three_times_is_missing(tmp_path: Path) -> None:
    person = row("1.jpg")
    person["keypoints"][6:9] = [0, 0, 0]
    person["keypoints"][9:12] = [0, 0, 0.5]
    found = read_keypoints(saved(tmp_path / "a.json", [person]))
    assert np.flatnonzero(np.isnan(found.points[0, :, 0])).tolist() == [2]
    assert found.points[0, 3].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(("people", "points"), [("bodies", "joints"), ("people", "pose_keypoints_2d")])
def test_the_layouts_by_pictures(people: str, points: str, tmp_path: Path) -> None:
    flat = row("", 18)["keypoints"]
    document = {
        "2.jpg": {"version": "AlphaPose v0.3", people: []},
        "1.jpg": {"version": "AlphaPose v0.3", people: [{points: flat}, {points: flat}]},
    }
    path = saved(tmp_path / "alphapose-results.json", document)
    assert suiting(path) == ["alphapose"]
    found = read_keypoints(path)
    assert (found.layout.name, found.pictures, found.frame.tolist()) == (
        "coco_18",
        ("1.jpg", "2.jpg"),
        [0, 0],
    )


def test_a_file_a_picture_of_cmu(tmp_path: Path) -> None:
    for k in (1, 2):
        saved(tmp_path / f"{k}.json", {"version": 0.1, "bodies": [{"joints": row("", 18)["keypoints"]}] * k})
    assert suiting(tmp_path) == ["alphapose"]
    assert read_keypoints(tmp_path).frame.tolist() == [0, 1, 1]


def test_other_points_become_coco(tmp_path: Path) -> None:
    layout = load_skeleton_map("body_25")
    points = np.random.default_rng(0).uniform(1, 900, (1, 25, 2))
    there = KeyPoints(
        format="t", source="t", layout=layout, pictures=("a",), frame=np.zeros(1, int), points=points
    )
    write_keypoints(tmp_path / "a.json", there, "alphapose")
    back = read_keypoints(tmp_path / "a.json")
    assert back.layout.name == "coco_17"
    np.testing.assert_array_equal(back.landmarks[:, :19], there.landmarks[:, :19])


BAD: dict[str, tuple[object, str]] = {
    "numbers missing": ([{**row("a"), "keypoints": [1.0, 2.0]}], "got 2 numbers; expected a multiple of 3"),
    "text": ([{**row("a"), "keypoints": ["1"] * 51}], r"got \"1\" at place 0"),
    "none": ([{**row("a"), "keypoints": []}], "got 0 numbers"),
    "huge": ([{**row("a"), "keypoints": [1e12] * 51}], "at most 1e"),
    "two models": ([row("a"), row("b", 26)], "26 points after one of 17"),
    "another number": ([row("a", 16)], "16 a person, unnamed; expected 17, 26, 68, 136 points"),
    "no person": ([row("a"), {"image_id": "a"}], r"\[1\]: got an object"),
    "no picture": ({"a": {"bodies": []}, "b": 3}, "b: got 3; expected bodies or people"),
    "no points": ({"a": {"bodies": [{}]}}, "got null; expected a list of numbers"),
    "no body": ({"a": {"bodies": [1]}}, r"bodies\[0\]: got 1"),
}


@pytest.mark.parametrize("case", BAD)
def test_damage_is_told_in_one_line(case: str, tmp_path: Path) -> None:
    document, told = BAD[case]
    with pytest.raises(InputError, match=told) as caught:
        read_keypoints(saved(tmp_path / "a.json", document), "alphapose")
    assert "\n" not in str(caught.value)


def test_a_map_of_another_number_of_points_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="17 a person; expected 25, as the skeleton map body_25 has"):
        read_keypoints(
            saved(tmp_path / "a.json", [row("a")]), "alphapose", layout=load_skeleton_map("body_25")
        )
