"""Bad input at the command line: one clear line, exit code 2, and nothing is written."""

import importlib
import json
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.cameras.head import HeadPoints
from posekit.skeleton import HEAD_POINTS

FIGURE = load_figure()


def edited(walk: dict[str, Any], *keys: Any, value: Any) -> dict[str, Any]:
    """Return the document with one entry set."""
    document = deepcopy(walk)
    node = document
    for key in keys[:-1]:
        node = node[key]
    node[keys[-1]] = value
    return document


BAD_VIEWS: dict[str, tuple[Callable[[dict[str, Any]], Any], tuple[str, ...]]] = {
    "malformed JSON": (lambda d: json.dumps(d)[:-9], ("view.json: line 1 column", "expected JSON")),
    "NaN": (
        lambda d: edited(d, "frames", 1, "image", "left_elbow", 0, value=float("nan")),
        ("view.json: frames[1].image.left_elbow[0]: got NaN", "finite number"),
    ),
    "Infinity": (
        lambda d: edited(d, "frames", 0, "truth", "pelvis", 2, value=float("-inf")),
        ("view.json: frames[0].truth.pelvis[2]: got -Infinity", "finite number"),
    ),
    "no neck in any frame": (
        lambda d: {
            **deepcopy(d),
            "frames": [
                {**frame, "image": {name: at for name, at in frame["image"].items() if name != "neck"}}
                for frame in d["frames"]
            ],
        },
        ("view.json: frames[0].image.neck: got nothing", "the tree grows from it"),
    ),
    "a neck is missing, and a joint is unknown elsewhere": (
        lambda d: {
            **deepcopy(d),
            "frames": [
                {**d["frames"][0], "image": {"left_elbow": d["frames"][0]["image"]["left_elbow"]}},
                {**d["frames"][1], "image": {**d["frames"][1]["image"], "left_elbo": [0, 0]}},
            ],
        },
        ("view.json: frames[1].image.left_elbo", "did you mean left_elbow"),
    ),
    "a neck is missing, and a root is wrong elsewhere": (
        lambda d: {
            **deepcopy(d),
            "camera": {"model": "lee-chen", "f": 5.0},
            "frames": [
                {"time": 0.0, "image": {"left_elbow": d["frames"][0]["image"]["left_elbow"]}},
                {**d["frames"][1], "root": [0.0, 0.0, -500.0]},
            ],
        },
        ("view.json: frames[1].root: [0.0, 0.0, -5.0] m is behind the camera",),
    ),
    "nothing hangs on the neck": (
        lambda d: {
            **deepcopy(d),
            "frames": [
                {**frame, "image": {name: frame["image"][name] for name in ("neck", "left_wrist")}}
                for frame in d["frames"]
            ],
        },
        ("view.json: frames[0]: none of right_shoulder, left_shoulder, pelvis is seen",),
    ),
    "unknown joint": (
        lambda d: edited(d, "frames", 0, "image", "left_elbo", value=[0, 0]),
        ("view.json: frames[0].image.left_elbo", "did you mean left_elbow"),
    ),
    "unknown segment": (
        lambda d: edited(d, "figure", "lengths", value={"pelvis-neck": 50}),
        ("view.json: figure.lengths", "did you mean neck-pelvis"),
    ),
    "zero length": (
        lambda d: edited(d, "figure", "lengths", value={"neck-pelvis": 0}),
        ("view.json: figure.lengths.neck-pelvis: got 0", "greater than 0"),
    ),
    "negative length": (
        lambda d: edited(d, "figure", "lengths", value={"neck-pelvis": -50.2}),
        ("view.json: figure.lengths.neck-pelvis: got -50.2", "greater than 0"),
    ),
    "torso triangle": (
        lambda d: edited(d, "figure", "lengths", value={"neck-pelvis": 200}),
        (
            "view.json: figure.lengths: the triangle neck, right_shoulder, pelvis does not close",
            "2, 0.205 and 0.502 m",
        ),
    ),
    "torso too wide": (
        lambda d: edited(d, "figure", "lengths", value={"right_shoulder-left_shoulder": 100}),
        ("view.json: figure.lengths: right_shoulder-left_shoulder is 1 m", "must lie between"),
    ),
    "hips triangle": (
        lambda d: edited(d, "figure", "lengths", value={"right_hip-left_hip": 60}),
        ("view.json: figure.lengths: the triangle right_hip, pelvis, left_hip does not close",),
    ),
    "zero f": (lambda d: edited(d, "camera", "f", value=0), ("view.json: camera.f: got 0", "greater than 0")),
    "negative f": (
        lambda d: edited(d, "camera", "f", value=-5.0),
        ("view.json: camera.f: got -5", "greater than 0"),
    ),
    "segment too short": (
        lambda d: edited(d, "figure", "lengths", value={"right_elbow-right_wrist": 5.0}),
        (
            "view.json: frames[0]: the segment right_elbow-right_wrist is at least ",
            " cm too short for its image",
        ),
    ),
    "nesting bomb": (lambda _: "[" * 100_000, ("view.json: got 100,000 nested levels", "at most 64")),
    "unknown camera": (
        lambda d: edited(d, "camera", value={"model": "fisheye"}),
        ("view.json: camera", "lee-chen"),
    ),
    "another schema": (
        lambda d: edited(d, "schema", value="posekit.view/9"),
        ("view.json: schema", "posekit.view/1"),
    ),
    "unknown unit": (lambda d: edited(d, "unit", value="inch"), ("view.json: unit", "cm")),
    "no frames": (lambda d: edited(d, "frames", value=[]), ("view.json: frames",)),
    "not an object": (lambda _: "[1, 2, 3]", ("view.json",)),
    "coplanar head": (
        lambda d: edited(
            d,
            *("figure", "head_points"),
            value={name: [-34.0, y, z] for name, (_, y, z) in d["figure"]["head_points"].items()},
        ),
        ("view.json: ", "plane"),
    ),
    "coincident head points": (
        lambda d: edited(
            d, "figure", "head_points", "left_eye", value=d["figure"]["head_points"]["right_eye"]
        ),
        ("view.json: head points right_eye and left_eye coincide", "0 m apart"),
    ),
    "too few head points": (
        lambda d: {
            **deepcopy(d),
            "frames": [
                {**frame, "head_image": {k: p for k, p in frame["head_image"].items() if k != "nose"}}
                for frame in d["frames"]
            ],
        },
        ("view.json: frames[0]: 5 of 6 head points are known", "missing: nose"),
    ),
    "a head point without its place": (
        lambda d: edited(d, *("frames", 1, "head_image", "chin"), value=[0.0, 0.7]),
        ('view.json: frames[1].head_image.chin: got "chin"', "or give its place in figure.head_points"),
    ),
    "a misspelt head point": (
        lambda d: edited(d, *("figure", "head_points", "right_eyes"), value=[-30.0, 60.0, 5.0]),
        ('view.json: figure.head_points.right_eyes: got "right_eyes"', "did you mean right_eye?"),
    ),
    "a head point named as a joint": (
        lambda d: edited(d, *("figure", "head_points", "left_hip"), value=[-30.0, 60.0, 5.0]),
        ("view.json: figure.head_points.left_hip", "that no joint has"),
    ),
    "no head and no root": (
        lambda d: {
            **deepcopy(d),
            "camera": {"model": "lee-chen", "f": 5.0},
            "frames": [
                {"time": frame["time"], "image": {"neck": frame["image"]["neck"]}} for frame in d["frames"]
            ],
        },
        ("view.json: frames[0]: nothing bounds how far away the neck is", "or give root"),
    ),
}


