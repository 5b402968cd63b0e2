"""Results: JSON and NPZ hold the same, and damage is refused."""

import io
import json
import zipfile
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.formats.own import Result, ResultFrame, read_result, write_result
from posekit.formats.own import result_npz as result_npz_module
from posekit.skeleton import JOINTS

NQ = 29
CAMERA = {"f": 0.05, "rotation": np.eye(3), "position": np.array([4.0, 0.0, 0.1]), "residual": 1e-5}
NO_CAMERA = dict.fromkeys(CAMERA)


def a_frame(rng, count, *, groups=True, camera=CAMERA, pruned=None, levels=14) -> ResultFrame:
    joints = rng.normal(size=(count, 14, 3))
    margins = {"joint_range": rng.normal(size=count), "collision": rng.normal(size=count)}
    if count:
        joints[0, 3] = np.nan
        margins["collision"][0] = np.nan
    return ResultFrame(
        time=rng.random(),
        camera=camera,
        levels={"joint": JOINTS[:levels], "physical": range(levels), "motion": range(levels)},
        joints=joints,
        q=rng.normal(size=(count, NQ)),
        branches=["".join(rng.choice(["0", "1"], 13)) for _ in range(count)],
        groups=np.arange(count) // 2 if groups else None,
        margins=margins,
        fk_distance=rng.random(count),
        length_residual=np.zeros(count),
        rejected={f"joint_range/right_elbow.flexion{count % 3}": 128, "collision/a|b": 0},
        pruned=pruned,
    )


def a_result(rng, counts=(3, 0, 5), unit="m", settings=None, **frame) -> Result:
    return Result(
        unit=unit,
        configuration_names=[f"q{index}" for index in range(NQ)],
        settings={"checks": ["joint-range"], "rigid": 0.01, "none": None} if settings is None else settings,
        frames=[a_frame(rng, count, **frame) for count in counts],
    )


def assert_same(one: Result, other: Result, rtol: float = 0.0) -> None:
    for name in ("unit", "joint_names", "configuration_names", "settings"):
        assert getattr(one, name) == getattr(other, name)
    assert len(one.frames) == len(other.frames)
    for a, b in zip(one.frames, other.frames, strict=True):
        for name in ("time", "branches", "levels", "rejected", "pruned"):
            assert getattr(a, name) == getattr(b, name), name
        for name in ("joints", "q", "fk_distance", "length_residual"):
            np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=rtol, err_msg=name)
        assert (a.groups is None) == (b.groups is None)
        if a.groups is not None and b.groups is not None:
            assert np.array_equal(a.groups, b.groups)
        assert set(a.margins) == set(b.margins)
        for name in a.margins:
            assert np.array_equal(a.margins[name], b.margins[name], equal_nan=True)
        for name, value in a.camera.items():
            if value is None:
                assert b.camera[name] is None
            else:
                np.testing.assert_allclose(value, b.camera[name], rtol=rtol)


@pytest.mark.parametrize("suffix", ["json", "npz"])
@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
@pytest.mark.parametrize("kind", ["all", "no groups", "no camera", "pruned", "few levels"])
def test_a_result_is_read_back(tmp_path, rng, suffix, unit, kind):
    kinds: dict[str, dict[str, Any]] = {
        "all": {},
        "no groups": {"groups": False},
        "no camera": {"camera": NO_CAMERA},
        "pruned": {"pruned": [{"branch": "01", "by": "collision", "value": -0.01, "at": None}]},
        "few levels": {"levels": 3},
    }
    result = a_result(rng, unit=unit, **kinds[kind])
    path = tmp_path / f"result.{suffix}"
    write_result(path, result)
    assert_same(result, read_result(path), rtol=0.0 if unit == "m" else 3e-16)


@given(st.lists(st.integers(0, 6), min_size=1, max_size=5).filter(any), st.integers(0, 2**32 - 1))
def test_json_and_npz_hold_the_same(tmp_path_factory, counts, seed):
    folder = tmp_path_factory.mktemp("results")
    result = a_result(np.random.default_rng(seed), counts, unit="cm")
    for suffix in ("json", "npz"):
        write_result(folder / f"r.{suffix}", result)
    assert_same(read_result(folder / "r.json"), read_result(folder / "r.npz"))


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_no_survivor_at_all_is_a_result(tmp_path, rng, suffix):
    result = a_result(rng, (0, 0), groups=False)
    write_result(tmp_path / f"r.{suffix}", result)
    back = read_result(tmp_path / f"r.{suffix}")
    assert [len(frame.joints) for frame in back.frames] == [0, 0]
    assert back.frames[0].joints.shape == (0, 14, 3)
    assert back.frames[0].q.shape == (0, NQ)


