"""posekit's own files: views, postures, results and reports are read as they were written; damage is refused."""

from __future__ import annotations

import dataclasses
import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.cameras import LeeChenCamera, PinholeCamera, ScaledOrthographicCamera, View
from posekit.errors import InputError
from posekit.formats.view_file import read_object
from posekit.motion import Motion
from posekit.recovery import Answer, Frames, Paths, Recovery, Survivors
from posekit.skeleton import HEAD_POINTS, JOINTS, SEGMENT_NAMES
from posekit.validators.report import Report

RNG = np.random.default_rng(5)


def same(a: Any, b: Any, tolerance: float = 0.0) -> bool:
    """Tell whether two objects are equal field by field; NaN equals NaN."""
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(
            same(getattr(a, one.name), getattr(b, one.name), tolerance)
            for one in dataclasses.fields(a)
            if one.name not in ("source", "document", "layout")
        )
    if isinstance(a, dict):
        return set(a) == set(b) and all(same(a[name], b[name], tolerance) for name in a)
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(same(x, y, tolerance) for x, y in zip(a, b, strict=True))
    if isinstance(a, np.ndarray) and a.dtype.kind == "f":
        return a.shape == np.shape(b) and np.allclose(a, b, rtol=tolerance, atol=0, equal_nan=True)
    if isinstance(a, float):
        return bool(np.isclose(a, b, rtol=tolerance, atol=0, equal_nan=True))
    return np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b


def view(camera: Any, unit: str = "m") -> View:
    image = RNG.uniform(0, 640, (3, 14, 2))
    image[1, 4] = np.nan
    head = RNG.uniform(0, 640, (3, 5, 2))
    head[:, 3] = np.nan
    return View(
        camera=camera,
        time=np.array([0.0, 0.1, 0.25]),
        image=image,
        head_image=head,
        own_head_image=RNG.uniform(0, 640, (3, 1, 2)),
        confidence=np.where(RNG.uniform(size=(3, 19)) < 0.3, np.nan, RNG.uniform(size=(3, 19))),
        root=np.array([[0.0, 0.1, 4], [np.nan] * 3, [0.2, 0.1, 4.5]]),
        truth=RNG.uniform(-1, 5, (3, 14, 3)),
        lengths={SEGMENT_NAMES[0]: 0.2, SEGMENT_NAMES[7]: 0.31},
        shoulders="front",
        stature=1.76,
        deviation=2.5,
        length_deviation=0.04,
        derived=("pelvis",),
        head_points={
            "neck": np.zeros(3),
            "nose": np.array([0.1, 0, 0.15]),
            "tip of the hat": np.array([0, 0, 0.4]),
        },
        unit=unit,
        pictures=("a.png", "b.png", "c.png"),
    )


CAMERAS = (
    LeeChenCamera(f=0.05),
    LeeChenCamera(f=None),
    ScaledOrthographicCamera(scale=211.5, aspect=1.1),
    ScaledOrthographicCamera(scale=None),
    PinholeCamera(K=[[900, 0, 320], [0, 910, 240], [0, 0, 1]]),
    PinholeCamera(
        K=[[900, 0.5, 320], [0, 910, 240], [0, 0, 1]],
        distortion=[-0.2, 0.1, 1e-3, 2e-3, 0.01, 0.1, 0.02, 0.003],
        R=[[0, 1, 0], [0, 0, -1], [-1, 0, 0]],
        t=[0.1, 0.2, 4.0],
        size=(640, 480),
        up="+z",
        name="left",
        how="a guess",
        deviation=0.05,
    ),
    PinholeCamera(K=[[900, 0, 320], [0, 910, 240], [0, 0, 1]], distortion=[0.1, 0, 0, 0], fisheye=True),
)


@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: type(camera).__name__)
def test_a_view_is_read_as_it_was_written(camera: Any, unit: str, tmp_path: Path) -> None:
    written = view(camera, unit)
    posekit.save(written, tmp_path / "view.json.gz")
    found = posekit.open(tmp_path / "view.json.gz")
    assert same(written, found, 0 if unit == "m" else 1e-15)
    assert found.source == str(tmp_path / "view.json.gz")


