"""TRC: round trips, pandas as an independent reader, the traps of real files, and bad input."""

import hypothesis.strategies as st
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings

from posekit.errors import InputError
from posekit.formats.motion import Motion, read_motion, with_up, write_motion
from posekit.formats.motion.motion_axes import up_rotation
from posekit.formats.motion.trc import read_trc, write_trc

HEADER = (
    "PathFileType\t4\t(X/Y/Z)\twalk.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    "100\t100\t{frames}\t2\t{unit}\t100\t1\t3\n"
    "Frame#\tTime\tRHip\t\t\tLHip\t\t\n"
    "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n"
)
ROWS = (
    "1\t0.00\t0\t900\t0\t100\t900\t1\n",
    "2\t0.01\t1\t901\t0\t\t\t\n",
    "3\t0.02\t2\t902\t0\t102\t900\t3\n",
)


def motion(frames=7, points=5, seed=0, up="+y", missing=True):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(frames, points, 3))
    if missing:
        values[rng.random((frames, points)) < 0.2] = np.nan
    names = tuple(f"point {k}" for k in range(points))
    return Motion(names=names, points=values, time=0.5 + np.arange(frames) / 120, rate=120.0, up=up)


def save(tmp_path, text):
    path = tmp_path / "walk.trc"
    path.write_text(text, encoding="utf-8")
    return path


def file(frames=3, unit="mm", rows=ROWS):
    return HEADER.format(frames=frames, unit=unit) + "\n" + "".join(rows)


@given(frames=st.integers(1, 6), points=st.integers(1, 4), seed=st.integers(0, 999))
@settings(deadline=None, max_examples=40, derandomize=True)
def test_what_is_written_is_read_again(tmp_path_factory, frames, points, seed):
    given_motion = motion(frames, points, seed)
    path = tmp_path_factory.mktemp("trc") / "a.trc"
    write_trc(path, given_motion)
    back = read_trc(path)
    assert back.names == given_motion.names
    assert back.rate == given_motion.rate
    np.testing.assert_allclose(back.points, given_motion.points, rtol=0, atol=6e-10)
    np.testing.assert_allclose(back.time, given_motion.time, rtol=0, atol=6e-10)


def test_pandas_reads_the_same_joints(tmp_path):
    given_motion = motion(frames=40, points=3)
    write_motion(tmp_path / "a.trc", given_motion)
    table = pd.read_csv(tmp_path / "a.trc", sep="\t", skiprows=5, header=None)
    assert table.shape == (40, 2 + 9)
    np.testing.assert_allclose(
        table.iloc[:, 2:].to_numpy().reshape(40, 3, 3), given_motion.points, rtol=0, atol=1e-6
    )
    np.testing.assert_array_equal(table[0], np.arange(1, 41))
    header = (tmp_path / "a.trc").read_text().splitlines()
    assert dict(zip(header[1].split("\t"), header[2].split("\t"), strict=True))["Units"] == "m"


@pytest.mark.parametrize("up", ["+x", "-x", "-y", "+z", "-z"])
def test_opensims_y_is_up(tmp_path, up):
    turned = motion(up=up)
    write_trc(tmp_path / "a.trc", turned)
    back = read_trc(tmp_path / "a.trc")
    R = up_rotation(up, "+y")
    expected = np.einsum("ij,tpj->tpi", R, turned.points)
    np.testing.assert_allclose(back.points, expected, rtol=0, atol=6e-10)
    assert np.linalg.det(R) == 1
    np.testing.assert_array_equal(with_up(with_up(turned, "+y"), up).points, turned.points)


def test_millimetres_empty_cells_and_an_empty_line(tmp_path):
    found = read_motion(save(tmp_path, file()))
    assert found.names == ("RHip", "LHip")
    assert (found.rate, found.up) == (100.0, "+y")
    np.testing.assert_allclose(found.points[0], [[0, 0.9, 0], [0.1, 0.9, 0.001]], rtol=1e-15)
    assert np.isnan(found.points[1, 1]).all()
    np.testing.assert_allclose(found.time, [0, 0.01, 0.02])


@pytest.mark.parametrize(
    "text",
    [
        file().replace("\n\n", "\n"),
        file().replace("\n", "\r\n"),
        file().replace("\t0\t100", "\t0.0\t1e2"),
        file().replace("0\t\t\t\n", "0\n"),
        file().replace("0\t\t\t\n", "0\t \tnan\tNaN\n"),
        "\ufeff" + file(),
        file().replace("RHip\t\t\tLHip\t\t\n", "RHip\t\t\tLHip\n"),
        file().replace("1\n", "1\t\t\t\n"),
        file().replace("\tmm\t", "\tMillimeters\t"),
    ],
    ids=["no line", "crlf", "floats", "stripped", "nan", "mark", "names", "tabs", "spelled out"],
)
def test_what_programs_write_otherwise_is_the_same(tmp_path, text):
    plain = read_trc(save(tmp_path, file()))
    np.testing.assert_array_equal(read_trc(save(tmp_path, text)).points, plain.points)


