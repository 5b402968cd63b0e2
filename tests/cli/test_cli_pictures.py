"""The names of the pictures that key points were detected in go with a result, into tables and what is printed."""

import csv
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from posekit.formats.motion.survivors_files import read_survivors
from posekit.formats.own import read_view
from tests.detector_files import view_keypoints, write_keypoints

FILE_NAMES = ("beach.jpg", "garden.jpg")


@pytest.fixture
def named(run: Callable[..., Any]) -> Callable[[Sequence[str]], Path]:
    """Return a way to write COCO annotations of pictures with some names."""
    assert run("synth", "random", "-o", "v.json", "--frames", 2, "--uncalibrated", "--seed", 3).code == 0
    view = read_view("v.json")

    def write(names: Sequence[str]) -> Path:
        path = Path("coco.json")
        write_keypoints(path, view_keypoints(view, "coco"), "coco")
        document = json.loads(path.read_text())
        document["images"] = [
            one | {"file_name": name} for one, name in zip(document["images"], names, strict=True)
        ]
        path.write_text(json.dumps(document))
        return path

    return write


@pytest.fixture
def found(run: Callable[..., Any], named: Callable[[Sequence[str]], Path]) -> Any:
    """Return what `recover` printed of two pictures with names; the result is `result.npz`."""
    done = run("recover", named(FILE_NAMES), "-o", "result.npz")
    assert done.code == 0, done.err
    return done


def test_the_frame_table_and_inspect_name_the_pictures(run: Callable[..., Any], found: Any) -> None:
    lines = found.out.splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith("frame "))
    assert "picture" in lines[head]
    for name, line in zip(FILE_NAMES, lines[head + 1 :], strict=False):
        assert line.index(name) == lines[head].index("picture")
    assert "pictures: beach.jpg, garden.jpg" in run("inspect", "result.npz").out


def test_names_that_only_count_are_not_printed(
    run: Callable[..., Any], named: Callable[[Sequence[str]], Path]
) -> None:
    done = run("recover", named(("walk_000.png", "walk_001.png")), "-o", "result.npz")
    assert "picture" not in done.out.partition("frame ")[2].splitlines()[0]
    assert "pictures:" not in run("inspect", "result.npz").out


@pytest.mark.parametrize("end", ["csv", "parquet", "npz"])
def test_tables_of_survivors_hold_the_pictures(run: Callable[..., Any], found: Any, end: str) -> None:
    done = run("convert", "result.npz", f"all.{end}", "--posture", "all")
    assert done.code == 0, done.err
    table = read_survivors(f"all.{end}")
    assert [FILE_NAMES[k] for k in table.frame] == list(table.pictures)


def test_a_table_of_motion_holds_the_pictures(run: Callable[..., Any], found: Any) -> None:
    done = run("convert", "result.npz", "moving.csv")
    assert done.code == 0, done.err
    with Path("moving.csv").open(newline="") as file:
        assert [row["picture"] for row in csv.DictReader(file)] == list(FILE_NAMES)
    assert run("inspect", "moving.csv").code == 0


def test_what_is_not_listed_is_not_said_to_be_rejected(found: Any) -> None:
    rows = [line for line in found.out.splitlines() if any(name in line for name in FILE_NAMES)]
    assert any("not listed" in row for row in rows)
    assert "noise/unlisted" not in found.out
