"""Numbers beyond all bounds: one line, and nothing that is not finite in what is written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.errors import InputError
from posekit.formats.motion import Motion
from posekit.formats.own import Postures
from posekit.formats.own.units import FARTHEST_COORDINATE, parse_length

NOT_FINITE = ("nan", "inf", "-inf")
FLOAT_OPTIONS = [
    ("render", "view.json", "-o", "a.png", "--azimuth"),
    ("render", "view.json", "-o", "a.png", "--elevation"),
    ("render", "view.json", "-o", "a.png", "--timeout"),
    ("synth", "walker", "-o", "a.json", "--dt"),
    ("synth", "walker", "-o", "a.json", "--phase"),
    ("synth", "walker", "-o", "a.json", "--velocity"),
    ("synth", "random", "-o", "a.json", "--noise"),
    ("recover", "view.json", "-o", "a.json", "--length-deviation"),
    ("recover", "view.json", "-o", "a.json", "--angle-tolerance"),
    ("recover", "view.json", "-o", "a.json", "--coverage"),
    ("recover", "view.json", "-o", "a.json", "--deviation"),
    ("recover", "view.json", "-o", "a.json", "--follow-scale"),
    ("validate", "view.json", "--rate"),
]


@pytest.fixture
def seen(run: Callable[..., Any]) -> None:
    """Write a view."""
    assert run("synth", "walker", "-o", "view.json", "--frames", 1).code == 0


@pytest.mark.parametrize("value", NOT_FINITE)
@pytest.mark.parametrize("arguments", FLOAT_OPTIONS, ids=lambda given: f"{given[0]}{given[-1]}")
@pytest.mark.usefixtures("seen")
def test_no_option_takes_what_is_not_finite(
    arguments: tuple[str, ...], value: str, run: Callable[..., Any], assert_refused: Callable[..., None]
) -> None:
    assert_refused(run(*arguments, value), arguments[-1])
    assert [path.name for path in Path().iterdir()] == ["view.json"]


BEYOND = [
    (("synth", "walker", "-o", "a.json", "--dt", "1e308"), "dt is 1e+308 s"),
    (("synth", "walker", "-o", "a.json", "--dt", "1e-300"), "dt is 1e-300 s"),
    (("synth", "mocap", "walk.npz", "-o", "a.json", "--dt", "1e308"), "dt is 1e+308 s"),
    (("render", "view.json", "-o", "a.gif", "--fps", "1e-300"), "1e-300 pictures a second"),
    (("render", "view.json", "-o", "a.gif", "--turntable", "9" * 20), "a turn of 99,999"),
    (("recover", "view.json", "-o", "a.json", "--fps", "1e308"), "--fps"),
    (("recover", "points.json", "-o", "a.json", "--fps", "1e308"), "--fps: 1e+308; expected frames a second"),
]


@pytest.mark.parametrize(("arguments", "says"), BEYOND, ids=lambda given: str(given[-1])[:20])
@pytest.mark.usefixtures("seen")
def test_numbers_that_nobody_means_are_named(
    arguments: tuple[str, ...], says: str, run: Callable[..., Any], assert_refused: Callable[..., None]
) -> None:
    Path("points.json").write_text('[{"keypoints": []}]')
    assert run("convert", "view.json", "walk.npz").code == 0
    assert_refused(run(*arguments), says)
    assert {path.name for path in Path().iterdir()} == {"view.json", "points.json", "walk.npz"}


@pytest.mark.parametrize("kind", ["walker", "random"])
@pytest.mark.parametrize("count", ["99999999999999999999", "-1", "0"])
def test_no_more_frames_are_asked_than_there_is_memory_for(
    kind: str, count: str, run: Callable[..., Any], assert_refused: Callable[..., None]
) -> None:
    assert_refused(run("synth", kind, "-o", "a.json", "--frames", count), "--frames")


@pytest.mark.parametrize(
    "asked",
    [("convert", "a.c3d"), ("render", "-o", "a.png"), ("validate",), ("inspect",)],
)
@pytest.mark.parametrize("value", [1e200, 1e306, -1e10])
def test_coordinates_beyond_all_bounds_go_nowhere(
    asked: tuple[str, ...], value: float, run: Callable[..., Any]
) -> None:
    joints = np.zeros((2, 14, 3)) + np.arange(14)[:, None] * 0.1
    joints[1, 3, 2] = value
    np.savez("huge.npz", joints=joints)
    outcome = run(asked[0], "huge.npz", *asked[1:])
    assert (outcome.code, outcome.err.count("\n")) == (2, 1)
    assert "within 1e+09" in outcome.err or "finite" in outcome.err
    assert [path.name for path in Path().iterdir()] == ["huge.npz"]


@pytest.mark.parametrize("far", [2 * FARTHEST_COORDINATE, 1e300, np.inf])
def test_what_is_made_in_python_has_bounds_too(far: float) -> None:
    joints = np.zeros((1, 14, 3))
    joints[0, 5, 1] = far
    with pytest.raises(InputError):
        Postures(joints=joints)
    with pytest.raises(InputError):
        Motion(points=joints, names=tuple("abcdefghijklmn"), time=np.zeros(1), rate=30.0, source="made")


@pytest.mark.parametrize("text", ["1e308cm", "1e300m", "2e9 m"])
def test_a_length_has_a_bound(text: str) -> None:
    with pytest.raises(InputError, match="up to 1e"):
        parse_length(text)