def test_the_paper_s_camera_has_y_up_in_its_file(tmp_path: Path) -> None:
    posekit.save(view(LeeChenCamera(f=0.05)), tmp_path / "view.json")
    document = json.loads((tmp_path / "view.json").read_text())
    found = posekit.open(tmp_path / "view.json")
    assert document["frames"][0]["image"]["pelvis"] == [found.image[0, 3, 0], -found.image[0, 3, 1]]


def test_the_view_of_another_object_has_its_points(tmp_path: Path) -> None:
    frames = [{"time": 0.5, "image": {"a": [1.0, 2.0], "c": [3.0, 4.0]}, "truth": {"a": [10.0, 20.0, 30.0]}}]
    camera = {"model": "scaled-orthographic", "scale": 2.0, "aspect": 1.5}
    document = {"schema": "posekit.view/1", "unit": "cm", "camera": camera, "frames": frames}
    found = read_object(document, "arm.json", ("a", "b", "c"))
    assert found["scale"] == 200.0 and found["aspect"] == 1.5 and found["time"].tolist() == [0.5]
    assert found["image"][0, [0, 2]].tolist() == [[1, 2], [3, 4]] and np.isnan(found["image"][0, 1]).all()
    assert found["truth"][0, 0] == pytest.approx([0.1, 0.2, 0.3])
    with pytest.raises(
        InputError, match=r"frames\[0\].image.c: got \"c\"; expected the name of a point of the object"
    ):
        read_object(document, "arm.json", ("a", "b"))
    (tmp_path / "arm.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match="recover another articulated object with --linkage"):
        posekit.open(tmp_path / "arm.json")


def changed(place: str, value: Any = None) -> Callable[[Any], None]:
    """Return a change of one value of a document; a value of None removes it."""

    def change(document: Any) -> None:
        *path, last = [int(one) if one.isdecimal() else one for one in place.split("/")]
        for one in path:
            document = document[one]
        if value is None:
            del document[last]
        else:
            document[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            changed("frames/1/image/left_knee", [1.0, float("nan")]),
            "frames[1].image.left_knee: got [1.0, NaN]; expected 2",
        ),
        (changed("frames/1/image/left_knee", [1.0, float("inf")]), "frames[1].image.left_knee"),
        (changed("frames/1/image/left_knee", "there"), 'frames[1].image.left_knee: got "there"; expected 2'),
        (changed("frames/1/image/left_kne", [1.0, 2.0]), 'frames[1].image.left_kne: got "left_kne"'),
        (changed("frames/1/time"), "frames[1].time: got nothing; expected this field; add it"),
        (changed("frames/1/time", True), "frames[1].time: got true; expected a finite number"),
        (
            changed("frames/1/tme", 1.0),
            "frames[1].tme: got a field; expected no field of this name; did you mean time?",
        ),
        (changed("frames/2/image", []), "frames[2].image: got []; expected an object"),
        (changed("frames/1/image/left_knee", ["1.0", "2.0"]), "frames[1].image.left_knee: got "),
        (changed("frames/1/image/left_knee", [True, False]), "frames[1].image.left_knee: got "),
        (changed("camera/K", [["9", "0", "3"], ["0", "9", "2"], ["0", "0", "1"]]), "camera.K: got "),
        (
            changed("camera/K/0", [1.0, 2.0]),
            "camera.K: got a list of 3 entries; expected finite numbers, 3 x 3",
        ),
        (changed("camera/K", [[0, 0, 0], [0, 1, 0], [0, 0, 1]]), "camera.K: got focal lengths 0 and 1"),
        (changed("camera/model", "opencvv"), 'camera.model: got "opencvv"; expected "lee-chen" or "opencv"'),
        (changed("figure/stature", -1), "figure.stature: got -1; expected a number greater than 0"),
        (changed("figure/lengths", {"hip-knee": 0.4}), "figure.lengths.hip-knee: got a field"),
        (
            changed("length_deviation", 0.9),
            "length_deviation: got 0.9; expected a finite number from 0 to 0.3",
        ),
        (changed("unit", "inch"), 'unit: got "inch"; expected "m" or "cm" or "mm"'),
        (changed("schema", "posekit.view/7"), 'schema: got "posekit.view/7"; expected "posekit.view/1"'),
        (changed("frames", {}), "frames: got an object of 0 entries"),
    ],
)
def test_a_damaged_view_is_refused_by_name(change: Callable[[Any], None], said: str, tmp_path: Path) -> None:
    path = tmp_path / "view.json"
    posekit.save(view(CAMERAS[5]), path)
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    with pytest.raises(InputError) as error:
        posekit.open(path)
    assert (
        str(error.value).startswith(f"{path}: ") and said in str(error.value) and "\n" not in str(error.value)
    )


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "an empty file"),
        (b"{", "line 1 column 2: got the end of the file; expected JSON"),
        (b'{"a": 1, "a": 2}', "a: got the same key twice in one object"),
        (b"[" * 100_000, "nested too deeply"),
        (b'{"a": ' + b"9" * 5000 + b"}", "ordinary length"),
        (b"\xff\xfe{", "a damaged text"),
        (b"null", "expected motion, key points, a view"),
    ],
)
def test_json_that_is_damaged_is_refused(data: bytes, said: str, tmp_path: Path) -> None:
    (tmp_path / "file.json").write_bytes(data)
    with pytest.raises(InputError, match=said.replace("[", r"\[")):
        posekit.open(tmp_path / "file.json")


