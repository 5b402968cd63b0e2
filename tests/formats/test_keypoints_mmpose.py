"""MMPose: both layouts, names or numbers, round trips, and files that are damaged."""

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
from posekit.formats.keypoints.head_share import HEAD_COCO, HEAD_H36M, head_share
from posekit.formats.keypoints.reading import read_keypoints
from posekit.formats.skeleton_maps import load_skeleton_map, skeleton_map_of
from posekit.tables.file_model import validated
from posekit.tables.skeleton_map import SkeletonMapTable
from tests.detector_files import suiting, write_keypoints

COCO, H36M, HALPE = map(load_skeleton_map, ("coco_17", "h36m_17", "halpe_26"))
STANDING = {
    "nose": (50, 10),
    "left_eye": (52, 8),
    "right_eye": (48, 8),
    "left_ear": (55, 9),
    "right_ear": (45, 9),
    "left_shoulder": (65, 30),
    "right_shoulder": (35, 30),
    "left_elbow": (70, 55),
    "right_elbow": (30, 55),
    "left_wrist": (72, 75),
    "right_wrist": (28, 75),
    "left_hip": (58, 80),
    "right_hip": (42, 80),
    "left_knee": (58, 120),
    "right_knee": (42, 120),
    "left_ankle": (58, 160),
    "right_ankle": (42, 160),
}
AS_H36M = {
    "root": (50, 80),
    "spine": (50, 55),
    "thorax": (50, 30),
    "neck_base": (50, 20),
    "head": (50, 5),
    "left_foot": (58, 160),
    "right_foot": (42, 160),
}


def person(names: tuple[str, ...]) -> dict[str, Any]:
    """Return somebody who stands, as MMPose writes one."""
    places = {**STANDING, **AS_H36M}
    points = [[float(x) for x in places.get(name, (50, 90))] for name in names]
    scores = [0.9] * len(names)
    return {
        "keypoints": points,
        "keypoint_scores": scores,
        "bbox": [[20.0, 0.0, 80.0, 170.0]],
        "bbox_score": 0.8,
    }


def demo(names: tuple[str, ...], info: list[Any]) -> dict[str, Any]:
    """Return a demo's document."""
    return {
        "meta_info": {"keypoint_id2name": {str(k): name for k, name in enumerate(names)}},
        "instance_info": info,
    }


def saved(path: Path, document: object) -> Path:
    path.write_text(json.dumps(document))
    return path


def random_people(seed: int, names: str, scores: bool = True) -> KeyPoints:
    """Make key points with holes, ids and pictures without people."""
    rng = np.random.default_rng(seed)
    layout = load_skeleton_map(names)
    frame = np.sort(rng.integers(0, 6, int(rng.integers(0, 9))))
    count = (len(frame), len(layout.points))
    points = np.where(rng.random((*count, 1)) < 0.2, np.nan, rng.uniform(-50, 2000, (*count, 2)))
    confidence = np.where(np.isnan(points[..., 0]), np.nan, rng.uniform(0.01, 1.2, count))
    return KeyPoints(
        format="test",
        source="test",
        layout=layout,
        pictures=tuple(str(k) for k in range(3, 9)),
        frame=frame,
        points=points,
        confidence=confidence,
        person=rng.integers(-1, 4, len(frame)),
        score=np.where(rng.random(len(frame)) < 0.5, np.nan, rng.random(len(frame)))
        if scores
        else np.empty(0),
    )


@given(
    seed=st.integers(0, 2**32 - 1),
    case=st.sampled_from(
        [
            ("mmpose", "coco_17"),
            ("mmpose", "halpe_26"),
            ("mmpose", "body_25"),
            ("mmpose", "mediapipe_33"),
            ("mmpose-list", "halpe_26"),
            ("mmpose-list", "coco_wholebody_133"),
        ]
    ),
)
def test_what_is_written_is_read_again(seed: int, case: tuple[str, str], tmp_path_factory: Any) -> None:
    format_, names = case
    there = random_people(seed, names)
    path = tmp_path_factory.mktemp("mmpose") / "predictions.json"
    write_keypoints(path, there, format_)
    assert suiting(path) == [format_]
    back = read_keypoints(path)
    if len(there) or format_ == "mmpose":
        assert back.layout.name == names
        np.testing.assert_array_equal(back.points, there.points)
        np.testing.assert_array_equal(back.confidence, there.confidence)
    for name in ("frame", "person", "score"):
        np.testing.assert_array_equal(getattr(back, name), getattr(there, name))
    assert back.pictures == there.pictures