def test_frame_numbers_may_have_gaps(tmp_path):
    text = file().replace("\n3\t0.02", "\n9\t0.08")
    np.testing.assert_allclose(read_trc(save(tmp_path, text)).time, [0, 0.01, 0.08])


def test_a_stated_unit_wins_over_a_wrong_one(tmp_path):
    path = save(tmp_path, file(unit="m"))
    with pytest.raises(
        InputError, match=r"unit: got points that span 100 m; expected 0.1 to 20 m; state the unit"
    ):
        read_motion(path)
    np.testing.assert_allclose(read_motion(path, unit="mm").points[0, 0], [0, 0.9, 0])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (file(frames=4), "NumFrames: got 3 rows of data; expected 4"),
        (file().replace("\t2\tmm", "\t3\tmm"), "NumMarkers: got 3, but line 4 names 2"),
        (file().replace("LHip", "RHip"), r'"RHip" twice'),
        (file(unit="furlong"), 'Units: got "furlong"'),
        (file().replace("100\t100\t3", "nan\t100\t3"), "DataRate"),
        (file().replace("\n2\t0.01", "\n0\t0.01"), "frame 0 after 1"),
        (file().replace("\n2\t0.01", "\n2\t0.00"), "times that ascend"),
        (file().replace("901", "9O1"), r'line 8, column 4: got "9O1"'),
        (file().replace("901", "1_000"), r'got "1_000"'),
        (file().replace("901", "inf"), "infinite|finite"),
        (file().replace("901", ""), "known|missing point"),
        (file()[:-8], "line 9: got 6 columns"),
        (file()[: file().index("902") + 3], "line 9: got 4 columns"),
        (file()[: file().index("902\t0") + 5], "line 9: got 5 columns"),
        (file().replace("\n3\t", "\n3\t4\t5\t"), "line 9: got 10 columns"),
        ("time,a_x\n0,1\n", "no TRC file"),
        (HEADER.format(frames=0, unit="mm"), "no frames"),
        (file().replace("Frame#\tTime\tRHip\t\t\tLHip\t\t", "Frame#\tTime"), "line 4"),
        (file().replace("\n2\t", "\n\t"), "line 8"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path, text, words):
    path = save(tmp_path, text)
    with pytest.raises(InputError, match=words) as refused:
        read_trc(path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_several_clips_and_names_that_break_the_table_are_not_written(tmp_path):
    two = Motion(
        names=("a",),
        points=np.ones((2, 1, 3)),
        time=np.zeros(2),
        rate=1,
        clip=np.arange(2),
        clips=("walk", "run"),
    )
    with pytest.raises(InputError, match="2 clips"):
        write_trc(tmp_path / "a.trc", two)
    write_trc(tmp_path / "a.trc", two.of_clip("run"))
    with pytest.raises(InputError, match="without tabs"):
        write_trc(
            tmp_path / "b.trc", Motion(names=("a\tb",), points=np.ones((1, 1, 3)), time=np.zeros(1), rate=1)
        )
    assert not (tmp_path / "b.trc").exists()


@pytest.mark.parametrize(("rate", "said"), [(30.000000000000004, "30"), (29.97, "29.97"), (5.0, "5")])
def test_a_rate_is_written_as_a_person_would(tmp_path, rate, said):
    write_trc(
        tmp_path / "a.trc",
        Motion(names=("a",), points=np.zeros((1, 1, 3)), time=np.zeros(1), rate=rate, up="+y"),
    )
    assert (tmp_path / "a.trc").read_text().splitlines()[2].split("\t")[0] == said


@pytest.mark.parametrize("start", ["+x", "-x", "+y", "-y", "+z", "-z"])
@pytest.mark.parametrize("between", ["+x", "-y", "+z", "-z"])
def test_turning_in_two_steps_faces_where_one_step_takes(start, between):
    for end in ("+x", "-x", "+y", "-y", "+z", "-z"):
        np.testing.assert_array_equal(
            up_rotation(between, end) @ up_rotation(start, between), up_rotation(start, end)
        )
        np.testing.assert_allclose(np.linalg.det(up_rotation(start, end)), 1.0, rtol=0, atol=1e-15)