@pytest.mark.parametrize("unit", ["m", "cm"])
def test_postures_are_read_as_they_were_written(unit: str, tmp_path: Path) -> None:
    joints = RNG.uniform(-1, 2, (4, 19, 3))
    joints[2, 5] = np.nan
    names = (*JOINTS, *HEAD_POINTS)
    for time in (None, np.arange(4) / 30):
        written = Motion(joints=joints, joint_names=names, time=time, up="+y", unit=unit)
        posekit.save(written, tmp_path / "postures.json")
        assert same(written, posekit.open(tmp_path / "postures.json"), 0 if unit == "m" else 4e-16)


def test_configurations_are_read_as_they_were_written(tmp_path: Path) -> None:
    written = Motion(q=RNG.normal(size=(3, 4)), q_names=("a", "b", "c", "d"), robot="g1")
    posekit.save(written, tmp_path / "q.json")
    assert same(written, posekit.open(tmp_path / "q.json"))


def test_postures_of_earlier_files_are_read(tmp_path: Path) -> None:
    points = RNG.uniform(-100, 200, (2, 3, 3))
    document = {"schema": "posekit.postures/1", "unit": "cm", "joint_names": ["left_hip", "neck", "nose"]}
    postures = points.tolist()
    postures[1][2] = None
    (tmp_path / "p.json").write_text(json.dumps({**document, "postures": postures}))
    found = posekit.open(tmp_path / "p.json")
    assert found.figure_joints[0, JOINTS.index("left_hip")] == pytest.approx(points[0, 0] / 100)
    assert np.isnan(found.head[1, 0]).all() and found.head[0, 0] == pytest.approx(points[0, 2] / 100)
    arrays = {"joints": points / 100, "joint_names": np.array(document["joint_names"])}
    np.savez(tmp_path / "p.npz", schema=np.array("posekit.postures/1"), **arrays)
    assert posekit.open(tmp_path / "p.npz").figure_joints == pytest.approx(
        np.where(
            np.isnan(found.figure_joints) & (np.arange(2) < 1)[:, None, None], np.nan, found.figure_joints
        ),
        nan_ok=True,
    )
    with pytest.raises(InputError, match=r"postures\[1\]: got 2 points; expected 3"):
        (tmp_path / "p.json").write_text(json.dumps({**document, "postures": [postures[0], postures[1][:2]]}))
        posekit.open(tmp_path / "p.json")


