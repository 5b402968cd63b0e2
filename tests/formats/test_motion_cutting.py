"""Frames of a file as a file of its own format: they read back as they were, and nothing else changes."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.motion import Motion, read_motion, write_configurations, write_motion
from posekit.formats.motion.csv_table import write_csv_motion
from posekit.formats.motion.cutting import cut_motion, cut_name

FRAMES = 12
ROWS = np.array([2, 3, 4, 8, 9])


def a_motion(rng) -> Motion:
    return Motion(
        names=("right_hip", "left_hip", 'x, "y"'),
        points=rng.normal(size=(FRAMES, 3, 3)).round(6),
        time=np.arange(FRAMES) / 50,
        rate=50.0,
    )


def cut_to(tmp_path: Path, source: str) -> Path:
    target = tmp_path / "out" / cut_name(Path(source)).name
    target.parent.mkdir()
    cut_motion(tmp_path / source, target, ROWS, FRAMES)
    return target


@pytest.mark.parametrize("name", ["m.npz", "m.csv", "m.parquet", "m.trc"])
def test_points_read_back_as_they_were(tmp_path, rng, name):
    motion = a_motion(rng)
    write_motion(tmp_path / name, motion)
    back = read_motion(cut_to(tmp_path, name), unit="m")
    assert back.names == motion.names
    np.testing.assert_allclose(
        back.points, read_motion(tmp_path / name, unit="m").points[ROWS], rtol=0, atol=0
    )
    np.testing.assert_allclose(back.time, motion.time[ROWS], atol=1e-12)


def test_c3d_keeps_the_points_of_neighbouring_frames(tmp_path, rng):
    motion = a_motion(rng)
    write_motion(tmp_path / "m.c3d", Motion(**{**vars(motion), "names": ("a", "b", "c")}))
    cut_motion(tmp_path / "m.c3d", tmp_path / "out.c3d", np.arange(3, 9), FRAMES)
    before, after = (read_motion(tmp_path / name, unit="m") for name in ("m.c3d", "out.c3d"))
    np.testing.assert_array_equal(after.points, before.points[3:9])


def test_a_long_table_is_cut_by_frames_and_not_by_lines(tmp_path, rng):
    motion = a_motion(rng)
    write_csv_motion(tmp_path / "m.csv", motion, long=True)
    lines = (tmp_path / "m.csv").read_text().splitlines()
    np.testing.assert_array_equal(
        read_motion(cut_to(tmp_path, "m.csv"), unit="m").points, motion.points[ROWS]
    )
    kept = (tmp_path / "out" / "m.csv").read_text().splitlines()
    assert kept == [lines[0], *(lines[1 + 3 * row + k] for row in ROWS for k in range(3))]


@pytest.mark.parametrize("name", ["m.bvh", "m.mot"])
def test_angles_keep_their_lines_to_the_letter(tmp_path, name):
    figure = load_figure()
    q = np.repeat(pin.neutral(figure.model)[None], FRAMES, axis=0)
    q[:, 0] = np.arange(FRAMES) / 10
    write_configurations(tmp_path / name, figure, q, np.arange(FRAMES) / 50)
    lines, kept = (
        (tmp_path / name).read_text().splitlines(),
        cut_to(tmp_path, name).read_text().splitlines(),
    )
    assert kept[-len(ROWS) :] == [lines[len(lines) - FRAMES + row] for row in ROWS]
    head, kept_head = lines[:-FRAMES], kept[: -len(ROWS)]
    changed = [(a, b) for a, b in zip(head, kept_head, strict=True) if a != b]
    assert len(changed) == 1
    assert changed[0][1] == changed[0][0].replace(str(FRAMES), str(len(ROWS)))
    if name == "m.bvh":
        before, after = read_motion(tmp_path / name), read_motion(tmp_path / "out" / name)
        np.testing.assert_array_equal(after.points, before.points[ROWS])


def test_other_arrays_of_an_npz_stay_as_they_are(tmp_path, rng):
    poses = rng.normal(size=(FRAMES, 72))
    arrays = {
        "poses": poses,
        "betas": np.arange(float(FRAMES)),
        "gender": np.array("neutral"),
        "rate": np.array(50.0),
    }
    np.savez(tmp_path / "m.npz", **arrays)
    with np.load(cut_to(tmp_path, "m.npz"), allow_pickle=False) as kept:
        np.testing.assert_array_equal(kept["poses"], poses[ROWS])
        for name in ("betas", "gender", "rate"):
            np.testing.assert_array_equal(kept[name], arrays[name])


def test_what_cannot_be_cut_is_refused_and_nothing_is_written(tmp_path):
    np.savez(tmp_path / "m.npz", other=np.zeros(3))
    with pytest.raises(InputError, match="no array with a row a frame"):
        cut_motion(tmp_path / "m.npz", tmp_path / "out.npz", ROWS, FRAMES)
    assert not (tmp_path / "out.npz").exists()
    assert cut_name(Path("a/walk.glb")) == Path("a/walk.glb.npz")
