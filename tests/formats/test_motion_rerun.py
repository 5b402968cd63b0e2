"""Recordings for Rerun, read back by Rerun's own reader: entities, timelines, colours, and what is said."""

import io
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rerun.chunk import RrdReader

import posekit
from posekit.conversion.rerun_recording import write_rerun_result
from posekit.errors import InputError
from posekit.formats.motion.motion import Motion
from posekit.formats.motion.rerun_file import (
    FAINTEST_ALPHA,
    MOST_ALPHA,
    RecordedFrame,
    write_rerun,
    write_rerun_recording,
)
from posekit.formats.own.camera_model import OpenCVModel
from posekit.skeleton import JOINT, JOINTS, TREE_SEGMENTS

STANDING = posekit.load_figure().neutral_points[:14]
K = np.array([[900.0, 0, 640], [0, 900, 360], [0, 0, 1]])


def entities(path: Path) -> dict[str, list[Any]]:
    """Read a recording: the tables of each entity, of which there may be several."""
    found: dict[str, list[Any]] = {}
    for chunk in RrdReader(path).store().stream().to_chunks():
        if not chunk.entity_path.startswith("/__"):
            found.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())
    return found


def column(tables: list[Any], word: str) -> list[Any]:
    """Return a column of an entity's tables, in the order of frames."""
    rows: list[tuple[int, Any]] = []
    for table in tables:
        names = [name for name in table.schema.names if name.endswith(word)]
        if names:
            frame = table.column("frame").to_pylist() if "frame" in table.schema.names else [0]
            rows += zip(frame, table.column(names[0]).to_pylist(), strict=True)
    return [value for _, value in sorted(rows, key=lambda row: row[0])]


@pytest.fixture(scope="module")
def result() -> posekit.formats.own.Result:
    return posekit.result_of(posekit.recover(posekit.builtin_view("seq1")))


def test_a_result_has_every_frame_on_both_timelines(result, tmp_path: Path) -> None:
    says = write_rerun_result(tmp_path / "out.rrd", result, None)
    assert says[0].startswith("5 frames, 128 postures")
    found = entities(tmp_path / "out.rrd")
    assert set(found) == {
        "/world",
        "/findings",
        "/world/person",
        "/world/person/joints",
        "/world/person/others",
    }
    person = found["/world/person"]
    assert all("log_time" not in table.schema.names for table in person)
    assert column(person, "frame") == [0, 1, 2, 3, 4]
    seconds = [one.total_seconds() for one in column(person, "seconds")]
    assert np.allclose(seconds, [frame.time for frame in result.frames], rtol=0, atol=1e-6)
    lines = np.array(column(person, "strips")[0])
    best = result.frames[0].joints[result.frames[0].answer.representatives[0]]
    expected = np.array([[best[start], best[end]] for start, end in TREE_SEGMENTS])
    np.testing.assert_allclose(lines, expected, rtol=0, atol=1e-6)
    assert column(found["/findings"], "text")[2][0].startswith(
        f"frame 2: {len(result.frames[2].joints)} postures; rejected by "
    )


def test_what_is_less_likely_is_fainter(tmp_path: Path) -> None:
    bodies = STANDING + np.arange(4)[:, None, None]
    frame = RecordedFrame(time=0.0, postures=bodies, probability=np.array([0.6, 0.3, 0.1, 0.0]))
    write_rerun_recording(tmp_path / "out.rrd", [frame])
    others = entities(tmp_path / "out.rrd")["/world/person/others"]
    alpha = np.array(column(others, "colors")[0]).reshape(3, -1) & 0xFF
    assert (np.diff(alpha[:, 0].astype(int)) < 0).all()
    assert alpha.min() == FAINTEST_ALPHA and alpha.max() < MOST_ALPHA


def test_unknown_joints_and_empty_frames_are_left_out(tmp_path: Path) -> None:
    body = STANDING.copy()
    body[JOINT["left_wrist"]] = np.nan
    frames = [
        RecordedFrame(time=0.0, postures=body[None]),
        RecordedFrame(time=1.0, postures=np.empty((0, 14, 3))),
    ]
    write_rerun_recording(tmp_path / "out.rrd", frames, name="anna")
    person = entities(tmp_path / "out.rrd")["/world/anna"]
    (strips,) = [one for one in column(person, "LineStrips3D:strips") if one]
    assert len(strips) == len(TREE_SEGMENTS) - 1


