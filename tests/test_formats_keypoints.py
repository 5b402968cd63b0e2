"""Key points: every detector's file gives the same people, missing points are missing, and time is kept."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.cameras import PinholeCamera
from posekit.errors import InputError
from posekit.formats.layout import load_layout

COCO = load_layout("coco_17").points
UP = {
    "nose": (0, 160),
    "left_eye": (3, 163),
    "right_eye": (-3, 163),
    "left_ear": (7, 161),
    "right_ear": (-7, 161),
    "left_shoulder": (18, 140),
    "right_shoulder": (-18, 140),
    "left_elbow": (27, 115),
    "right_elbow": (-27, 113),
    "left_wrist": (30, 90),
    "right_wrist": (-29, 92),
    "left_hip": (10, 92),
    "right_hip": (-10, 92),
    "left_knee": (12, 50),
    "right_knee": (-12, 49),
    "left_ankle": (13, 8),
    "right_ankle": (-13, 9),
}
"""A person who faces the camera, centimetres: right on the picture's left."""
FRAMES = 6


def person(frame: int, x: float = 300.0, scale: float = 2.0) -> dict[str, tuple[float, float]]:
    """Return a person's points in a picture, pixels."""
    return {name: (x + scale * (a + 1.5 * frame), 400 - scale * b) for name, (a, b) in UP.items()}


def triples(points: dict[str, tuple[float, float]], names: tuple[str, ...], sure: float = 0.9) -> list[float]:
    return [number for name in names for number in ((*points[name], sure) if name in points else (0, 0, 0))]


def coco(path: Path) -> Path:
    images = [{"id": k, "file_name": f"{k:04}.png", "width": 640, "height": 480} for k in range(FRAMES)]
    people = [
        {"image_id": k, "category_id": 1, "keypoints": triples(person(k), COCO, 2), "num_keypoints": 17}
        for k in range(FRAMES)
    ]
    categories = [{"id": 1, "name": "person", "keypoints": list(COCO)}]
    return dumped(path / "coco.json", {"images": images, "annotations": people, "categories": categories})


def coco_results(path: Path) -> Path:
    people = [
        {"image_id": k, "category_id": 1, "keypoints": triples(person(k), COCO), "score": 1.0}
        for k in range(FRAMES)
    ]
    return dumped(path / "results.json", people)


def alphapose(path: Path) -> Path:
    people = [
        {
            "image_id": f"{k}.jpg",
            "category_id": 1,
            "keypoints": triples(person(k), COCO),
            "score": 2.9,
            "idx": [1],
        }
        for k in range(FRAMES)
    ]
    return dumped(path / "alphapose.json", people)


def wholebody(path: Path) -> Path:
    parts = {"foot_kpts": 6, "face_kpts": 68, "lefthand_kpts": 21, "righthand_kpts": 21}
    people = [
        {
            "image_id": k,
            "keypoints": triples(person(k), COCO),
            **{name: [0.0] * 3 * count for name, count in parts.items()},
        }
        for k in range(FRAMES)
    ]
    return dumped(path / "wholebody.json", people)


def instance(k: int) -> dict[str, Any]:
    points = person(k)
    return {
        "keypoints": [list(points[name]) for name in COCO],
        "keypoint_scores": [0.9] * 17,
        "bbox": [[0, 0, 9, 9]],
    }


def mmpose(path: Path) -> Path:
    names = {"keypoint_id2name": {str(k): name for k, name in enumerate(COCO)}}
    frames = [{"frame_id": k + 1, "instances": [instance(k)]} for k in range(FRAMES)]
    return dumped(path / "mmpose.json", {"meta_info": names, "instance_info": frames})


def inferencer(path: Path) -> Path:
    for k in range(FRAMES):
        dumped(path / f"{k:06}.json", [instance(k)])
    return path


def openpose(path: Path) -> Path:
    names = {"left": "L", "right": "R"}
    order = load_layout("body_25").points
    for k in range(FRAMES):
        points = {
            name if name == "nose" else names[name.partition("_")[0]] + name.partition("_")[2].title(): point
            for name, point in person(k).items()
        }
        points["Nose"] = points.pop("nose")
        for middle, part in (("Neck", "Shoulder"), ("MidHip", "Hip")):
            points[middle] = tuple(np.mean([points["L" + part], points["R" + part]], axis=0))
        one = {"person_id": [-1], "pose_keypoints_2d": triples(points, order)}
        dumped(path / f"clip_{k:012}_keypoints.json", {"version": 1.3, "people": [one]})
    return path