def recovery(unit: str = "m", *, noisy: bool = True, followed: bool = True) -> Recovery:
    """Return a result of three frames with 3, 0 and 2 postures."""
    frame = np.array([0, 0, 0, 2, 2])
    joints = RNG.uniform(-1, 5, (5, 14, 3))
    joints[3, 8] = np.nan
    extras = {
        "chi2": RNG.uniform(1, 20, 5),
        "radius": RNG.uniform(0.01, 0.3, (5, 14)),
        "inferred": RNG.uniform(size=(5, 14)) < 0.2,
        "scale": RNG.uniform(100, 200, 5),
        "head": RNG.uniform(-1, 5, (5, 5, 3)),
        "group": np.array([0, 1, 1, 0, 0]),
    }
    answer = np.full((3, 14, 3), np.nan)
    answer[[0, 2]] = joints[[1, 3]]
    return Recovery(
        survivors=Survivors(
            frame=frame,
            joints=joints,
            q=RNG.normal(size=(5, 29)),
            probability=np.array([0.5, 0.3, 0.1, 0.9, 0.1]),
            branch=np.array(["0" * 13, "01" * 6 + "0", "1" * 13, "", ""]),
            margins={
                "joint-range": RNG.normal(size=5),
                "collision": np.array([0.1, np.nan, 0.2, 0.3, np.nan]),
            },
            **(extras if noisy else {}),
        ),
        frames=Frames(
            time=np.array([0.0, 0.04, 0.08]),
            pictures=("a.png", "b.png", "c.png"),
            camera=[
                {"f": 0.05, "position": np.array([1.0, 2, 3]), "residual": 1e-4},
                {},
                {"scale": 150.0, "residual": 2.5},
            ],
            rejected=[{"joint-range/right_knee": 8189}, {"no-solution/neck": 8192}, {"collision": 3}],
            levels=[(1, 2, 3), (), (1, 1, 2)],
            unlisted=np.array([4, 0, 0]),
            unlisted_probability=np.array([0.1, 0.0, 0.0]),
            reason=("", "no-solution/neck", ""),
            root=[{"method": "search", "estimate": 4.2, "deviation": 0.3}, None, None],
            judged=("exact", "", "noisy"),
        ),
        answer=Answer(
            joints=answer,
            sure=np.array([0.4, np.nan, 0.8]),
            sure_of=("position", "", "relative to the neck"),
            survivor=np.array([1, -1, 3]),
            representatives=[np.array([0, 2]), np.array([], dtype=int), np.array([3])],
            represented=[np.array([0.6, 0.3]), np.array([]), np.array([1.0])],
            nearer=RNG.integers(-1, 2, (3, 13)),
            nearer_sure=RNG.uniform(size=(3, 13)),
        ),
        path=Paths(
            survivor=np.array([[0, -1, 4], [2, -1, 3]]),
            probability=np.array([0.7, 0.3]),
            joints=RNG.uniform(-1, 5, (2, 3, 14, 3)),
        )
        if followed
        else None,
        settings={"checks": ["joint-range"], "deviation": 2.0, "ranges": "anatomical"},
        tolerances={"rigid": 1e-8},
        lengths={name: 0.3 + 0.01 * k for k, name in enumerate(SEGMENT_NAMES)},
        configuration_names=tuple(f"q{k}" for k in range(29)),
        unit=unit,
        camera={"model": "lee-chen", "f": 0.05},
        source="walk.json",
    )


@pytest.mark.parametrize("noisy", [True, False])
@pytest.mark.parametrize(
    ("ending", "unit"), [(".json", "m"), (".json.gz", "cm"), (".npz", "cm"), (".parquet", "mm")]
)
def test_a_result_is_read_as_it_was_written(ending: str, unit: str, noisy: bool, tmp_path: Path) -> None:
    if ending == ".parquet":
        pytest.importorskip("pyarrow")
    written = recovery(unit, noisy=noisy, followed=noisy)
    posekit.save(written, tmp_path / f"result{ending}")
    found = posekit.open(tmp_path / f"result{ending}")
    exact = unit == "m" or ".json" not in ending
    for name in (
        "survivors",
        "answer",
        "path",
        "settings",
        "tolerances",
        "camera",
        "configuration_names",
        "unit",
    ):
        assert same(getattr(written, name), getattr(found, name), 0 if exact else 4e-16), name
    for name in ("time", "pictures", "rejected", "unlisted", "unlisted_probability", "reason", "judged"):
        assert same(getattr(written.frames, name), getattr(found.frames, name)), name
    assert [list(one) for one in found.frames.levels] == [list(one) for one in written.frames.levels]
    assert found.frames.root[0]["estimate"] == pytest.approx(4.2, rel=1e-15)
    assert np.asarray(found.frames.camera[0]["position"]) == pytest.approx([1, 2, 3], rel=1e-15)
    assert found.frames.camera[0]["residual"] == pytest.approx(1e-4, rel=1e-15)
    assert found.frames.camera[2] == pytest.approx({"scale": 150.0, "residual": 2.5}, rel=1e-15)
    assert found.lengths == pytest.approx(dict(written.lengths), rel=1e-15)