def test_the_demo_of_a_video(tmp_path: Path) -> None:
    frames = [
        {"frame_id": 2, "instances": []},
        {"frame_id": 1, "instances": [person(HALPE.points), person(HALPE.points)]},
    ]
    found = read_keypoints(saved(tmp_path / "results_clip.json", demo(HALPE.points, frames)))
    assert (found.format, found.layout.name, found.pictures) == ("mmpose", "halpe_26", ("1", "2"))
    assert found.frame.tolist() == [0, 0]
    assert found.score.tolist() == [0.8, 0.8]
    assert found.landmarks[0, 0].tolist() != [50.0, 90.0], "the neck of a detector is no joint"


def test_the_demo_of_a_picture_lists_its_people(tmp_path: Path) -> None:
    found = read_keypoints(
        saved(tmp_path / "results_photo.json", demo(COCO.points, [person(COCO.points)] * 3))
    )
    assert (found.pictures, len(found)) == (("results_photo",), 3)


def test_names_in_another_order_find_their_landmarks(tmp_path: Path) -> None:
    names = tuple(reversed(COCO.points))
    found = read_keypoints(saved(tmp_path / "r.json", demo(names, [person(names)])))
    wanted = COCO.gather(np.array([[STANDING[name] for name in COCO.points]], dtype=float))
    np.testing.assert_array_equal(found.landmarks, wanted)
    assert found.layout.points == names


def test_names_of_ones_own_need_a_map(tmp_path: Path) -> None:
    path = saved(tmp_path / "r.json", demo(("a", "b", "c", "d"), [person(("a", "b", "c", "d"))]))
    with pytest.raises(InputError, match=r'got names as "a", "b", "c", "d"; expected .* --skeleton'):
        read_keypoints(path)
    own = {"left_hip": "A", "right_hip": "b", "left_knee": "c", "right_knee": "d"}
    layout = skeleton_map_of(
        validated(SkeletonMapTable, {"schema": "posekit.skeleton_map/1", "landmarks": own}, "own"), "own"
    )
    assert np.isfinite(read_keypoints(path, layout=layout).landmarks[0]).all(axis=-1).sum() == 4


def test_the_inferencer_of_a_folder(tmp_path: Path) -> None:
    for k in (10, 9):
        saved(tmp_path / f"img_{k}.json", [person(HALPE.points)] * (k - 8))
    found = read_keypoints(tmp_path)
    assert (found.format, found.pictures, found.frame.tolist()) == (
        "mmpose-list",
        ("img_9", "img_10"),
        [0, 1, 1],
    )


@pytest.mark.parametrize("layout", [COCO, H36M], ids=lambda one: one.name)
def test_seventeen_points_are_told_by_the_head(layout: Any, tmp_path: Path) -> None:
    path = saved(tmp_path / "v.json", [{"frame_id": 0, "instances": [person(layout.points)]}])
    assert read_keypoints(path).layout.name == layout.name


def test_seventeen_points_that_could_be_either_name_both(tmp_path: Path) -> None:
    somebody = person(COCO.points)
    somebody["keypoints"][1] = [50.0, 70.0]
    assert HEAD_COCO < head_share(np.array([somebody["keypoints"]])) < HEAD_H36M
    path = saved(tmp_path / "v.json", [somebody])
    with pytest.raises(InputError, match="coco_17 or h36m_17; say which with --skeleton"):
        read_keypoints(path)
    assert read_keypoints(path, layout=COCO).layout.name == "coco_17"
    assert read_keypoints(path, "mmpose-list-h36m_17").layout.name == "h36m_17"