def halpe(path: Path) -> Path:
    people = [
        {"image_id": k, "keypoints": triples(person(k), load_layout("halpe_26").points)}
        for k in range(FRAMES)
    ]
    for one, k in zip(people, range(FRAMES), strict=True):
        points = person(k)
        for name, part in (("neck", "shoulder"), ("hip", "hip")):
            middle = np.mean([points[f"left_{part}"], points[f"right_{part}"]], axis=0)
            at = 3 * load_layout("halpe_26").points.index(name)
            one["keypoints"][at : at + 3] = [*middle, 0.9]
    return dumped(path / "halpe.json", people)


def mediapipe(path: Path) -> Path:
    names = load_layout("mediapipe_33").points
    frames = []
    for k in range(FRAMES):
        points = person(k)
        marks = [
            {"x": x / 640, "y": y / 480, "z": -0.1, "visibility": 0.9}
            for x, y in (points.get(name, points["nose"]) for name in names)
        ]
        frames.append({"frame": k, "timestamp_ms": 40 * k, "pose_landmarks": marks})
    return dumped(path / "mediapipe.json", {"width": 640, "height": 480, "frames": frames})


def deeplabcut(path: Path) -> Path:
    lines = ["scorer" + ",net" * 51]
    lines.append("bodyparts," + ",".join(name for name in COCO for _ in range(3)))
    lines.append("coords" + ",x,y,likelihood" * 17)
    lines += [f"{k}," + ",".join(map(repr, triples(person(k), COCO))) for k in range(FRAMES)]
    return written(path / "dlc.csv", lines)


def sleap(path: Path) -> Path:
    lines = [
        "track,frame_idx,instance.score,"
        + ",".join(f"{name}.{part}" for name in COCO for part in ("x", "y", "score"))
    ]
    lines += [f"track_0,{k},0.9," + ",".join(map(repr, triples(person(k), COCO))) for k in range(FRAMES)]
    return written(path / "sleap.csv", lines)


def caliscope(path: Path) -> Path:
    """Write points of two cameras; the other one, port 1, sees the person 40 px to the right."""
    lines = ["sync_index,port,frame_index,frame_time,point_id,img_loc_x,img_loc_y,obj_loc_x,obj_loc_y"]
    names = load_layout("mediapipe_33").points
    for k in range(FRAMES):
        for port in (0, 1):
            points = person(k, 300.0 + 40 * port)
            lines += [
                f"{k},{port},{k},{50.5 + 0.04 * k},{names.index(name)},{x!r},{y!r},,"
                for name, (x, y) in points.items()
            ]
            lines.append(f"{k},{port},{k},{50.5 + 0.04 * k},400,1.0,2.0,,")  # of a hand
    return written(path / "xy_HOLISTIC.csv", lines)


def dumped(path: Path, document: Any) -> Path:
    path.write_text(json.dumps(document))
    return path


def written(path: Path, lines: list[str]) -> Path:
    path.write_text("\n".join(lines) + "\n")
    return path


FORMATS = (
    *(coco, coco_results, alphapose, wholebody, mmpose, inferencer, openpose, halpe),
    *(mediapipe, deeplabcut, sleap),
)


@pytest.mark.parametrize("make", FORMATS, ids=lambda make: make.__name__)
def test_all_formats_hold_the_same_people(make: Callable[[Path], Path], tmp_path: Path) -> None:
    found = posekit.open(make(tmp_path))
    assert isinstance(found, posekit.Detections)
    assert found.film and found.frame.tolist() == list(range(FRAMES))
    for k in range(FRAMES):
        expected = person(k)
        for name, point in expected.items():
            assert found.points[k, found.names.index(name)] == pytest.approx(point, abs=1e-9)
        shoulders, hips = (
            np.mean([expected[f"{side}_{part}"] for side in ("left", "right")], axis=0)
            for part in ("shoulder", "hip")
        )
        assert found.points[k, found.names.index("neck")] == pytest.approx(shoulders, abs=1e-9)
        pelvis = found.points[k, found.names.index("pelvis")]
        share = (pelvis - shoulders) @ (hips - shoulders) / ((hips - shoulders) @ (hips - shoulders))
        assert 0.75 < share < 0.9  # the pelvis joint is above the line of the hips
    assert set(found.derived) == {"neck", "pelvis"}
    expected_sure = np.nan if make is coco else 0.9
    assert np.nan_to_num(found.confidence[:, 0], nan=-1) == pytest.approx(
        np.nan_to_num(expected_sure, nan=-1)
    )


