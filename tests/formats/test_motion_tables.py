"""CSV, Parquet and NPZ: round trips, pandas and NumPy as independent readers, survivors, pieces, and bad files."""

import hypothesis.strategies as st
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings

from posekit.errors import InputError
from posekit.formats.motion import (
    Motion,
    SurvivorTable,
    read_motion,
    read_survivors,
    write_motion,
    write_survivors,
)
from posekit.formats.motion.csv_table import write_csv_motion
from posekit.formats.motion.motion_table import rate_of
from posekit.formats.motion.npz import read_npz
from posekit.formats.motion.parquet import read_parquet_pieces, write_parquet, write_parquet_pieces
from posekit.formats.motion.survivors_files import read_survivor_pieces, write_survivor_pieces
from posekit.skeleton import HEAD_POINTS, JOINTS


def motion(frames=(6, 9), points=4, seed=0, up="-y"):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(sum(frames), points, 3))
    values[rng.random((sum(frames), points)) < 0.2] = np.nan
    rates = 100.0 + 20.0 * np.arange(len(frames), dtype=np.float64)
    return Motion(
        names=tuple(f"point, {k}" for k in range(points)),
        points=values,
        time=np.concatenate([np.arange(n) / rate for n, rate in zip(frames, rates, strict=True)]),
        rate=rates[0],
        rates=rates,
        up=up,
        clip=np.repeat(np.arange(len(frames)), frames),
        clips=tuple(f'clip "{k}"' for k in range(len(frames))),
        actions=tuple(f"action {k}" for k in range(len(frames))),
    )


def survivors(frames=(3, 1, 0, 4), seed=0, branches=True, start=0):
    rng = np.random.default_rng(seed)
    count = sum(frames)
    joints = rng.normal(size=(count, 14, 3))
    joints[0, 9] = np.nan
    frame = np.repeat(np.arange(len(frames)), frames) + start
    return SurvivorTable(
        frame=frame,
        time=frame / 30,
        survivor=np.concatenate([np.arange(n) for n in frames]),
        joints=joints,
        values={"probability": rng.random(count), "margin.collision": rng.normal(size=count)},
        branches=tuple("".join(rng.choice(["N", "F"], 4)) for _ in range(count)) if branches else (),
    )


@pytest.mark.parametrize("suffix", ["csv", "parquet", "npz"])
@given(
    frames=st.lists(st.integers(1, 5), min_size=1, max_size=3),
    points=st.integers(1, 4),
    seed=st.integers(0, 99),
)
@settings(deadline=None, max_examples=15, derandomize=True)
def test_what_is_written_is_read_again(tmp_path_factory, suffix, frames, points, seed):
    one = motion(tuple(frames), points, seed)
    path = tmp_path_factory.mktemp("tables") / f"a.{suffix}"
    write_motion(path, one)
    back = read_motion(path, unit="m")
    np.testing.assert_array_equal(back.points, one.points)
    np.testing.assert_array_equal(back.time, one.time)
    np.testing.assert_array_equal(back.clip, one.clip)
    assert back.names == one.names
    assert back.clips == (one.clips if len(frames) > 1 or suffix == "npz" else ("",))
    assert back.up == ("" if suffix == "csv" else "-y")
    several = np.array(frames) > 1
    np.testing.assert_allclose(back.rates[several], one.rates[several], rtol=1e-12)
    assert back.actions == (
        one.actions if suffix == "npz" else ("",) * len(frames if len(frames) > 1 else [0])
    )


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_long_and_wide_are_the_same_points(tmp_path, suffix):
    one = motion()
    write = {"csv": write_csv_motion, "parquet": write_parquet}[suffix]
    write(tmp_path / f"long.{suffix}", one, long=True)
    back = read_motion(tmp_path / f"long.{suffix}")
    order = [back.names.index(name) for name in one.names]
    np.testing.assert_array_equal(back.points[:, order], one.points)
    read = {"csv": pd.read_csv, "parquet": pd.read_parquet}[suffix]
    table = read(tmp_path / f"long.{suffix}")
    assert list(table) == ["frame", "time", "clip", "name", "x", "y", "z"]
    known = np.isfinite(one.points[:, 2, 0])
    rows = table[table["name"] == one.names[2]]
    np.testing.assert_array_equal(rows["frame"], np.flatnonzero(known))
    np.testing.assert_array_equal(rows[["x", "y", "z"]], one.points[known, 2])