@pytest.mark.parametrize("case", BAD_VIEWS)
def test_a_bad_view_is_refused_in_one_line_and_nothing_is_written(
    run, walk: dict[str, Any], case: str, write, files_here, assert_refused
) -> None:
    make, parts = BAD_VIEWS[case]
    view = write(make(walk))
    assert_refused(run("recover", view, "-o", "result.json"), *parts)
    assert files_here() == ["view.json"]


@pytest.mark.parametrize("f", [5.0, None])
def test_a_head_behind_the_camera_is_refused(
    run, walk: dict[str, Any], f: float | None, write, files_here, assert_refused
) -> None:
    """Its image is made as the formula x' = f x / (z + f) would make it behind the lens."""
    document = deepcopy(walk)
    document["camera"]["f"] = f
    names = ("neck", *HEAD_POINTS)
    head = HeadPoints.from_mapping({name: document["figure"]["head_points"][name] for name in names}).points
    for frame in document["frames"]:
        # SEQ1's camera, moved along its axis through the head to 1 m behind it: x' = -5 z / depth, y' = 5 y / depth.
        depth = -140.0 - head[:, 0]
        assert (depth < 0).all()
        image = 5.0 * np.stack([-head[:, 2], head[:, 1]], axis=-1) / depth[:, None]
        frame["image"]["neck"] = image[0].tolist()
        frame["head_image"] = dict(zip(HEAD_POINTS, image[1:].tolist(), strict=True))
    outcome = run("recover", write(document), "-o", "result.json")
    assert_refused(outcome, "view.json: frames[0]: ", "behind the camera")
    assert files_here() == ["view.json"]