@pytest.mark.parametrize(
    "lost", [(0.0, 0.0, 0.0), (-1.0, -1.0, 0.0), (350.0, 200.0, 0.0), (0.0, 0.0, 0.4), (None, None, 0.4)]
)
@pytest.mark.parametrize(
    "make", [coco_results, alphapose, openpose, deeplabcut], ids=lambda make: make.__name__
)
def test_a_missing_point_is_missing_wherever_it_lies(
    make: Callable[[Path], Path], lost: tuple[Any, ...], tmp_path: Path
) -> None:
    path = make(tmp_path)
    if path.suffix == ".csv":
        lines = path.read_text().splitlines()
        cells = lines[3].split(",")
        at = 1 + 3 * COCO.index("left_wrist")
        cells[at : at + 3] = ["" if one is None else repr(one) for one in lost]
        written(path, [*lines[:3], ",".join(cells), *lines[4:]])
    else:
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        document = json.loads(files[0].read_text())
        holder = document["people"][0] if isinstance(document, dict) else document[0]
        field = "pose_keypoints_2d" if "pose_keypoints_2d" in holder else "keypoints"
        at = 3 * (
            load_layout("body_25").points.index("LWrist") if path.is_dir() else COCO.index("left_wrist")
        )
        holder[field][at : at + 3] = lost
        dumped(files[0], document)
    found = posekit.open(path)
    wrist = found.points[:, found.names.index("left_wrist"), 0]
    assert np.isnan(wrist).tolist() == [True] + [False] * (FRAMES - 1)
    assert np.isfinite(found.points[0, found.names.index("right_wrist")]).all()


def test_pictures_left_out_keep_their_place(tmp_path: Path) -> None:
    for make in (openpose, coco_results, mmpose):
        folder = tmp_path / make.__name__
        folder.mkdir()
        path = make(folder)
        if path.is_dir():
            sorted(path.iterdir())[2].unlink()
        else:
            document = json.loads(path.read_text())
            del (document if isinstance(document, list) else document["instance_info"])[2]
            dumped(path, document)
        found = posekit.open(path, rate=25)
        assert found.frame.tolist() == [0, 1, 3, 4, 5]
        view = found.view(camera())
        assert len(view) == FRAMES and np.isnan(view.image[2]).all()
        assert np.diff(view.time) == pytest.approx(1 / 25)


def test_unrelated_photographs_are_no_film(tmp_path: Path) -> None:
    people = [
        {"image_id": number, "keypoints": triples(person(0, x, scale), COCO)}
        for number, x, scale in (
            (785, 100.0, 1.0),
            (40083, 300.0, 2.5),
            (196141, 500.0, 1.7),
            (397133, 90.0, 0.6),
        )
    ]
    found = posekit.open(dumped(tmp_path / "photos.json", people))
    assert not found.film and found.frame.tolist() == [0, 1, 2, 3]
    for one in people:  # the same people in pictures that are numbered one after another
        one["image_id"] = [785, 40083, 196141, 397133].index(one["image_id"])
    assert not posekit.open(dumped(tmp_path / "numbered.json", people)).film


@pytest.mark.parametrize(
    ("name", "step"),
    [("time", 0.04), ("timestamp", 0.04), ("timestamp", 40), ("timestamp", 40_000), ("timestamp_us", 40_000)],
)
def test_timestamps_have_the_unit_of_their_steps(tmp_path: Path, name: str, step: float) -> None:
    document = json.loads(mediapipe(tmp_path).read_text())
    for k, frame in enumerate(document["frames"]):
        del frame["timestamp_ms"]
        frame[name] = 1e6 + k * step
    found = posekit.open(dumped(tmp_path / "times.json", document))
    assert found.time is not None and np.diff(found.time) == pytest.approx(0.04, rel=1e-5)


def test_times_of_the_file_win_over_the_rate(tmp_path: Path) -> None:
    found = posekit.open(mediapipe(tmp_path), rate=60)
    with pytest.warns(UserWarning, match="times are 25 frames per second, not 60"):
        assert np.diff(found.view(camera()).time) == pytest.approx(0.04)


