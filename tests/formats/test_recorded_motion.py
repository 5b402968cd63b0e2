"""Motion as it was recorded: unit, way up and times are recognised and said, and refused against a file's own word."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.held import HeldPostures
from posekit.formats.held_postures import held_postures
from posekit.formats.motion import read_motion
from posekit.formats.motion.body_size import body_unit, stature_of
from posekit.formats.motion.ground_up import find_up
from posekit.formats.recognising import recognise
from posekit.geometry import Array
from posekit.skeleton import JOINTS, POINTS

FRAMES = 60
IN_UNIT = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "in": 1 / 0.0254}


def walked() -> Array:
    """Carry a standing figure, z up, 3 m along x (T, 19, 3)."""
    way = np.linspace(0, 3, FRAMES)[:, None, None] * [1.0, 0.0, 0.0]
    return np.asarray(load_figure().neutral_points[None] + [0.0, 0.0, 1.0] + way)


def written(path: Path, points: Array | None = None, **changed: Any) -> Path:
    """Write an NPZ of motion that says neither unit nor way up."""
    given = {
        "points": walked() if points is None else points,
        "names": np.array(POINTS),
        "rate": 30.0,
        **changed,
    }
    np.savez(path, **{name: value for name, value in given.items() if value is not None})
    return path


def held(path: Path, **asked: Any) -> HeldPostures:
    return held_postures(path, recognise(path), **asked)


@pytest.mark.parametrize("unit", ["cm", "mm", "in"])
def test_a_unit_is_told_by_the_bodys_size_and_said(tmp_path: Path, unit: str) -> None:
    found = held(written(tmp_path / "a.npz", walked() * IN_UNIT[unit]))
    assert found.unit == unit and any(f"taken as {unit}: " in said for said in found.said)
    np.testing.assert_allclose(found.postures.joints, walked()[:, : len(JOINTS)], atol=1e-9)


@pytest.mark.parametrize("size", [0.35, 0.6, 1.0, 1.4])
def test_a_child_and_a_robot_are_no_errors_of_a_unit(tmp_path: Path, size: float) -> None:
    found = held(written(tmp_path / "a.npz", size * walked()))
    assert found.unit == "m" and not any("taken as" in said for said in found.said)


@pytest.mark.parametrize("word", ["m", "cm"])
def test_a_files_own_word_against_the_bodys_size_is_refused(tmp_path: Path, word: str) -> None:
    path = written(tmp_path / "a.npz", walked() * 30 * IN_UNIT[word], unit=np.array(word))
    with pytest.raises(InputError, match=r"unit: got the file's own word, by which a body is \d\d.* --unit"):
        held(path)


def test_a_stated_unit_is_taken(tmp_path: Path) -> None:
    found = held(written(tmp_path / "a.npz", walked() * 1000, unit=np.array("m")), unit="mm")
    assert found.unit == "mm"
    np.testing.assert_allclose(found.postures.joints, walked()[:, : len(JOINTS)], atol=1e-9)


def test_two_units_that_fit_alike_are_refused_with_both() -> None:
    joints = walked()[:, : len(JOINTS)] * 94 / stature_of(walked())
    with pytest.raises(InputError, match="--unit cm or --unit in"):
        body_unit(joints, "file", told=False)


def test_postures_without_schema_have_their_unit_told_too(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", joints=walked()[:, : len(JOINTS)] * 1000)
    assert held(tmp_path / "a.npz").unit == "mm"


def test_one_clip_in_another_unit_is_named(tmp_path: Path) -> None:
    points = np.concatenate([walked(), walked() * 100, walked()])
    clip = np.repeat([0, 1, 2], FRAMES)
    found = held(written(tmp_path / "a.npz", points, clip=clip, clip_names=np.array(["a", "b", "c"])))
    assert [said for said in found.said if "clip b" in said and "another unit" in said]


@pytest.mark.parametrize(("order", "up"), [((0, 1, 2), "+z"), ((1, 2, 0), "+y"), ((2, 0, 1), "+x")])
def test_the_way_up_is_told_by_how_bodies_stand(tmp_path: Path, order: tuple[int, ...], up: str) -> None:
    found = held(written(tmp_path / "a.npz", walked()[..., list(order)]))
    assert found.up == up and f"{up} is up by how bodies stand" in found.said


def test_a_files_own_way_up_against_bodies_and_ground_is_refused_and_a_stated_one_taken(
    tmp_path: Path,
) -> None:
    path = written(tmp_path / "a.npz", up=np.array("+x"))
    with pytest.raises(InputError, match=r"up: got \+x, by the file's own word.* --up \+x or --up \+z"):
        held(path)
    assert held(path, up="+z").up == "+z" and held(path, up="+x").up == "+x"


def test_somebody_who_lies_still_is_no_contradiction(tmp_path: Path) -> None:
    still = np.repeat(walked()[:1], FRAMES, axis=0)
    found = held(written(tmp_path / "a.npz", still, up=np.array("+y")))
    assert found.up == "+y" and any("though bodies stand along +z" in said for said in found.said)


def test_who_is_never_upright_has_the_ground_tell_the_way_up() -> None:
    standing = load_figure().neutral_points[: len(JOINTS)]
    lying = standing[:, [2, 1, 0]] - [0.0, 0.0, standing[:, 0].min()]
    way = np.linspace(0, 3, FRAMES)[:, None, None] * [1.0, 1.0, 0.0]
    crawling = np.where(np.arange(FRAMES)[:, None, None] % 2, 1.0, [-1.0, 1.0, 1.0]) * lying + way
    crawling[::2, JOINTS.index("left_wrist")] += [0.0, 0.0, 0.7]
    assert find_up(crawling, np.zeros(FRAMES, dtype=np.intp), "", "file", told=False).up == "+z"


@pytest.mark.parametrize("rate", [0.0, -30.0, np.nan, np.inf, None])
def test_no_frame_rate_is_said_and_refused_where_files_are_converted(
    tmp_path: Path, rate: float | None
) -> None:
    path = written(tmp_path / "a.npz", rate=rate)
    found = held(path)
    assert np.isnan(found.time).all() and any("--rate" in said for said in found.said)
    assert held(path, rate=50.0).time[1] == 0.02
    with pytest.raises(InputError):
        read_motion(path)


TRC_HEAD = (
    "PathFileType\t4\t(X/Y/Z)\ta.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
)


def trc(path: Path, frames: list[int], rate: str = "30") -> Path:
    points = walked()
    title = "\t".join(["Frame#", "Time", *(f"{name}\t\t" for name in POINTS)])
    rows = [
        "\t".join([str(k), f"{k / 30:.6f}", *(f"{value:.6f}" for value in points[k].reshape(-1))])
        for k in frames
    ]
    numbers = f"{rate}\t{rate}\t{len(frames)}\t{len(POINTS)}\tm\t{rate}\t1\t{len(frames)}\n"
    path.write_text(TRC_HEAD + numbers + title + "\n\n\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def csv(path: Path, frames: list[int], rate: str = "30") -> Path:
    del rate
    head = ",".join(["time", *(f"{name}_{axis}" for name in POINTS for axis in "xyz")])
    points = walked().reshape(FRAMES, -1)
    rows = [",".join([f"{k / 30:.6f}", *map(repr, points[k].tolist())]) for k in frames]
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


def npz(path: Path, frames: list[int], rate: str = "30") -> Path:
    return written(path, walked()[frames], time=np.array(frames) / 30, rate=float(rate))


@pytest.mark.parametrize(("write", "suffix"), [(trc, ".trc"), (csv, ".csv"), (npz, ".npz")])
@pytest.mark.parametrize("frames", [[0, 2, 1, 3], [0, 1, 1, 2], [0, 1, 7, 8]])
def test_frames_out_of_order_repeated_and_missing_are_taken_as_they_are(
    tmp_path: Path, write: Callable[..., Path], suffix: str, frames: list[int]
) -> None:
    path = write(tmp_path / f"a{suffix}", frames)
    found = held(path)
    np.testing.assert_allclose(found.time, np.array(frames) / 30, atol=1e-5)
    np.testing.assert_allclose(found.postures.joints, walked()[frames][:, : len(JOINTS)], atol=1e-5)
    if (np.diff(frames) <= 0).any():
        with pytest.raises(InputError, match=r"ascend|in order"):
            read_motion(path)


@pytest.mark.parametrize("rate", ["0", "-30", "none"])
def test_a_trc_without_rate_has_its_times(tmp_path: Path, rate: str) -> None:
    path = trc(tmp_path / "a.trc", [0, 1, 2], rate)
    assert held(path).time[1] == pytest.approx(1 / 30, abs=1e-5)
    with pytest.raises(InputError, match="DataRate"):
        read_motion(path)


@pytest.mark.parametrize("write", [trc, csv, npz])
def test_a_clip_of_one_frame_is_read(tmp_path: Path, write: Callable[..., Path]) -> None:
    suffix = f".{write.__name__}"
    assert len(held(write(tmp_path / f"a{suffix}", [0]))) == 1


def test_two_people_are_a_clip_each(tmp_path: Path) -> None:
    names = [f"{who}:{name}" for who in ("Ann", "Bob") for name in POINTS]
    points = np.concatenate([walked(), np.add(walked(), [0.0, 2.0, 0.0])], axis=1)
    found = held(written(tmp_path / "a.npz", points, names=np.array(names)))
    assert found.clips == ("0 Ann", "0 Bob") and found.in_time
    np.testing.assert_allclose(
        found.postures.joints[found.clip == 1] - found.postures.joints[found.clip == 0],
        np.broadcast_to([0.0, 2.0, 0.0], (FRAMES, len(JOINTS), 3)),
        atol=1e-9,
    )


def test_a_body_around_the_origin_in_every_frame_is_in_no_world(tmp_path: Path) -> None:
    points = walked()
    hips = points[:, [POINTS.index("right_hip"), POINTS.index("left_hip")]].mean(axis=1, keepdims=True)
    assert not held(written(tmp_path / "a.npz", points - hips)).in_world
    assert held(written(tmp_path / "b.npz")).in_world


@pytest.mark.parametrize("apart", [True, False])
def test_people_of_a_column_are_a_clip_each(tmp_path: Path, apart: bool) -> None:
    head = ",".join(["time", "person", *(f"{name}_{axis}" for name in POINTS for axis in "xyz")])
    rows = [(k, who) for who in "ab" for k in range(5)]
    rows = rows if apart else sorted(rows)
    lines = [
        ",".join([f"{k / 30:.6f}", who, *map(repr, (walked()[k] + (who == "b")).reshape(-1).tolist())])
        for k, who in rows
    ]
    (tmp_path / "a.csv").write_text("\n".join([head, *lines]), encoding="utf-8")
    found = held(tmp_path / "a.csv")
    assert found.clips == ("person a", "person b") and found.in_time
    np.testing.assert_allclose(found.postures.joints[found.clip == 1], walked()[:5, : len(JOINTS)] + 1.0)
    with pytest.raises(InputError, match="ascend"):
        read_motion(tmp_path / "a.csv")
