"""Which format a file is in; the formats by name; what all readers refuse alike."""

import numpy as np
import pytest

from posekit.errors import InputError
from posekit.formats.motion import Motion, format_of, motion_format, motion_formats, read_motion, write_motion
from posekit.formats.motion.motion_checks import check_size

POINTS = ("trc", "c3d", "csv", "npz", "parquet")


def motion(**changed):
    rng = np.random.default_rng(1)
    fields = {
        "names": ("a", "b", "c"),
        "points": rng.normal(size=(6, 3, 3)),
        "time": np.arange(6) / 50,
        "rate": 50.0,
        "up": "+y",
        "source": "walk",
    }
    return Motion(**{**fields, **changed})


@pytest.mark.parametrize("name", POINTS)
def test_a_file_is_known_by_its_name_and_by_its_content(tmp_path, name):
    suffix = motion_format(name).suffixes[0]
    for path in (tmp_path / f"a{suffix}", tmp_path / f"b{suffix.upper()}"):
        write_motion(path, motion())
        assert format_of(path).name == name
        np.testing.assert_allclose(read_motion(path).points, motion().points, rtol=0, atol=1e-6)
    nameless = (tmp_path / f"a{suffix}").rename(tmp_path / "nameless")
    assert format_of(nameless).name == name
    np.testing.assert_allclose(read_motion(nameless).points, motion().points, rtol=0, atol=1e-6)
    np.testing.assert_allclose(read_motion(nameless, name).points, motion().points, rtol=0, atol=1e-6)


def test_a_name_that_belies_the_content_is_ambiguous(tmp_path):
    write_motion(tmp_path / "a.trc", motion())
    (tmp_path / "a.trc").rename(tmp_path / "a.csv")
    with pytest.raises(
        InputError,
        match=r"a file that is csv or caliscope or trc; expected one of them; say which with --format",
    ):
        read_motion(tmp_path / "a.csv")
    assert read_motion(tmp_path / "a.csv", "trc").names == ("a", "b", "c")
    with pytest.raises(InputError, match="row 1: got 8 cells"):
        read_motion(tmp_path / "a.csv", "csv")


def test_what_is_no_motion_is_refused_and_the_formats_are_named(tmp_path):
    (tmp_path / "a.txt").write_text("walking\n")
    (tmp_path / "a.mot").write_text("walking\nendheader\ntime\n0\n")
    for path, words in (
        (tmp_path / "a.txt", "no format of motion that is known; expected trc, c3d, csv, npz, parquet, mot"),
        (tmp_path / "none.trc", "No such file"),
        (tmp_path / "none", "no format of motion|No such file"),
        (tmp_path / "a.mot", "columns: got no torso_tx; expected the 29 columns of the figure"),
    ):
        with pytest.raises(InputError, match=words) as refused:
            read_motion(path)
        assert "\n" not in str(refused.value)
    with pytest.raises(InputError, match="did you mean trc"):
        read_motion(tmp_path / "a.txt", "trk")
    with pytest.raises(InputError, match='--unit: got "ell"; expected a known unit'):
        read_motion(tmp_path / "a.txt", "trc", unit="ell")
    with pytest.raises(InputError, match='--up: got "north"'):
        read_motion(tmp_path / "a.txt", "trc", up="north")
    with pytest.raises(InputError, match=r'format: got ".doc"; expected one of .trc'):
        write_motion(tmp_path / "a.doc", motion())
    with pytest.raises(InputError, match="a directory"):
        read_motion(tmp_path, "trc")


@pytest.mark.parametrize("name", POINTS)
def test_files_that_are_no_files_are_refused(tmp_path, name):
    suffix = motion_format(name).suffixes[0]
    (tmp_path / f"empty{suffix}").touch()
    (tmp_path / f"noise{suffix}").write_bytes(np.random.default_rng(0).bytes(3000))
    for kind in ("empty", "noise", "none"):
        with pytest.raises(InputError) as refused:
            read_motion(tmp_path / f"{kind}{suffix}", name)
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", POINTS)
def test_a_file_is_replaced_whole_or_not_at_all(tmp_path, name):
    path = tmp_path / f"a{motion_format(name).suffixes[0]}"
    path.write_text("before")
    several = motion(names=("a", "a\tb", "c"))
    try:
        write_motion(path, several)
    except InputError:
        assert path.read_text() == "before"
    else:
        assert read_motion(path).names == several.names
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    with pytest.raises(InputError, match="directory that does not exist"):
        write_motion(tmp_path / "none" / path.name, motion())


def test_the_way_up_can_be_stated(tmp_path):
    write_motion(tmp_path / "a.csv", motion())
    assert read_motion(tmp_path / "a.csv").up == ""
    assert read_motion(tmp_path / "a.csv", up="-z").up == "-z"


@pytest.mark.parametrize("scale", [1e-3, 100, 1000])
def test_another_unit_is_noticed_and_can_be_stated(tmp_path, scale):
    wrong = motion(points=scale * motion().points)
    write_motion(tmp_path / "a.csv", wrong)
    with pytest.raises(InputError, match="state the unit in which the file is: m, cm, mm or in"):
        read_motion(tmp_path / "a.csv")
    assert read_motion(tmp_path / "a.csv", unit="m").names == wrong.names
    few = np.full((6, 3, 3), np.nan)
    few[:, 0] = 5000.0
    check_size(motion(points=few))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"names": ("a", "b", "a")}, '"a" twice'),
        ({"names": ("a", "b")}, "points have shape"),
        ({"time": np.arange(6)[::-1]}, r"walk: frame 1: got time 4 s after 5 s; expected times that ascend"),
        ({"time": np.zeros(6)}, "times that ascend"),
        ({"time": np.full(6, np.nan)}, "finite times"),
        ({"rate": 0.0}, "a positive rate"),
        ({"rate": np.nan}, "a positive rate"),
        ({"up": "north"}, 'up: got "north"'),
        ({"clip": np.full(6, 2), "clips": ("x", "y")}, "clips 2 to 2; expected 0 to 1"),
        ({"clip": np.zeros(6), "clips": ("x", "x")}, "each named once"),
        ({"clips": ("x",), "actions": ("walk", "run")}, "one action a clip"),
        ({"rates": np.array([1.0, 2.0])}, "1 positive rates"),
        ({"points": np.full((6, 3, 3), np.inf)}, "three finite numbers"),
    ],
)
def test_a_motion_that_is_none_is_refused(changed, words):
    with pytest.raises(InputError, match=words) as refused:
        motion(**changed)
    assert "\n" not in str(refused.value)


def test_clips_are_taken_by_name():
    clip = np.array([0, 1, 0, 1, 0, 1])
    two = motion(clip=clip, clips=("walk", "run"), actions=("on foot", "fast"), rates=np.array([50.0, 25.0]))
    run = two.of_clip("run")
    np.testing.assert_array_equal(run.points, two.points[1::2])
    assert (run.rate, run.actions, run.clips) == (25.0, ("fast",), ("run",))
    with pytest.raises(InputError, match="did you mean run"):
        two.of_clip("runn")
    empty = motion(
        clip=0 * clip, clips=("walk", "run"), actions=("on foot", "fast"), rates=np.array([50.0, 25.0])
    )
    with pytest.raises(InputError, match='clip "run": got no frame'):
        empty.of_clip("run")


def test_each_format_says_what_it_is():
    for name, one in motion_formats().items():
        assert one.name == name
        assert one.title
        assert one.read or one.write_configurations or one.write_points
    assert set(POINTS) <= {name for name, one in motion_formats().items() if one.write_points}