def test_a_point_without_score_is_missing(tmp_path: Path) -> None:
    somebody = person(HALPE.points)
    somebody["keypoint_scores"][3:5] = [0.0, -0.1]
    found = read_keypoints(saved(tmp_path / "v.json", [somebody]))
    assert np.flatnonzero(np.isnan(found.points[0, :, 0])).tolist() == [3, 4]
    assert np.isnan(found.confidence[0, 3:5]).all()


def test_another_layout_becomes_the_nearest_that_can_be_told(tmp_path: Path) -> None:
    there = random_people(4, "body_25")
    write_keypoints(tmp_path / "v.json", there, "mmpose-list")
    back = read_keypoints(tmp_path / "v.json", layout=COCO)
    seen = there.landmarks[:, :19]
    kept = np.isfinite(back.landmarks[:, :19])
    np.testing.assert_array_equal(back.landmarks[:, :19][kept], seen[kept])
    assert kept.sum() == np.isfinite(seen).sum()


BAD: dict[str, tuple[object, str]] = {
    "three coordinates": (
        [{**person(HALPE.points), "keypoints": [[1.0, 2.0, 3.0]] * 26}],
        "three: points in space",
    ),
    "too few scores": ([{**person(HALPE.points), "keypoint_scores": [0.5]}], "got 1 scores; expected 26"),
    "text": ([{**person(HALPE.points), "keypoints": [["1", "2"]] * 26}], "at place 0; expected a list"),
    "true": ([{**person(HALPE.points), "keypoint_scores": [True] * 26}], "got true at place 0"),
    "huge": ([{**person(HALPE.points), "keypoints": [[1e30, 0.0]] * 26}], "at most 1e"),
    "points of two lengths": ([{**person(HALPE.points), "keypoints": [[1.0], [1.0, 2.0]]}], "1 to 2 numbers"),
    "no points": ([{**person(HALPE.points), "keypoints": []}], "got a list of 0|got \\[\\]"),
    "people of two models": ([person(HALPE.points), person(COCO.points)], "17 points after one of 26"),
    "unknown number": ([person(HALPE.points[:9])], "9 a person, unnamed; expected 17, 26, 133, 136"),
    "no person": ([person(HALPE.points), 3], "expected keypoints and keypoint_scores"),
    "number of a picture": (
        [{"frame_id": 0, "instances": []}, {"frame_id": [1], "instances": []}],
        "picture's number",
    ),
    "no picture": ([{"frame_id": 0, "instances": []}, []], r"\[1\]: got \[\]; expected a picture"),
}


@pytest.mark.parametrize("case", BAD)
def test_damage_is_told_in_one_line(case: str, tmp_path: Path) -> None:
    document, told = BAD[case]
    with pytest.raises(InputError, match=told) as caught:
        read_keypoints(saved(tmp_path / "v.json", document), "mmpose-list")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"meta_info": {}}, "keypoint_id2name: got null"),
        ({"meta_info": {"keypoint_id2name": {"0": 3}}}, "keypoint_id2name.0: got 3; expected a name"),
        ({"meta_info": {"keypoint_id2name": {"1": "nose"}}}, "keypoint_id2name.0: got null"),
        ({"meta_info": {"keypoint_id2name": dict.fromkeys("012", "nose")}}, "3 names in meta_info"),
        ({"instance_info": {}}, "instance_info: got an object"),
    ],
)
def test_a_demo_without_its_names_is_refused(change: dict[str, Any], told: str, tmp_path: Path) -> None:
    document = {**demo(COCO.points, [person(COCO.points)]), **change}
    with pytest.raises(InputError, match=told):
        read_keypoints(saved(tmp_path / "r.json", document))


def test_a_truncated_file_is_told(tmp_path: Path) -> None:
    path = saved(tmp_path / "r.json", demo(COCO.points, [person(COCO.points)]))
    path.write_text(path.read_text()[:-40])
    with pytest.raises(InputError, match="expected JSON"):
        read_keypoints(path)
