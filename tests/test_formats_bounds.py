"""Numbers that decide how a file is read, from both sides: one is just inside a bound, the other just outside."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.errors import InputError
from posekit.formats.layout import load_layout
from posekit.skeleton import JOINTS
from tests.test_formats_motion import RATE, squatting, walking


def about(axis: str, degrees: float) -> list[float]:
    """Return a quaternion x, y, z, w."""
    half = np.radians(degrees) / 2
    return [np.sin(half) if one == axis else np.cos(half) if one == "w" else 0.0 for one in "xyzw"]


def rows(
    turn: Sequence[float], way: Sequence[float] = (0.0, 0.0), height: float = 0.78, scale: Any = 1.0
) -> Any:
    """Return what is read from rows of a robot whose root goes some way along the ground; quaternions are scaled."""
    q = np.array(squatting().q)
    q[:, :2] = np.linspace(0, 1, len(q))[:, None] * np.array(way)
    q[:, 2] = height
    q[:, 3:7] = np.array(turn) * np.reshape(scale, (-1, 1))
    np.savetxt("rows.csv", q, delimiter=",", fmt="%.12g")
    return posekit.open("rows.csv", rate=RATE)


def said(motion: Any, words: str) -> bool:
    return any(words in text for text in (*motion.notes, *motion.warnings))


def read_backward(turned: float, way: Sequence[float]) -> bool:
    """In the other order a robot that is turned by an angle leans by it, and heads backward."""
    return said(rows(about("z", turned), way), "read as w, x, y, z")


def heading(degrees: float) -> bool:
    return read_backward(10.0, (np.cos(np.radians(degrees)), np.sin(np.radians(degrees))))


def one_length(length: float) -> bool:
    """The quaternion of one frame has this length; one that is no zero is refused."""
    scale = np.ones(40)
    scale[3] = length
    try:
        return not said(rows(about("z", 0.0), scale=scale), "quaternion is zero")
    except InputError:
        return True


def refused(write: Callable[[], object]) -> bool:
    try:
        write()
    except InputError:
        return True
    return False


def uneven(share: float, ending: str) -> bool:
    walk = replace(walking(), q=None, q_names=(), robot="")
    time = np.array(walk.time)
    time[10] += share / RATE
    return refused(lambda: posekit.save(replace(walk, time=time), f"x{ending}"))


def opened(points: Any, **options: Any) -> Any:
    """Return what is read from points without names."""
    np.savez("points.npz", keypoints_3d=points, fps=RATE)
    return posekit.open("points.npz", **options)


H36M = load_layout("h36m_17")


def h36m(change: Callable[[dict[str, Any]], None]) -> Any:
    """Return points (T, 17, 3) in the order of Human3.6M, changed by name."""
    walk = walking()
    points = {name: np.array(walk.points([name])[:, 0]) for name in JOINTS}
    middle = {
        f"mid_{part}s": (points[f"right_{part}"] + points[f"left_{part}"]) / 2 for part in ("hip", "shoulder")
    }
    points |= middle
    change(points)
    array = np.repeat(middle["mid_shoulders"][:, None], len(H36M.points), axis=1)
    for ours, (theirs, *_) in H36M.landmarks.items():
        array[:, H36M.points.index(theirs)] = points[ours]
    return array


def longer(name: str, end: str, share: float) -> Callable[[dict[str, Any]], None]:
    def change(points: dict[str, Any]) -> None:
        points[end] = points[name] + (points[end] - points[name]) / (1 - share)

    return change


def beside(share: float) -> Callable[[dict[str, Any]], None]:
    def change(points: dict[str, Any]) -> None:
        leg = sum(
            np.linalg.norm(points[f"left_{a}"] - points[f"left_{b}"], axis=-1)[0]
            for a, b in (("hip", "knee"), ("knee", "ankle"))
        )
        points["mid_hips"] = points["mid_hips"] + share * leg * np.array([0.0, 0.0, 1.0])

    return change


@pytest.mark.parametrize(
    ("finds", "inside", "outside"),
    [
        (lambda turned: not said(rows(about("z", turned)), "by convention"), 0.9, 1.1),
        (lambda turned: not read_backward(turned, (-1.0, 0.0)), 19.9, 20.1),
        (lambda way: read_backward(10.0, (-way, 0.0)), 0.29, 0.31),
        (heading, 124.9, 125.1),  # 114.9 degrees off ahead, 55.1 off backward
        (lambda pitch: said(rows(about("y", -pitch)), "lying"), 59.9, 60.1),
        (lambda pitch: said(rows(about("y", -pitch)), "upside down"), 119.9, 120.1),
        (lambda scale: said(rows(about("z", 0.0), scale=scale), "differ from 1 by"), 1.009, 1.011),
        (lambda scale: refused(lambda: rows(about("z", 0.0), scale=scale)), 1.24, 1.26),
        (one_length, 0.9e-6, 1.1e-6),
        (lambda height: rows(about("z", 0.0), height=height).q[0, 2] < height / 2, 9.9, 10.1),
        (lambda height: rows(about("z", 0.0), height=height).q[0, 2] < height / 500, 299.0, 301.0),
        (lambda share: uneven(share, ".bvh"), 0.09, 0.11),
        (lambda share: uneven(share, ".c3d"), 0.09, 0.11),
        (lambda share: refused(lambda: opened(h36m(longer("left_elbow", "left_wrist", share)))), 0.24, 0.26),
        (lambda share: refused(lambda: opened(h36m(beside(share)))), 0.24, 0.26),
    ],
)
def test_a_number_decides_at_its_bound(
    finds: Callable[[float], bool],
    inside: float,
    outside: float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert [bool(finds(inside)), bool(finds(outside))] == [False, True]


@pytest.mark.parametrize("order", ["g1_29", "g1_29_isaac"])
def test_rows_without_names_have_the_stated_order_of_joints(order: str, tmp_path: Path) -> None:
    q = np.array(squatting().q)
    np.savetxt(tmp_path / "rows.csv", q, delimiter=",", fmt="%.12g")
    motion = posekit.open(tmp_path / "rows.csv", layout=order)
    assert motion.q_names[7:] == tuple(load_layout(order).fields["joints"])
    np.testing.assert_allclose(motion.q[:, 7:], q[:, 7:], atol=1e-9)


CHAIN = re.compile(r"longest chain of bones has (\S+) units")
INCH = 0.0254
UNITS = {"m": 1.0, "CMU's unit": INCH / 0.45, "inches": INCH, "cm": 0.01, "mm": 0.001}


@pytest.mark.parametrize(
    ("longest", "unit"),
    [
        *((0.89, ""), (0.91, "m"), (4.45, "m"), (4.55, "")),
        *((15.8, ""), (16.1, "CMU's unit"), (52.3, "CMU's unit"), (53.3, "inches"), (124.8, "inches")),
        *(
            (126.0, "cm"),
            (445.0, "cm"),
            (455.0, ""),
            (890.0, ""),
            (910.0, "mm"),
            (4450.0, "mm"),
            (4550.0, ""),
        ),
    ],
)
def test_the_longest_chain_of_a_bvh_file_is_about_two_metres(
    longest: float, unit: str, tmp_path: Path
) -> None:
    """The unit is the one in which the chain is nearest to 2 m; chains of 0.9 to 4.5 m are those of people."""
    walk, path = replace(walking(3), q=None, q_names=(), robot=""), tmp_path / "walk.bvh"
    posekit.save(walk, path)
    usual = posekit.open(path)
    factor = longest / float(next(filter(None, map(CHAIN.search, usual.notes)))[1])

    def larger(words: list[str], first: int, stop: int) -> str:
        return " ".join(
            [*words[:first], *(str(factor * float(one)) for one in words[first:stop]), *words[stop:]]
        )

    lines = [line.split() for line in path.read_text().splitlines()]
    head = next(k for k, words in enumerate(lines) if words[:2] == ["Frame", "Time:"])
    scaled = [larger(words, 1, 4) if words[0] == "OFFSET" else " ".join(words) for words in lines[: head + 1]]
    path.write_text("\n".join([*scaled, *(larger(words, 0, 3) for words in lines[head + 1 :])]) + "\n")
    if not unit:
        with pytest.raises(InputError, match="longest chain of bones has"):
            posekit.open(path)
        return
    motion = posekit.open(path)
    (note,) = (note for note in motion.notes if "longest chain" in note)
    assert note.startswith(f"lengths are in {unit}") and f"{longest * UNITS[unit]:.2f} m" in note
    np.testing.assert_allclose(motion.joints, 100 * UNITS[unit] * factor * usual.joints, rtol=1e-5, atol=1e-5)