def test_pandas_and_numpy_read_the_same_joints(tmp_path):
    one = motion()
    for suffix, read in (("csv", pd.read_csv), ("parquet", pd.read_parquet)):
        write_motion(tmp_path / f"a.{suffix}", one)
        table = read(tmp_path / f"a.{suffix}")
        found = table[[f"{name}_{axis}" for name in one.names for axis in "xyz"]].to_numpy()
        np.testing.assert_allclose(found.reshape(one.points.shape), one.points, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(table["time"], one.time)
        assert list(table["clip"].unique()) == list(one.clips)
    write_motion(tmp_path / "a.npz", one)
    with np.load(tmp_path / "a.npz", allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["joints"], one.points)
        assert tuple(arrays["joint_names"]) == one.names


def test_tables_that_pandas_writes_are_read(tmp_path):
    table = pd.DataFrame({"time": [0.0, 0.1], "RHip_x": [0.0, 1], "RHip_y": [1.0, None], "RHip_z": [0, 2.0]})
    table.loc[1, "RHip_y"] = 4.0
    table["note"] = "walking"
    table["LHip_X"], table["LHip_Y"], table["LHip_Z"] = 1.0, np.nan, np.nan
    table.loc[:, "LHip_X"] = np.nan
    table.to_csv(tmp_path / "a.csv", index=False)
    table.to_csv(tmp_path / "b.csv", index=False, sep=";")
    table.to_parquet(tmp_path / "c.parquet")
    for name in ("a.csv", "b.csv", "c.parquet"):
        found = read_motion(tmp_path / name)
        assert (found.names, found.rate, found.up) == (("RHip", "LHip"), 10.0, "")
        np.testing.assert_array_equal(found.points[:, 0], [[0, 1, 0], [1, 4, 2]])
        assert np.isnan(found.points[:, 1]).all()


def test_rates_come_from_rounded_times():
    assert rate_of(np.round(np.arange(100) / 30, 3)) == 30
    assert rate_of(np.arange(50) / 59.94) == pytest.approx(59.94)
    assert rate_of(np.array([0, 1, 2, 3, 40]) / 25) == pytest.approx(25)
    assert rate_of(np.array([3.0])) == 1


def test_a_parquet_file_is_read_in_pieces(tmp_path):
    whole = motion((400,))
    pieces = [
        Motion(
            names=whole.names, points=whole.points[rows], time=whole.time[rows], rate=whole.rate, up=whole.up
        )
        for rows in np.array_split(np.arange(400), 5)
    ]
    for long in (False, True):
        path = tmp_path / f"{long}.parquet"
        write_parquet_pieces(path, iter(pieces), long=long) if not long else pd.concat(
            [_long(piece, 80 * k) for k, piece in enumerate(pieces)]
        ).to_parquet(path, row_group_size=101)
        found = list(read_parquet_pieces(path))
        assert len(found) > 4
        assert all(piece.rate == pytest.approx(whole.rate) for piece in found)
        np.testing.assert_array_equal(np.concatenate([piece.time for piece in found]), whole.time)
        together = read_motion(path)
        assert sum(len(piece) for piece in found) == len(together) == 400
    with pytest.raises(InputError, match="different columns"):
        write_parquet_pieces(tmp_path / "bad.parquet", [whole, motion((3,), points=2)])
    assert not (tmp_path / "bad.parquet").exists()


def _long(piece, start):
    frame, point = np.divmod(np.arange(piece.points.shape[0] * len(piece.names)), len(piece.names))
    points = piece.points.reshape(-1, 3)
    return pd.DataFrame(
        {
            "frame": frame + start,
            "time": piece.time[frame],
            "name": np.array(piece.names)[point],
            **{axis: points[:, k] for k, axis in enumerate("xyz")},
        }
    )


def save_npz(tmp_path, **arrays):
    np.savez(tmp_path / "a.npz", **{key: value for key, value in arrays.items() if value is not None})
    return tmp_path / "a.npz"


def test_plain_arrays_and_postures_are_read(tmp_path):
    points = np.random.default_rng(0).normal(size=(4, 3, 3))
    names = np.array(["a", "b", "c"])
    found = read_motion(save_npz(tmp_path, points=100 * points, names=names, rate=50, unit="cm", up="z"))
    np.testing.assert_allclose(found.points, points)
    np.testing.assert_allclose(found.time, [0, 0.02, 0.04, 0.06])
    assert (found.up, found.rate) == ("+z", 50)
    timed = read_motion(save_npz(tmp_path, points=points, names=names, time=np.arange(4) / 25))
    assert (timed.rate, timed.up) == (25, "")
    schema = np.array("posekit.postures/1")
    head = np.full((4, 5, 3), np.nan)
    joints = np.repeat(points, 5, axis=1)[:, :14]
    postures = read_motion(
        save_npz(tmp_path, schema=schema, joint_names=np.array(JOINTS), joints=joints, head=head)
    )
    assert postures.names == (*JOINTS, *HEAD_POINTS)
    assert postures.rate == 1
    with pytest.raises(InputError, match="clip_fps: got nothing; expected how fast"):
        read_npz(save_npz(tmp_path, points=points, names=names))
    with pytest.raises(InputError, match="schema"):
        read_npz(save_npz(tmp_path, schema=np.array("posekit.result/1"), joints=points))
    with pytest.raises(InputError, match="times that ascend"):
        read_npz(save_npz(tmp_path, points=points, names=names, time=np.zeros(4)))
    with pytest.raises(InputError, match="clips 0 to 3 at most"):
        read_npz(save_npz(tmp_path, points=points, names=names, rate=1, clip=np.array([0, 1, 2, 2**40])))


@pytest.mark.parametrize("suffix", ["csv", "parquet", "npz"])
@pytest.mark.parametrize("branches", [True, False])
def test_sets_of_survivors_are_kept_whole(tmp_path, suffix, branches):
    table = survivors(branches=branches)
    path = tmp_path / f"a.{suffix}"
    write_survivors(path, table)
    back = read_survivors(path)
    for name in ("frame", "time", "survivor", "joints"):
        np.testing.assert_array_equal(getattr(back, name), getattr(table, name))
    assert back.branches == table.branches
    assert back.values.keys() == table.values.keys()
    for name, values in table.values.items():
        np.testing.assert_array_equal(back.values[name], values)


def test_pandas_reads_sets_of_survivors(tmp_path):
    table = survivors()
    for suffix, read in (("csv", pd.read_csv), ("parquet", pd.read_parquet)):
        write_survivors(tmp_path / f"a.{suffix}", table)
        frames = read(tmp_path / f"a.{suffix}")
        assert list(frames)[:6] == ["frame", "time", "survivor", "neck_x", "neck_y", "neck_z"]
        assert list(frames)[-3:] == ["probability", "margin.collision", "branches"]
        assert frames.groupby("frame").size().to_dict() == {0: 3, 1: 1, 3: 4}
        wrist = frames.query("frame == 3").filter(like="right_wrist").to_numpy()
        np.testing.assert_array_equal(wrist, table.joints[4:, JOINTS.index("right_wrist")])
        with pytest.raises(InputError, match="read it as survivors"):
            read_motion(tmp_path / f"a.{suffix}", suffix)


def test_a_batch_of_survivors_is_written_and_read_in_pieces(tmp_path):
    pieces = [survivors(seed=k, start=4 * k) for k in range(5)]
    write_survivor_pieces(tmp_path / "a.parquet", iter(pieces))
    for piece, back in zip(pieces, read_survivor_pieces(tmp_path / "a.parquet"), strict=True):
        np.testing.assert_array_equal(back.joints, piece.joints)
    assert len(read_survivors(tmp_path / "a.parquet")) == 40


def test_survivors_that_are_none_are_refused(tmp_path):
    good = survivors()
    fields = {"frame": good.frame, "time": good.time, "survivor": good.survivor, "joints": good.joints}
    joints = good.joints.copy()
    joints[2, 3, 1] = np.inf
    for change, words in (
        ({"frame": good.frame[::-1]}, "out of order"),
        ({"survivor": np.zeros(8)}, "twice"),
        ({"survivor": np.full(8, 0.5)}, "not whole"),
        ({"joints": joints}, "infinite"),
        ({"joints": joints[:4]}, r"shape \(4, 14, 3\)"),
        ({"values": {"neck_x": good.time}}, "names of their own"),
        ({"branches": ("N",)}, "1 for 8"),
    ):
        with pytest.raises(InputError, match=words):
            SurvivorTable(**{**fields, **change})
    with pytest.raises(InputError, match=r'format: got ".xlsx"'):
        write_survivors(tmp_path / "a.xlsx", good)
    (tmp_path / "a.csv").write_text("frame,time,survivor\n0,0,0\n")
    with pytest.raises(InputError, match="no neck_x"):
        read_survivors(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,a_x,a_y,a_z\n", "no rows"),
        ("time,a_x,a_y,a_z\n0,1,2\n", "row 1: got 3 cells; expected 4"),
        ("time,a_x,a_y,a_z\n0,1,2,3\n1,1,2,x\n", r'row 2, a_z: got "x"'),
        ("time,a_x,a_y,a_z\n0,1,2,inf\n", "row 1, a_z"),
        ("time,a_x,a_y,a_z\n0,1,,3\n", "known|missing point"),
        ("time,a_x,a_y,a_z\n0,1,2,3\n0,1,2,3\n", "times that ascend"),
        ("time,a_x,a_y,a_x\n0,1,2,3\n", '"a_x" twice'),
        ("time,a_x,a_y,a_z,a.x\n0,1,2,3,4\n", '"a.x" twice'),
        ("time,a_x,a_y\n0,1,2\n", "name, x, y, z; or triples"),
        ("a_x,a_y,a_z\n0,1,2\n", "a column time"),
        ("scorer,DLC,DLC\nbodyparts,nose,nose\ncoords,x,y\n0,1,2\n", r"\"DLC\" twice"),
        ("frame,time,name,x,y,z\n0,0,a,1,2,3\n0,0,a,1,2,3\n", '"a" twice'),
        ("frame,time,name,x,y,z\n0,0,a,1,2,3\n1,1,a,1,2,3\n0,0,b,1,2,3\n", "rows are apart"),
        ("frame,time,name,x,y,z\n0,0,a,1,2,3\n0,1,b,1,2,3\n", "one time a frame"),
        ("frame,time,name,x,y,z\n1,1,a,1,2,3\n0,0,a,1,2,3\n", "times that ascend"),
        ("frame,time,name,x,y,z\n,0,a,1,2,3\n", "without frame or time"),
        ('time,"a_x\n0', "no rows|columns|cells"),
    ],
)
def test_bad_tables_are_refused_in_one_line(tmp_path, text, words):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as refused:
        read_motion(path, "csv")
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_damaged_parquet_is_refused_in_one_line(tmp_path, monkeypatch):
    path = tmp_path / "a.parquet"
    write_motion(path, motion((50,)))
    good = path.read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(60):
        data = bytearray(good)
        for place in rng.integers(0, len(good), size=4):
            data[place] = rng.integers(0, 256)
        path.write_bytes(bytes(data[: rng.integers(4, len(good))] if rng.random() < 0.2 else data))
        try:
            read_motion(path, "parquet", unit="m")
        except InputError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 20
    path.write_bytes(good)
    monkeypatch.setattr("posekit.formats.motion.parquet.MAX_VALUES", 500)
    with pytest.raises(InputError, match="50 rows of 13 columns"):
        read_motion(path)
    pd.DataFrame({"time": [0.0], "a_x": ["1"], "a_y": [0.0], "a_z": [0.0]}).to_parquet(path)
    with pytest.raises(InputError, match=r"a_x: got .*string.*; expected numbers"):
        read_motion(path)


def test_without_pyarrow_parquet_says_what_to_install(tmp_path, monkeypatch):
    def missing(name):
        raise ImportError(name)

    write_motion(tmp_path / "a.parquet", motion())
    monkeypatch.setattr("posekit.safe_io.extras.import_module", missing)
    for action in (
        lambda: read_motion(tmp_path / "a.parquet"),
        lambda: write_motion(tmp_path / "b.parquet", motion()),
    ):
        with pytest.raises(InputError, match=r"Parquet needs pyarrow.*pip install 'posekit\[parquet\]'"):
            action()