def test_more_than_500_megabytes_are_refused_unread(run, files_here, assert_refused) -> None:
    with Path("big.json").open("wb") as file:
        file.truncate(500_000_001)  # sparse: it takes no room
    for command in ("recover", "validate"):
        refused = run(command, "big.json", "-o", "r.json")
        assert_refused(refused, "big.json: got 500.0 MB; expected at most 500 MB")
    assert files_here() == ["big.json"]


def test_a_nesting_bomb_is_refused_by_validate_too(run, write, files_here, assert_refused) -> None:
    write('{"a":' * 50_000, "bomb.json")
    assert_refused(run("validate", "bomb.json", "-o", "r.json"), "bomb.json: got 50,000 nested levels")
    assert files_here() == ["bomb.json"]


@pytest.mark.parametrize(
    ("target", "parts"),
    [
        ("nowhere/r.json", ("nowhere/r.json: got a directory that does not exist",)),
        ("folder.json", ("folder.json: got a directory", "the name of a file")),
        ("r.txt", ('r.txt: got the suffix ".txt"', ".json or .npz or .parquet")),
        ("r.csv", ('r.csv: got the suffix ".csv"', "posekit convert RESULT.npz TABLE.csv --posture all")),
        ("/proc/r.json", ("/proc/r.json", "can be written")),
        ("/dev/null", ("/dev/null",)),
    ],
)
def test_a_target_that_cannot_be_written_is_refused(
    run, walk: dict[str, Any], target: str, parts: tuple[str, ...], write, files_here, assert_refused
) -> None:
    view = write(walk)
    Path("folder.json").mkdir()
    assert_refused(run("recover", view, "-o", target), *parts)
    assert files_here() == ["folder.json", "view.json"]


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (
            ("--checks", "rigid-parts,colision"),
            ("--checks: 'colision' is not a check", "rigid-parts, joint-range"),
        ),
        (("--ranges", "tabel1"), ("--ranges tabel1: no such table or file", "urdf, table1")),
        (("--rules", "7"), ("--rules: 7 is not a rule", "1, 2, 3, 4, 5")),
        (("--rules", "1,two"), ("--rules: '1,two'", "numbers from 1 to 5")),
        (("--group", "5inch"), ('--group: got "5inch"', "cm, m or mm")),
        (("--group", "5"), ('--group: got "5"', "5cm")),
        (("--group", "-5cm"), ('--group: got "-5cm"', "zero or more")),
        (("--rigid-tolerance", "wide"), ('--rigid-tolerance: got "wide"',)),
        (("--tangent-tolerance", "nan"), ('--tangent-tolerance: got "nan"',)),
        (("--contact-margin", "1 foot"), ('--contact-margin: got "1 foot"',)),
        (("--frobnicate",), ("No such option: --frobnicate", "posekit recover --help")),
    ],
)
def test_a_bad_option_of_recover_is_refused(
    run,
    walk: dict[str, Any],
    options: tuple[str, ...],
    parts: tuple[str, ...],
    write,
    files_here,
    assert_refused,
) -> None:
    assert_refused(run("recover", write(walk), "-o", "r.json", *options), *parts)
    assert files_here() == ["view.json"]


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("recover",), ("Missing argument",)),
        (("recover", "view.json"), ("Missing option", "--output", "posekit recover --help")),
        (("recover", "none.json", "-o", "r.json"), ("none.json: got No such file",)),
        (("frobnicate",), ("No such command 'frobnicate'", "posekit --help")),
        (("synth",), ("Missing command",)),
        (("synth", "walker", "-o", "x.json", "--camera", "1,2"), ("--camera: '1,2'", "3 numbers")),
        (("synth", "walker", "-o", "x.json", "--camera", "nan,0,0"), ("--camera: 'nan,0,0'", "3 numbers")),
        (("synth", "walker", "-o", "x.json", "--camera", "0,0,0"), ("camera",)),
        (("synth", "walker", "-o", "x.json", "--camera", "-400,0,0", "--frames", "0"), ("--frames",)),
        (("synth", "walker", "-o", "x.json", "--dt", "0"), ("dt is 0 s",)),
        (("synth", "walker", "-o", "x.json", "--velocity", "9"), ("velocity is 9", "0.5 to 1.3")),
        (("synth", "walker", "-o", "x.json", "--noise", "-1"), ("--noise",)),
        (("synth", "random", "-o", "x.json", "--noise", "inf"), ("--noise: inf", "a finite number")),
        (("synth", "random", "-o", "x.json", "--seed", "-1"), ("--seed",)),
        (("synth", "random", "-o", "x.json", "--distance", "3"), ("--distance: '3'", "2 numbers")),
        (("synth", "random", "-o", "x.json", "--distance", "6,2"), ("camera distances are 6 to 2 m",)),
        (("synth", "random", "-o", "nowhere/x.json"), ("nowhere/x.json",)),
        (("synth", "mocap", "none.npz", "-o", "x.json"), ("none.npz: got No such file",)),
        (
            ("synth", "mocap", "view.json", "-o", "x.json"),
            ("view.json: format: got a file of no format of motion",),
        ),
        (("reproduce", "gavrila", "-o", "x"), ("'gavrila'", "lee-chen, taylor")),
        (("reproduce", "lee-chen", "-o", "view.json"), ("view.json", "folder")),
        (("reproduce", "all", "-o", "x", "--effort", "coarse"), ("'coarse'", "quick or fine")),
        (("demo", "-o", "view.json/x"), ("view.json/x", "folder")),
    ],
)
def test_a_bad_command_is_refused(
    run,
    walk: dict[str, Any],
    words: tuple[str, ...],
    parts: tuple[str, ...],
    write,
    files_here,
    assert_refused,
) -> None:
    write(walk)
    assert_refused(run(*words), *parts)
    assert files_here() == ["view.json"]


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (("--checks", "bones"), ("--checks: 'bones' is not a check",)),
        (("--checks", ","), ("--checks: none is given", "nothing would be judged")),
        (("--rules", "0"), ("--rules: 0 is not a rule",)),
        (("--ranges", "tabel1"), ("--ranges tabel1",)),
        (("--urdf", "nobody.urdf"), ("nobody.urdf",)),
        (("--urdf", "p.npz"), ("p.npz",)),
        (("--rigid-tolerance", "3"), ('--rigid-tolerance: got "3"', "3cm")),
        (("--contact-margin", "--3cm"), ("--contact-margin",)),
    ],
)
def test_a_bad_option_of_validate_is_refused(
    run, options: tuple[str, ...], parts: tuple[str, ...], files_here, assert_refused
) -> None:
    np.savez("p.npz", joints=FIGURE.neutral_points[None, :14])
    assert_refused(run("validate", "p.npz", "-o", "r.json", *options), *parts)
    assert files_here() == ["p.npz"]