def test_a_calibrated_view_has_its_camera(tmp_path: Path) -> None:
    image = np.full((1, 14, 2), np.nan)
    image[0, 0] = (640, 200)
    view = posekit.View(camera=OpenCVModel(K=K, size=(1280, 720)), time=np.zeros(1), image=image)
    frame = RecordedFrame(time=0.0, postures=STANDING[None])
    write_rerun_recording(tmp_path / "out.rrd", [frame], view=view)
    found = entities(tmp_path / "out.rrd")
    np.testing.assert_allclose(
        np.reshape(column(found["/world/camera"], "image_from_camera")[0], (3, 3)).T, K
    )
    assert np.allclose(column(found["/world/camera/seen"], "positions")[0], [[640, 200]])
    with pytest.raises(InputError, match="1 frames; expected 2"):
        write_rerun_recording(tmp_path / "other.rrd", [frame, frame], view=view)
    assert not (tmp_path / "other.rrd").exists()


def test_motion_is_points_and_where_they_are_joints_a_skeleton(tmp_path: Path) -> None:
    for names, entity in ((JOINTS, {"/world/person"}), (tuple(f"m{k}" for k in range(14)), set())):
        motion = Motion(
            names=names, points=np.repeat(STANDING[None], 3, axis=0), time=np.arange(3) / 30, rate=30
        )
        write_rerun(tmp_path / "out.rrd", motion)
        assert set(entities(tmp_path / "out.rrd")) == {"/world", "/world/person/points"} | entity


def test_a_missing_extra_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(InputError, match=r"writing .rrd needs rerun.*pip install 'posekit\[rerun\]'"):
        write_rerun_recording(tmp_path / "out.rrd", [])


def test_the_photographs_are_behind_the_points(command, tmp_path: Path) -> None:
    """Each frame has its own, in the camera's size; formats without pictures refuse them."""
    view = posekit.builtin_view("seq1")
    seen = posekit.View(
        camera=OpenCVModel(K=K, size=(1280, 720)),
        time=view.time,
        image=(points := view.truth @ K.T)[..., :2] / points[..., 2:],
        truth=view.truth,
    )
    posekit.write_view(tmp_path / "view.json", seen)
    posekit.recover(seen).save(tmp_path / "found.npz")
    (tmp_path / "photographs").mkdir()
    for k in range(len(seen)):
        Image.new("RGB", (640, 360), (40 * k, 0, 0)).save(tmp_path / "photographs" / f"{k}.png")
    words = ("--view", tmp_path / "view.json", "--over", tmp_path / "photographs")
    done = command("convert", tmp_path / "found.npz", tmp_path / "out.rrd", *words)
    assert done.code == 0 and "and the pictures" in done.out, done.err
    blobs = column(entities(tmp_path / "out.rrd")["/world/camera/picture"], "blob")
    pictures = [Image.open(io.BytesIO(bytes(np.ravel(blob).astype(np.uint8)))) for blob in blobs]
    assert [picture.size for picture in pictures] == [(1280, 720)] * 5
    assert np.allclose(
        [np.asarray(picture)[9, 9, 0] for picture in pictures], 40 * np.arange(5), rtol=0, atol=3
    )
    refused = command("convert", tmp_path / "found.npz", tmp_path / "out.trc", *words)
    assert refused.code == 2 and "trc holds no pictures" in refused.err


@pytest.mark.parametrize("second", [1e10, -1e10, 1e12])
def test_times_that_rerun_cannot_count_are_refused(tmp_path: Path, second: float) -> None:
    frames = [RecordedFrame(time=second, postures=STANDING[None])]
    with pytest.raises(InputError, match=r"frame 0: got .* s; expected at most 9.2e\+09 s"):
        write_rerun_recording(tmp_path / "late.rrd", frames)
    assert not list(tmp_path.iterdir())


def test_the_latest_time_that_rerun_counts_is_written(tmp_path: Path) -> None:
    write_rerun_recording(tmp_path / "late.rrd", [RecordedFrame(time=9.2e9, postures=STANDING[None])])
    assert (tmp_path / "late.rrd").stat().st_size
