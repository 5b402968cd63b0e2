"""What is said of motion stays what it was: reports of clips with a fault each, beside those that are kept.

A change of a number here changes verdicts of archives: it is meant, said in CHANGELOG, and kept anew by
``python tests/validation/test_reports_stay.py``.
"""

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.samples import write_samples
from tests.kept_files import differences, keep, run

KEPT_REPORTS = Path(__file__).parent / "reports"
FRAMES = 60
KEPT_FRAMES = (21, 34, 47)
"""Findings of these postures are kept; spans of all."""


def lifted(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    points[20:40, :, 1] += 0.15
    return points


def sunk(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    points[25:, :, 1] -= np.linspace(0, 0.12, FRAMES - 25)[:, None]
    return points


def still(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    points[15:35] = points[15]
    return points


def swapped(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    sides = [0, 2, 1, 3, 5, 4, 7, 6, 9, 8, 11, 10, 13, 12, *range(14, points.shape[1])]
    points[30:45] = points[30:45][:, sides]
    return points


def trembling(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    points[10:50, 8] += rng.normal(scale=0.02, size=(40, 3))
    return points


def thrown(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    points[33] += [0.4, 0.0, 0.1]
    points[50:, 9] += [0.0, 0.25, 0.0]
    return points


def leaning(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Stand still, and lean further than anybody stands."""
    points[:] = points[0]
    height = points[..., 1] - points[..., 1].min()
    points[..., 0] += 0.6 * height * np.linspace(0, 1, FRAMES)[:, None]
    return points


def growing(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.asarray(points * np.linspace(1, 1.15, FRAMES)[:, None, None])


FAULTS: dict[str, Callable[[np.ndarray, np.random.Generator], np.ndarray]] = {
    fault.__name__: fault for fault in (lifted, sunk, still, swapped, trembling, thrown, leaning, growing)
}
CASES = {
    **{
        f"{name}.{profile}": (name, ("--profile", profile))
        for name in FAULTS
        for profile in ("posekit", "phuma")
    },
    "walk.walking": ("walk", ("--checks", "rigid-parts,joint-range,collision,walking")),
    "walk.strict": ("walk", ("--strict", "--ranges", "table1")),
    "robot.g1": ("robot", ("--urdf", "g1")),
}


def write_clips(folder: Path) -> None:
    """Write the clips that are judged."""
    write_samples(folder)
    with np.load(folder / "walk.npz") as held:
        walk = {name: held[name] for name in held.files}
    for name in ("joints", "time", "clip"):
        walk[name] = walk[name][:FRAMES]
    np.savez(folder / "walk.npz", **walk)
    for name, fault in FAULTS.items():
        points = fault(walk["joints"].copy(), np.random.default_rng(7))
        np.savez(folder / f"{name}.npz", **{**walk, "joints": points})


def report(folder: Path, case: str) -> dict[str, Any]:
    """Judge a clip, and return what is kept of its report."""
    name, options = CASES[case]
    output = folder / f"{case}.json"
    run("validate", folder / f"{name}.npz", "-o", output, "--all", *options)
    written = json.loads(output.read_text(encoding="utf-8"))
    for clip in written["clips"]:
        del clip["file"]
    return {
        "checks": written["checks"],
        "clips": written["clips"],
        "postures": [
            [*(each[key] for key in ("check", "where", "value", "lower", "upper", "unit", "verdict"))]
            for frame in KEPT_FRAMES
            for each in written["postures"][frame]["findings"]
        ],
    }


@pytest.fixture(scope="module")
def clips(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clips")
    write_clips(folder)
    return folder


@pytest.mark.parametrize("case", CASES)
def test_what_is_said_of_a_clip_stays(case: str, clips: Path) -> None:
    assert differences(KEPT_REPORTS / f"{case}.json", report(clips, case)) == []


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        write_clips(Path(made))
        for each in CASES:
            keep(KEPT_REPORTS / f"{each}.json", report(Path(made), each))