def test_frames_that_differ_in_camera_and_levels(tmp_path, rng):
    frames = [
        a_frame(rng, 2),
        a_frame(rng, 1, camera=NO_CAMERA, levels=5, pruned=[]),
        a_frame(rng, 4, levels=0),
    ]
    result = Result(unit="m", configuration_names=["x"] * NQ, settings={}, frames=frames)
    for suffix in ("json", "npz"):
        write_result(tmp_path / f"r.{suffix}", result)
        assert_same(result, read_result(tmp_path / f"r.{suffix}"))


def test_the_json_is_what_the_design_says(tmp_path, rng):
    result = a_result(rng, (2,), unit="cm")
    write_result(tmp_path / "r.json", result)
    document = json.loads((tmp_path / "r.json").read_text())
    assert list(document) == ["schema", "unit", "joint_names", "configuration_names", "settings", "frames"]
    assert document["schema"] == "posekit.result/2"
    frame = document["frames"][0]
    assert list(frame) == ["time", "camera", "levels", "postures", "rejected"]
    assert frame["camera"]["f"] == 5.0
    assert frame["camera"]["position"] == [400.0, 0.0, 10.0]
    posture = frame["postures"][1]
    names = ["joints", "q", "branches", "group", "margins", "fk_distance", "length_residual"]
    assert list(posture) == names
    np.testing.assert_allclose(posture["joints"], result.frames[0].joints[1] * 100)
    assert posture["q"] == result.frames[0].q[1].tolist()
    assert frame["postures"][0]["joints"][3] == [None] * 3
    assert frame["postures"][0]["margins"]["collision"] is None


def test_the_npz_is_plain_numpy(tmp_path, rng):
    result = a_result(rng, (2, 0, 5), unit="cm")
    write_result(tmp_path / "r.npz", result)
    with np.load(tmp_path / "r.npz", allow_pickle=False) as arrays:
        assert arrays["count"].tolist() == [2, 0, 5]
        assert arrays["joints"].shape == (3, 5, 14, 3)
        np.testing.assert_array_equal(arrays["joints"][0, :2], result.frames[0].joints * 100)
        assert np.isnan(arrays["joints"][1]).all()
        assert arrays["q"].shape == (3, 5, NQ)
        assert arrays["branches"][2].tolist() == list(result.frames[2].branches)
        assert arrays["margins/joint_range"].shape == (3, 5)
        assert arrays["rejected/counts"].shape == (3, len(arrays["rejected/names"]))
        assert json.loads(str(arrays["settings"])) == result.settings
        assert str(arrays["schema"]) == "posekit.result/2"


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_the_same_result_gives_the_same_bytes(tmp_path, suffix):
    for name in "ab":
        write_result(tmp_path / f"{name}.{suffix}", a_result(np.random.default_rng(3)))
    assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()


def test_a_thousand_frames_are_written_and_read_in_seconds(tmp_path, rng):
    counts = np.minimum(rng.geometric(0.05, 1000), 200)
    write_result(tmp_path / "r.npz", a_result(rng, counts))
    assert sum(len(frame.joints) for frame in read_result(tmp_path / "r.npz").frames) == counts.sum()


@pytest.mark.parametrize("name", ["r.csv", "r", "r.gz"])
def test_other_suffixes_are_refused(tmp_path, rng, name):
    for act in (lambda: write_result(tmp_path / name, a_result(rng)), lambda: read_result(tmp_path / name)):
        with pytest.raises(InputError, match=r"the suffix \"[.a-z]*\"; expected \.json or \.npz"):
            act()
    assert not list(tmp_path.iterdir())


