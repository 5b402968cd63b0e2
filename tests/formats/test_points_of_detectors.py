"""Points in space of detectors and lifters: every layout gives the same joints, and what is ambiguous is refused."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.format import Content
from posekit.formats.held import HeldPostures
from posekit.formats.held_postures import held_postures
from posekit.formats.motion import read_motion
from posekit.formats.motion.amass import SMPL_NAMES
from posekit.formats.recognising import recognise
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.geometry import Array
from posekit.skeleton import JOINTS, POINT

FRAMES = 30
LIMBS = [
    JOINTS.index(f"{side}_{joint}") for side in ("left", "right") for joint in ("knee", "ankle", "elbow")
]


def walked() -> Array:
    """Carry a standing figure, z up, 2 m along x (T, 19, 3)."""
    way = np.linspace(0, 2, FRAMES)[:, None, None] * [1.0, 0.0, 0.0]
    return np.asarray(load_figure().neutral_points[None] + [0.0, 0.0, 1.0] + way)


def middle(joint: str) -> Array:
    points = walked()
    return np.asarray((points[:, POINT[f"right_{joint}"]] + points[:, POINT[f"left_{joint}"]]) / 2)


def laid_out(names: Sequence[str], own: dict[str, Array]) -> Array:
    """Lay the figure's points out in a format's order (T, P, 3); points that it has not are near the nose."""
    known = {**{name: walked()[:, k] for name, k in POINT.items()}, **own}
    nose = walked()[:, POINT["nose"]]
    return np.stack([known.get(name, nose) for name in names], axis=1)


def h36m() -> Array:
    ankles = {f"{side}_foot": walked()[:, POINT[f"{side}_ankle"]] for side in ("left", "right")}
    own = {
        "root": middle("hip"),
        "thorax": middle("shoulder"),
        "spine": walked()[:, POINT["pelvis"]],
        **ankles,
    }
    return laid_out(load_skeleton_map("h36m_17").points, own)


def coco() -> Array:
    return laid_out(load_skeleton_map("coco_17").points, {})


def mediapipe() -> Array:
    return laid_out(load_skeleton_map("mediapipe_33").points, {})


def smpl(count: int = 22) -> Array:
    points = np.full((FRAMES, count, 3), 0.5)
    points[:, :22] = laid_out(SMPL_NAMES, {})
    return points


def held(path: Path, **asked: Any) -> HeldPostures:
    return held_postures(path, recognise(path), **asked)


def same_limbs(found: HeldPostures, scale: float = 1.0) -> None:
    np.testing.assert_allclose(found.postures.joints[:, LIMBS], scale * walked()[:, LIMBS], atol=1e-6)


@pytest.mark.parametrize(
    ("points", "name"),
    [
        (h36m(), "h36m_17"),
        (coco(), "coco_17"),
        (mediapipe(), "mediapipe_33"),
        (smpl(), "SMPL"),
        (smpl(24), "SMPL"),
    ],
)
def test_points_without_names_are_told_by_how_the_body_hangs_together(
    tmp_path: Path, points: Array, name: str
) -> None:
    np.save(tmp_path / "a.npy", points.astype(np.float32))
    found = held(tmp_path / "a.npy", rate=30.0)
    same_limbs(found)
    assert any(f"in the order of {name}" in said for said in found.said) and found.up == "+z"
    np.save(tmp_path / "a.npy", 1000 * points[None])
    same_limbs(held(tmp_path / "a.npy"))


def test_a_root_at_the_origin_in_a_cameras_frame_is_said(tmp_path: Path) -> None:
    points = h36m() - h36m()[:, :1]
    np.save(tmp_path / "a.npy", points[..., [1, 2, 0]] * [1.0, -1.0, 1.0])
    found = held(tmp_path / "a.npy")
    assert found.up == "-y" and not found.in_world and np.isnan(found.time).all()


@pytest.mark.parametrize(
    "array",
    [
        np.random.default_rng(0).random((FRAMES, 17, 3)),
        np.zeros((FRAMES, 17, 3)),
        np.full((FRAMES, 17, 3), np.nan),
        np.random.default_rng(0).random((FRAMES, 18, 3)),
        np.random.default_rng(0).random((FRAMES, 17, 2)),
        np.zeros((0, 17, 3)),
        np.zeros(3),
        np.array({"poses": 1}, dtype=object),
        np.array(["a"]),
    ],
)
def test_an_array_that_is_no_body_is_refused_in_one_line(tmp_path: Path, array: Any) -> None:
    np.save(tmp_path / "a.npy", array, allow_pickle=True)
    with pytest.raises(InputError) as refused:
        held(tmp_path / "a.npy")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("cut", [1, 5, 50, 127, 1000])
def test_an_array_that_is_cut_off_is_refused(tmp_path: Path, cut: int) -> None:
    np.save(tmp_path / "a.npy", h36m())
    data = (tmp_path / "a.npy").read_bytes()
    for damaged in (data[:-cut], data[:cut], data + b"0" * cut):
        (tmp_path / "a.npy").write_bytes(damaged)
        with pytest.raises(InputError) as refused:
            held(tmp_path / "a.npy")
        assert "\n" not in str(refused.value)


def test_arrays_without_rate_are_not_converted(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", h36m())
    with pytest.raises(InputError, match="no frame rate"):
        read_motion(tmp_path / "a.npy")


def dumped(path: Path, document: Any) -> Path:
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def landmarks(points: Array) -> list[dict[str, float]]:
    return [{"x": x, "y": y, "z": z, "visibility": 1.0} for x, y, z in points.tolist()]


def world() -> Array:
    hips = (mediapipe()[:, 23] + mediapipe()[:, 24]) / 2
    return (mediapipe() - hips[:, None])[..., [1, 2, 0]] * [1.0, -1.0, 1.0]


@pytest.mark.parametrize("nested", [False, True])
@pytest.mark.parametrize("seen", [False, True])
def test_world_landmarks_are_points_in_space(tmp_path: Path, nested: bool, seen: bool) -> None:
    frames = []
    for k, points in enumerate(world()):
        person = landmarks(points)
        frame: dict[str, Any] = {
            "timestamp_ms": 40 * k,
            "pose_world_landmarks": [person] if nested else person,
        }
        if seen:
            frame["pose_landmarks"] = [{"x": 0.5, "y": 0.5, "z": 0.0, "visibility": 1.0}] * 33
        frames.append(frame)
    found = held(dumped(tmp_path / "a.json", {"frames": frames}))
    assert found.up == "-y" and not found.in_world
    np.testing.assert_allclose(found.time, 0.04 * np.arange(FRAMES))
    np.testing.assert_allclose(found.feet[:, 0], world()[:, 32], atol=1e-9)


def lifted(points: Array, **more: Any) -> dict[str, Any]:
    return {"keypoints": points.tolist(), "keypoint_scores": [1.0] * len(points), **more}


def test_lifted_predictions_are_points_in_space_with_names_and_without(tmp_path: Path) -> None:
    frames = [{"frame_id": k + 1, "instances": [lifted(points)]} for k, points in enumerate(h36m())]
    names = {str(k): name for k, name in enumerate(load_skeleton_map("h36m_17").points)}
    demo = {"meta_info": {"keypoint_id2name": names}, "instance_info": frames}
    same_limbs(held(dumped(tmp_path / "demo.json", demo)))
    same_limbs(held(dumped(tmp_path / "inferencer.json", frames)))


def test_people_who_are_tracked_are_a_clip_each_and_others_refused(tmp_path: Path) -> None:
    people: list[dict[str, Any]] = [
        {
            "frame_id": k,
            "instances": [lifted(points, track_id=7), lifted(points + np.array([0.0, 1.0, 0.0]), track_id=9)],
        }
        for k, points in enumerate(h36m())
    ]
    found = held(dumped(tmp_path / "a.json", people))
    assert found.clips == ("person 7", "person 9") and found.in_time and len(found) == 2 * FRAMES
    for frame in people:
        for one in frame["instances"]:
            del one["track_id"]
    with pytest.raises(InputError, match=r"several people.*track"):
        held(dumped(tmp_path / "a.json", people))


def test_key_points_in_pictures_alone_are_no_postures(tmp_path: Path) -> None:
    flat = [{"frame_id": 0, "instances": [lifted(h36m()[0, :, :2])]}]
    with pytest.raises(InputError, match=r"key points in pictures alone.*recover them"):
        held(dumped(tmp_path / "a.json", flat))


@pytest.mark.parametrize(
    "points",
    [
        [[0, 0, 0]] * 16 + [[0, 0, "x"]],
        [[0, 0, 0]] * 16 + [[0, 0]],
        [[0, 0, 0]] * 16 + ["x"],
        [[0, 0, 1e999]] * 17,
    ],
)
def test_points_that_are_none_are_refused_in_one_line(tmp_path: Path, points: Any) -> None:
    document = [{"frame_id": 0, "instances": [{"keypoints": points, "keypoint_scores": [1] * 17}]}]
    with pytest.raises(InputError) as refused:
        held(dumped(tmp_path / "a.json", document))
    assert "\n" not in str(refused.value)


def test_points_that_were_triangulated_are_read_without_times(tmp_path: Path) -> None:
    columns = [f"{name}_{part}" for name in JOINTS for part in ("x", "y", "z", "error", "ncams", "score")]
    rows = [
        [value for point in 1000 * points[: len(JOINTS)] for value in (*point, 1.0, 3, 0.9)] + [1.0, 0.0, k]
        for k, points in enumerate(walked())
    ]
    text = [",".join([*columns, "M_00", "center_0", "fnum"]), *(",".join(map(str, row)) for row in rows)]
    (tmp_path / "anipose.csv").write_text("\n".join(text), encoding="utf-8")
    assert recognise(tmp_path / "anipose.csv").holds is Content.MOTION
    found = held(tmp_path / "anipose.csv")
    same_limbs(found)
    assert found.unit == "mm" and np.isnan(found.time).all()


def caliscope(path: Path, rows: list[tuple[Any, ...]]) -> Path:
    lines = [f"{k},{','.join(map(str, row))}" for k, row in enumerate(rows)]
    path.write_text("\n".join([",sync_index,point_id,x_coord,y_coord,z_coord", *lines]), encoding="utf-8")
    return path


def test_caliscopes_points_of_the_body_are_read_and_others_left_out(tmp_path: Path) -> None:
    rows = [(5 + k, j, *mediapipe()[k, j]) for k in range(FRAMES) for j in range(33) if (k, j) != (3, 25)]
    rows += [(5, 100 + j, 9.0, 9.0, 9.0) for j in range(21)]
    found = held(caliscope(tmp_path / "a.csv", rows))
    known = np.asarray(np.isfinite(found.postures.joints).all(axis=-1))
    assert not known[3, JOINTS.index("left_knee")] and known.sum() == FRAMES * len(JOINTS) - 1
    seen = held(caliscope(tmp_path / "d.csv", [row for row in rows if row[0] != 9]), rate=10.0)
    assert len(seen) == FRAMES and np.isnan(seen.postures.joints[4]).all() and seen.time[5] == 0.5
    with pytest.raises(InputError, match="whole numbers, one a frame"):
        held(caliscope(tmp_path / "e.csv", [*rows, (1e9, *rows[0][1:])]))
    with pytest.raises(InputError, match="a point twice in a frame"):
        held(caliscope(tmp_path / "b.csv", [*rows, rows[0]]))
    with pytest.raises(InputError, match="no point of the body"):
        held(caliscope(tmp_path / "c.csv", rows[-3:]))