def test_caliscope_s_table_holds_one_person_seen_by_several_cameras(tmp_path: Path) -> None:
    found = posekit.open(caliscope(tmp_path))
    for port in (0, 1):
        view = found.view(camera(name=f"cam_{port}"))
        assert view.image[2, 1] == pytest.approx(person(2, 300 + 40 * port)["right_shoulder"])
        assert np.diff(view.time) == pytest.approx(0.04)
        assert found.view(camera(), person=str(port)).image[2] == pytest.approx(view.image[2], nan_ok=True)
    with pytest.raises(InputError, match="points of cameras 0, 1; expected one of them"):
        found.view(camera())


def camera(name: str = "cam", **fields: Any) -> PinholeCamera:
    return PinholeCamera(K=[[600, 0, 320], [0, 600, 240], [0, 0, 1]], size=(640, 480), name=name, **fields)


def test_people_are_told_apart_where_they_cross(tmp_path: Path) -> None:
    people, truth = [], []
    for k in range(30):
        two = [(person(0, 100 + 14 * k), 0), (person(0, 500 - 14 * k, 1.2), 1)]
        for points, who in two if k % 2 else two[::-1]:
            people.append({"image_id": k, "keypoints": triples(points, COCO)})
            truth.append(who)
    found = posekit.open(dumped(tmp_path / "two.json", people))
    rows = found.person_rows("largest")
    assert [truth[row] for row in rows] == [0] * 30
    other = found.person_rows(1 if truth[0] == 0 else 0)
    assert [truth[row] for row in other] == [1] * 30
    with pytest.raises(InputError, match='person: got "7"; expected largest, surest, first'):
        found.person_rows(7)


def test_a_tracker_s_inventions_outside_the_picture_are_not_seen(tmp_path: Path) -> None:
    document = json.loads(mediapipe(tmp_path).read_text())
    names = load_layout("mediapipe_33").points
    for frame in document["frames"]:
        for name in ("left_ankle", "right_ankle"):
            frame["pose_landmarks"][names.index(name)] |= {"y": 1.55, "visibility": 0.0006}
        frame["pose_landmarks"][names.index("left_wrist")] |= {"x": 1.2, "visibility": 0.9}
    view = posekit.open(dumped(tmp_path / "legs.json", document)).view(camera())
    seen = np.isfinite(view.image[..., 0]).all(axis=0)
    assert [posekit.skeleton.JOINTS[k] for k in np.flatnonzero(~seen)] == ["right_ankle", "left_ankle"]


def test_fractions_need_the_size_of_the_picture(tmp_path: Path) -> None:
    document = json.loads(mediapipe(tmp_path).read_text())
    del document["width"]
    found = posekit.open(dumped(tmp_path / "fractions.json", document))
    with pytest.raises(InputError, match="size: got points that are fractions of the picture"):
        found.view()
    assert found.view(camera()).image[0, 1] == pytest.approx(person(0)["right_shoulder"])