def changed(frame: ResultFrame, **changes) -> ResultFrame:
    return ResultFrame(**(vars(frame) | changes))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"joints": np.zeros((2, 13, 3))}, r"joints: got shape \(2, 13, 3\)"),
        ({"joints": np.full((3, 14, 3), np.inf)}, "joints: got an infinite number"),
        ({"q": np.zeros((2, NQ))}, r"q: got shape \(2, 29\)"),
        ({"branches": ["0"]}, "branches: got 1 codes; expected 3"),
        ({"groups": np.array([0, -1, 2])}, "groups: got"),
        ({"margins": {"a": np.zeros(2)}}, r"margins.a: got shape \(2,\)"),
        ({"margins": {"a": np.full(3, np.inf)}}, "margins.a: got an infinite number"),
        ({"fk_distance": np.zeros(2)}, "fk_distance: got shape"),
        ({"time": np.nan}, "time: got nan"),
        ({"camera": {"g": 1}}, "camera: got g"),
        ({"camera": {"rotation": np.eye(2)}}, r"camera.rotation: got shape \(2, 2\)"),
        ({"levels": {"joint": ["neck"], "physical": [1], "motion": []}}, "levels: got"),
    ],
)
def test_a_frame_that_cannot_be_is_refused(rng, changes, text):
    with pytest.raises(InputError, match=text):
        changed(a_frame(rng, 3), **changes)


def test_a_result_that_cannot_be_is_refused(rng):
    frame = a_frame(rng, 2)
    fields: dict[str, Any] = {
        "unit": "m",
        "configuration_names": ["x"] * NQ,
        "settings": {},
        "frames": [frame],
    }
    cases: list[tuple[dict[str, Any], str]] = [
        ({"frames": []}, "frames: got no frame"),
        ({"configuration_names": ["x"]}, r"frames\[0\].q: got 29 columns; expected 1"),
        ({"joint_names": JOINTS[::-1]}, "expected the 14 joints in tree order"),
        ({"frames": [frame, changed(frame, margins={})]}, r"frames\[1\].margins: got none"),
        ({"frames": [frame, changed(frame, groups=None)]}, r"frames\[1\].groups"),
    ]
    for changes, text in cases:
        with pytest.raises(InputError, match=text):
            Result(**(fields | changes))


def test_nan_in_a_camera_is_none(rng):
    frame = a_frame(rng, 1, camera={"f": np.nan, "rotation": np.full((3, 3), np.nan)})
    assert frame.camera == NO_CAMERA


BAD_JSON = [
    (("schema",), "posekit.view/1", "give a file of schema posekit.result/2 instead"),
    (("joint_names",), list(JOINTS[::-1]), "expected the 14 joints in tree order"),
    (("frames",), [], "frames: got []; expected at least 1"),
    (("frames", 0, "levels", "motion"), [1], "frames[0].levels: got 14, 14 and 1 entries"),
    (("frames", 0, "postures", 1, "q"), [0.0], "frames[0].postures[1].q: got 1 entries; expected 29"),
    (
        ("frames", 0, "postures", 1, "joints"),
        [],
        "frames[0].postures[1].joints: got []; expected at least 14",
    ),
    (("frames", 0, "postures", 1, "joints", 2), [1, 2], "frames[0].postures[1].joints[2]: got [1, 2]"),
    (("frames", 0, "postures", 1, "group"), None, "with and without a group"),
    (("frames", 0, "postures", 1, "group"), -1, "frames[0].postures[1].group: got -1"),
    (("frames", 0, "postures", 1, "group"), 10**300, "frames[0].postures[1].group: got 1000"),
    (("frames", 0, "postures", 1, "branches"), ..., "frames[0].postures[1].branches: got nothing"),
    (("frames", 0, "rejected"), {"a": 1.5}, "frames[0].rejected.a: got 1.5; expected a whole number"),
    (("frames", 0, "pruned"), [{}, 1], "frames[0].pruned[1]: got 1; expected an object"),
    (("frames", 0, "camera", "rotation"), [[1, 2], [3, 4]], "frames[0].camera.rotation"),
    (("frames", 0, "time"), float("nan"), "frames[0].time: got NaN"),
]


@pytest.mark.parametrize(("place", "value", "text"), BAD_JSON)
def test_json_that_breaks_the_schema_is_one_clear_line(tmp_path, rng, place, value, text):
    path = tmp_path / "r.json"
    write_result(path, a_result(rng, (2,)))
    document = json.loads(path.read_text())
    *parents, last = place
    node = document
    for part in parents:
        node = node[part]
    if value is ...:
        del node[last]
    else:
        node[last] = value
    path.write_text(json.dumps(document))
    with pytest.raises(InputError) as caught:
        read_result(path)
    assert text in str(caught.value)
    assert str(caught.value).isprintable()


def rewritten(path, changes):
    """Write an NPZ again with some arrays changed or (None) left out."""
    with np.load(path, allow_pickle=False) as arrays:
        content = {**dict(arrays), **changes}
    np.savez_compressed(path, **{name: value for name, value in content.items() if value is not None})