def test_the_json_of_a_result_is_what_others_read(tmp_path: Path) -> None:
    written = recovery("cm")
    posekit.save(written, tmp_path / "result.json")
    document = json.loads((tmp_path / "result.json").read_text())
    assert document["schema"] == "posekit.result/3" and document["unit"] == "cm"
    frame = document["frames"][2]
    assert frame["postures"][1]["joints"][0] == pytest.approx((100 * written.survivors.joints[4, 0]).tolist())
    assert frame["postures"][0]["joints"][8] == [None] * 3
    assert frame["postures"][1]["probability"] == 0.1
    assert frame["answer"]["representatives"] == [0] and frame["answer"]["survivor"] == 0
    assert frame["answer"]["sure"] == 0.8
    assert document["frames"][1]["postures"] == [] and document["frames"][1]["answer"]["survivor"] is None
    assert document["frames"][0]["camera"]["f"] == pytest.approx(5.0)


def test_pandas_reads_the_parquet_of_a_result(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    pandas = pytest.importorskip("pandas")
    written = recovery()
    posekit.save(written, tmp_path / "result.parquet")
    table = pandas.read_parquet(tmp_path / "result.parquet")
    assert table["left_knee_y"].to_numpy() == pytest.approx(
        written.survivors.joints[:, JOINTS.index("left_knee"), 1]
    )
    assert table["q_3"].to_numpy() == pytest.approx(written.survivors.q[:, 3])
    assert table["time"].tolist() == [0, 0, 0, 0.08, 0.08]


def earlier() -> dict[str, Any]:
    """Return a result of the version before, of two frames with 2 and 1 postures, as JSON."""
    joints = (100 * RNG.uniform(-1, 5, (3, 14, 3))).tolist()
    refined = {"chi2": 4.0, "dof": 3, "p": 0.3, "merged": 0, "covariance": [[4.0, 0, 0, 4, 0, 4]] * 14}
    posture = {
        "q": [0.1] * 29,
        "branches": "0" * 13,
        "margins": {"collision": 0.2},
        "fk_distance": 0,
        "length_residual": 0,
    }
    frame = {
        "camera": {"f": 5.0, "rotation": None, "position": None, "residual": None},
        "rejected": {"collision": 2},
    }
    levels = {"joint": ["neck"], "physical": [2], "motion": [1]}
    frames = []
    for time, chances, rows in ((0.0, (0.2, 0.8), (0, 1)), (0.5, (1.0,), (2,))):
        postures = [
            {
                **posture,
                "joints": joints[row],
                "probability": chance,
                "refined": refined,
                "inferred": {"left_wrist": {}},
            }
            for row, chance in zip(rows, chances, strict=True)
        ]
        answer = {
            "representatives": [len(rows) - 1],
            "probability": [0.9],
            "near": [0.1] * 11,
            "far": [0.2] * 11,
        }
        frames.append(
            {**frame, "time": time, "levels": levels, "postures": postures, "answer": answer, "unlisted": 3}
        )
    return {
        "schema": "posekit.result/2",
        "unit": "cm",
        "joint_names": list(JOINTS),
        "configuration_names": [f"q{k}" for k in range(29)],
        "settings": {"checks": ["collision"]},
        "frames": frames,
    }


def test_results_of_the_version_before_are_read(tmp_path: Path) -> None:
    document = earlier()
    (tmp_path / "r.json.gz").write_bytes(gzip.compress(json.dumps(document).encode()))
    found = posekit.open(tmp_path / "r.json.gz")
    given = [np.array(one["joints"]) / 100 for frame in document["frames"] for one in frame["postures"]]
    # The likelier posture comes first.
    assert found.survivors.probability.tolist() == [0.8, 0.2, 1.0] and found.survivors.frame.tolist() == [
        0,
        0,
        1,
    ]
    assert found.survivors.joints == pytest.approx(np.array([given[1], given[0], given[2]]), abs=1e-15)
    assert found.answer.survivor.tolist() == [0, 2] and found.answer.joints[0] == pytest.approx(given[1])
    assert found.survivors.inferred[0].nonzero()[0].tolist() == [JOINTS.index("left_wrist")]
    # 2 cm in each direction: 95 % lie within sqrt(7.81) deviations.
    assert found.survivors.radius[0, 0] == pytest.approx(0.02 * np.sqrt(7.815), rel=5e-3)
    assert found.frames.camera[0]["f"] == pytest.approx(0.05) and found.frames.levels[0] == (1,)
    np.savez(tmp_path / "r.npz", **padded(document))
    same = posekit.open(tmp_path / "r.npz")
    for table in ("survivors", "answer"):
        for name, values in vars(getattr(found, table)).items():
            other = getattr(getattr(same, table), name)
            if isinstance(values, np.ndarray) and values.dtype.kind == "f":
                assert np.allclose(values, other, atol=1e-12, equal_nan=True), name
            else:
                assert str(values) == str(other), name
    assert (
        same.frames.camera[0]["f"] == found.frames.camera[0]["f"]
        and same.frames.levels == found.frames.levels
    )
    assert same.frames.rejected == found.frames.rejected == ({"collision": 2},) * 2


def test_paths_roots_and_pictures_of_the_version_before_are_read(tmp_path: Path) -> None:
    document = earlier()
    joints = np.array([document["frames"][k]["postures"][-1]["joints"] for k in (0, 1)])
    smoothed = joints + 1.0
    smoothed[1] = np.nan
    path = {
        "share": 0.7,
        "survivor": [1, 0],
        "smoothed": json.loads(json.dumps(np.where(np.isnan(smoothed), None, smoothed).tolist())),
        "joints": joints.tolist(),
    }
    document["paths"] = {"paths": [path, {**path, "share": 0.3, "survivor": [0, -1]}]}
    document["settings"] |= {"pictures": ["a.png", "b.png"], "lengths": {SEGMENT_NAMES[0]: 0.2}}
    document["frames"][1]["root"] = {"method": "head", "estimate": 4.0, "deviation": 0.1, "more": 1}
    (tmp_path / "r.json").write_text(json.dumps(document), encoding="utf-8")
    found = posekit.open(tmp_path / "r.json")
    # The likelier posture of the first frame comes first now.
    assert found.path.survivor.tolist() == [[0, 2], [1, -1]] and found.path.probability.tolist() == [0.7, 0.3]
    assert found.path.joints[0] == pytest.approx(np.stack([joints[0] + 1.0, joints[1]]) / 100)
    assert list(found.frames.pictures) == ["a.png", "b.png"]
    assert found.lengths == pytest.approx({SEGMENT_NAMES[0]: 0.2})  # settings were in metres
    root = {"method": "head", "estimate": pytest.approx(0.04), "deviation": pytest.approx(1e-3)}
    assert list(found.frames.root) == [None, {**root, "lower": None, "upper": None}]


def padded(document: dict[str, Any]) -> dict[str, Any]:
    """Return the arrays of the NPZ of that version, padded to two postures a frame."""
    frames = document["frames"]
    postures = [[*frame["postures"], *frame["postures"]][:2] for frame in frames]

    def stacked(of: Any) -> Any:
        return np.array([[of(one) for one in row] for row in postures])

    return {
        **{name: document[name] for name in ("schema", "unit", "joint_names", "configuration_names")},
        "settings": json.dumps(document["settings"]),
        "count": [len(frame["postures"]) for frame in frames],
        "time": [frame["time"] for frame in frames],
        "camera/f": [frame["camera"]["f"] for frame in frames],
        "camera/rotation": np.full((2, 3, 3), np.nan),
        "camera/position": np.full((2, 3), np.nan),
        "camera/residual": np.full(2, np.nan),
        "levels/motion": [[1], [1]],
        "rejected/names": ["collision", "joint_range/neck"],
        "rejected/counts": [[2, -1], [2, -1]],
        "unlisted": [3, 3],
        "inferred": json.dumps([[one["inferred"] for one in frame["postures"]] for frame in frames]),
        **{
            name: stacked(lambda one, name=name: one[name])
            for name in ("joints", "q", "branches", "probability")
        },
        **{
            f"refined/{name}": stacked(lambda one, name=name: one["refined"][name])
            for name in ("chi2", "covariance")
        },
        "margins/collision": stacked(lambda one: one["margins"]["collision"]),
        "answer/representatives": [[len(frame["postures"]) - 1, -1] for frame in frames],
        "answer/probability": [[0.9, np.nan]] * 2,
    }


def test_damaged_results_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    posekit.save(recovery(), path)
    document = json.loads(path.read_text())
    for change, said in (
        (changed("frames/0/postures/1/joints/3", [1.0, 2.0]), "a damaged file"),
        (changed("frames/0/postures", 3), "a damaged file"),
        (changed("joint_names", ["neck"]), "joint_names"),
        (changed("unit", "inch"), "unit"),
        (changed("schema", "posekit.result/9"), "schema"),
        (changed("frames/0/answer/survivor", 99), "survivor"),
    ):
        damaged = json.loads(json.dumps(document))
        change(damaged)
        path.write_text(json.dumps(damaged))
        with pytest.raises(InputError, match=said):
            posekit.open(path)


def report() -> Report:
    return Report(
        clip=np.array([0, 0, 0, 1]),
        frame=np.array([0, 1, 2, 0]),
        time=np.array([0.0, 0.1, 0.2, np.nan]),
        files=("walk.bvh", "run.bvh"),
        names=("", "second"),
        checks=("joint-range", "collision"),
        units=("deg", "m"),
        places=("right_elbow.flexion", "left_shank right_shank"),
        findings={
            "row": np.array([1, 1, 2]),
            "check": np.array([0, 1, 0]),
            "place": np.array([0, 1, 0]),
            "value": np.array([170.0, -0.02, 171.5]),
            "lower": np.array([0.0, 0.0, 0.0]),
            "upper": np.array([150.0, np.nan, 150.0]),
            "margin": np.array([-20.0, -0.02, -21.5]),
        },
        margins=np.array([[0.1, 0.2], [-0.3, -0.1], [-0.4, np.nan], [np.nan, 0.5]]),
        silent=np.array([[False, False], [False, False], [False, True], [True, False]]),
        incomplete=np.array([False, False, False, True]),
        messages={"joint-range": "A joint is bent too far."},
        not_asked={"ground": "no up axis"},
        settings={"ranges": "anatomical", "contact_margin": 0.0},
        notes=("up axis +y",),
        warnings=("a warning",),
        refused=("broken.bvh: damaged",),
    )


@pytest.mark.parametrize("ending", [".json", ".json.gz", ".npz", ".parquet"])
def test_a_report_is_read_as_it_was_written(ending: str, tmp_path: Path) -> None:
    if ending == ".parquet":
        pytest.importorskip("pyarrow")
    written = report()
    posekit.save(written, tmp_path / f"report{ending}")
    found = posekit.open(tmp_path / f"report{ending}")
    assert same(written, found)
    assert found.decision == written.decision and found.verdicts == written.verdicts


def test_the_findings_are_a_table(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    written = report()
    posekit.save(written, tmp_path / "report.csv")
    table = pandas.read_csv(tmp_path / "report.csv")
    assert table["value"].tolist()[:3] == written.table()["value"].tolist()[:3]
    assert list(table.columns) == list(written.table())