UPRIGHT = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""World to camera of a level camera in a world whose z points up."""


@pytest.mark.parametrize(
    ("R", "up", "said"),
    [
        (UPRIGHT, "+z", None),
        (UPRIGHT, "-y", "lies"),  # the camera looks along this axis, and sees the person from the side
        (UPRIGHT.T, "+z", "stands on the head"),  # camera to world
        (np.diag([1.0, -1, -1]) @ UPRIGHT, "+z", "stands on the head"),  # axes of OpenGL
        (UPRIGHT, "-z", "stands on the head"),
        (UPRIGHT, "+x", "lies"),
        (UPRIGHT, "+y", "lies"),
        (UPRIGHT, "", None),
    ],
)
def test_a_calibration_by_which_the_person_does_not_stand_is_told(
    R: Any, up: str, said: str | None, tmp_path: Path
) -> None:
    found = posekit.open(coco_results(tmp_path))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found.view(camera(R=R, t=[0.0, 0, 3], up=up), rate=30)
    lines = [str(one.message) for one in told]
    assert (len(lines) == 1 and said in lines[0]) if said else not lines


def test_a_picture_with_y_up_is_told(tmp_path: Path) -> None:
    people = json.loads(coco_results(tmp_path).read_text())
    for one in people:
        one["keypoints"][1::3] = [480 - y for y in one["keypoints"][1::3]]
    found = posekit.open(dumped(tmp_path / "yup.json", people))
    with pytest.warns(UserWarning, match="upside down"):
        found.view(rate=30)


def test_a_film_without_a_rate_has_an_assumed_one_and_says_so(tmp_path: Path) -> None:
    found = posekit.open(coco_results(tmp_path))
    with pytest.warns(UserWarning, match="30 pictures a second are assumed"):
        view = found.view()
    np.testing.assert_allclose(np.diff(view.time), 1 / 30)


def test_a_calibration_of_other_pictures_is_refused(tmp_path: Path) -> None:
    found = posekit.open(coco(tmp_path))
    with pytest.raises(InputError, match="size: got 320x240 pixels"):
        found.view(PinholeCamera(K=[[300, 0, 160], [0, 300, 120], [0, 0, 1]], size=(320, 240)))
    with pytest.raises(InputError, match=r"a focal length of 1\.2 px"):
        found.view(PinholeCamera(K=[[1.2, 0, 320], [0, 1.2, 240], [0, 0, 1]], size=(640, 480)))


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (
            lambda people: people[1]["keypoints"].append(1.0),
            r"\[1\].keypoints: got 52 numbers; expected a list",
        ),
        (
            lambda people: people[1]["keypoints"].__setitem__(4, "x"),
            r"\[1\].keypoints: got a list of 51 entries",
        ),
        (lambda people: people[1].pop("image_id"), r"\[1\].image_id: got nothing; expected this field"),
        (
            lambda people: people[2].update(keypoints=[1.0, 2.0, 0.5] * 18),
            "a person of 18 points after one of 17",
        ),
        (lambda people: people[0]["keypoints"].__setitem__(0, 1e7), "numbers up to 1,000,000"),
        (
            lambda people: [one.update(keypoints=[1.0, 2.0, 0.5] * 21) for one in people],
            "21 points without names",
        ),
    ],
)
def test_damage_is_refused_in_one_line(damage: Callable[[Any], Any], said: str, tmp_path: Path) -> None:
    people = json.loads(coco_results(tmp_path).read_text())
    damage(people)
    with pytest.raises(InputError, match=said) as error:
        posekit.open(dumped(tmp_path / "damaged.json", people))
    assert "\n" not in str(error.value)


def test_two_cameras_in_one_folder_are_refused(tmp_path: Path) -> None:
    for name in ("left", "right"):
        for k in range(3):
            dumped(tmp_path / f"{name}_{k}_keypoints.json", {"people": []})
    with pytest.raises(InputError, match="more than one series of pictures"):
        posekit.open(tmp_path)


def test_a_visibility_of_two_is_no_confidence(tmp_path: Path) -> None:
    """COCO marks annotated points by 2 if they are visible and by 1 if they are hidden; detectors give a share."""
    keypoints = triples(person(0), COCO)
    keypoints[2::3] = [2.0, 1.0, 0.5, *[2.0] * 14]
    people = [{"image_id": 1, "category_id": 1, "keypoints": keypoints, "score": 1.0}]
    found = posekit.open(dumped(tmp_path / "results.json", people))
    confidence = dict(zip(found.names, found.confidence[0].tolist(), strict=True))
    assert np.isnan(confidence["nose"]) and np.isnan(confidence["left_ankle"])
    assert (confidence["left_eye"], confidence["right_eye"]) == (1.0, 0.5)


def test_human36m_is_told_from_coco_by_the_head(tmp_path: Path) -> None:
    names = load_layout("h36m_17").points
    people = []
    for k in range(FRAMES):
        points = person(k)
        middle = {
            part: np.mean([points[f"left_{part}"], points[f"right_{part}"]], axis=0)
            for part in ("hip", "shoulder")
        }
        held = {
            **points,
            "left_foot": points["left_ankle"],
            "right_foot": points["right_ankle"],
            "root": middle["hip"],
        }
        held |= {"thorax": middle["shoulder"], "spine": (middle["hip"] + middle["shoulder"]) / 2}
        held |= {"neck_base": points["nose"], "head": points["left_eye"]}
        people.append({"keypoints": [list(held[name]) for name in names], "keypoint_scores": [0.9] * 17})
    frames = [{"frame_id": k, "instances": [one]} for k, one in enumerate(people)]
    found = posekit.open(dumped(tmp_path / "h36m.json", frames))
    assert found.layout == "h36m_17"
    assert found.points[0, found.names.index("left_ankle")] == pytest.approx(person(0)["left_ankle"])
    assert posekit.open(inferencer(made(tmp_path))).layout == "coco_17"


def made(path: Path) -> Path:
    (path / "inferencer").mkdir()
    return path / "inferencer"