BAD_NPZ: list[tuple[dict[str, Any], str]] = [
    ({"schema": np.array("posekit.view/1")}, 'schema: got "posekit.view/1"'),
    ({"schema": np.array(["posekit.result/2"])}, r"schema: got shape \(1,\); expected shape \(\)"),
    ({"unit": np.array("inch")}, 'unit: got "inch"; expected m or cm or mm'),
    ({"unit": None}, "unit: got nothing; expected the array unit"),
    ({"joints": np.zeros((2, 5, 13, 3))}, r"joints: got shape \(2, 5, 13, 3\)"),
    ({"joints": np.zeros((2, 1, 14, 3))}, r"joints: got shape \(2, 1, 14, 3\); expected \(2, 2 or more"),
    ({"joints": np.zeros((2, 2, 14, 3), dtype=np.int64)}, "joints: got dtype int64; expected floating-point"),
    ({"joints": np.full((2, 2, 14, 3), np.inf)}, r"joints\[0, 0, 0\]: got an infinite number"),
    ({"joints": np.asfortranarray(np.zeros((2, 2, 14, 3)))}, "in Fortran order"),
    ({"count": np.array([2, -1])}, "count: got counts"),
    ({"count": np.array([2, 10**9])}, "at most 1,000 MB of survivors"),
    ({"count": np.array([2])}, r"count: got shape \(1,\)"),
    ({"time": np.array([0.0, np.inf])}, r"time\[1\]: got an infinite number"),
    ({"time": np.array([0.0, np.nan])}, "time: got nan"),
    ({"settings": np.array("[1]")}, "settings: got"),
    ({"settings": np.array('{"a": NaN}')}, "settings: a: got NaN"),
    ({"settings": np.array("{")}, "settings: line 1 column 2"),
    ({"pruned": np.array("[]")}, "pruned: got"),
    ({"joint_names": np.array(JOINTS[::-1])}, "expected the 14 joints in tree order"),
    ({"branches": np.array([[b"0", b"1"]] * 2)}, "branches: got dtype .*; expected text"),
    ({"levels/physical": np.zeros((2, 3), dtype=np.int64)}, "levels/physical: got shape"),
]


@pytest.mark.parametrize(
    ("changes", "text"), BAD_NPZ, ids=[f"{i}-{next(iter(b[0]))}" for i, b in enumerate(BAD_NPZ)]
)
def test_npz_that_breaks_the_schema_is_one_clear_line(tmp_path, rng, changes, text):
    path = tmp_path / "r.npz"
    write_result(path, a_result(rng, (2, 1)))
    rewritten(path, changes)
    with pytest.raises(InputError, match=text) as caught:
        read_result(path)
    assert str(caught.value).isprintable()


def test_damage_anywhere_is_refused_or_harmless(tmp_path, rng):
    path = tmp_path / "r.npz"
    write_result(path, a_result(rng, (2, 1)))
    whole = path.read_bytes()
    for _ in range(400):
        data = bytearray(whole)
        for place in rng.integers(0, len(data), rng.integers(1, 4)):
            data[place] = rng.integers(256)
        path.write_bytes(data[: rng.integers(1, len(data))] if rng.random() < 0.2 else data)
        try:
            read_result(path)
        except InputError as error:
            assert str(error).isprintable()


def test_padding_is_bounded_but_never_held(tmp_path, rng, monkeypatch):
    path = tmp_path / "r.npz"
    write_result(path, a_result(rng, (1, 0, 0, 0, 0, 0, 0, 0, 0, 300)))
    assert len(read_result(path).frames[-1].joints) == 300
    monkeypatch.setattr(result_npz_module, "MAX_PADDED", 200_000)
    with pytest.raises(InputError, match="MB of arrays when unpacked"):
        read_result(path)


def test_a_result_too_large_for_json_says_npz(tmp_path, rng, monkeypatch):
    monkeypatch.setattr("posekit.safe_io.writing.MAX_BYTES", 10_000)
    with pytest.raises(InputError, match=r"name it \.npz"):
        write_result(tmp_path / "r.json", a_result(rng, (20,)))
    assert not list(tmp_path.iterdir())


def test_an_npz_without_pickles(tmp_path, rng):
    path = tmp_path / "r.npz"
    write_result(path, a_result(rng, (2,)))
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.array([{"a": 1}], dtype=object))
    with zipfile.ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    content["q.npy"] = buffer.getvalue()
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in content.items():
            archive.writestr(name, data)
    with pytest.raises(InputError, match="q: got dtype object"):
        read_result(path)