@pytest.mark.parametrize(
    ("joints", "parts"),
    [
        (np.full((1, 14, 3), np.inf), ("p.npz: joints[0, 0, 0]: got an infinite number",)),
        (np.full((1, 14, 3), 1e200), ("p.npz: joints: got 1e+200 m", "within 1e+09 m")),
        (np.zeros((1, 13, 3)), ("p.npz: joints",)),
        (np.zeros((14, 3)), ("p.npz: joints",)),
        (np.array([["neck"]]), ("p.npz: joints",)),
    ],
)
def test_bad_postures_are_refused(
    run, joints: np.ndarray, parts: tuple[str, ...], files_here, assert_refused
) -> None:
    np.savez("p.npz", joints=joints)
    assert_refused(run("validate", "p.npz", "-o", "r.json"), *parts)
    assert files_here() == ["p.npz"]


def test_a_report_that_is_no_json_is_refused(run, files_here, assert_refused) -> None:
    np.savez("p.npz", joints=FIGURE.neutral_points[None, :14])
    assert_refused(run("validate", "p.npz", "-o", "r.txt"), 'r.txt: got the suffix ".txt"; expected .json')
    assert files_here() == ["p.npz"]


def test_an_interrupt_leaves_nothing_behind(
    run, walk: dict[str, Any], monkeypatch: pytest.MonkeyPatch, write, files_here
) -> None:
    view = write(walk)

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(importlib.import_module("posekit.recovery.conductor"), "recover", interrupted)
    outcome = run("recover", view, "-o", "r.json")
    assert (outcome.code, outcome.out) == (130, "")
    assert outcome.err in ("", "posekit: error: interrupted\n")
    assert files_here() == ["view.json"]
