"""Each benchmark runs on what posekit makes itself, in small, and what it says of correctness holds."""

from __future__ import annotations

import re
import sys
from importlib import import_module

import pytest


def run(name: str, *arguments: str) -> str:
    """Run a benchmark as its command does and return what it prints."""
    from contextlib import redirect_stdout
    from io import StringIO

    said, given = StringIO(), sys.argv
    sys.argv = [name, *arguments]
    try:
        with redirect_stdout(said):
            code = import_module(f"benchmarks.{name}").main()
    finally:
        sys.argv = given
    assert not code
    return said.getvalue()


def cells(said: str) -> dict[str, list[str]]:
    """Return the rows of the printed tables by their first cell."""
    rows = [
        [one.strip() for one in line.strip("| ").split("|")] for line in said.splitlines() if line[:1] == "|"
    ]
    return {row[0]: row[1:] for row in rows}


@pytest.mark.parametrize(
    ("name", "arguments", "pattern"),
    [
        ("tree", ("--views", "2", "--batch", "20"), "identical to brute force: 2 of 2 views"),
        ("robots", ("--states", "30", "--repeats", "1"), "identical in 30 of 30 states"),
        ("clean_clips", (), "100.00% valid; 0 clips rejected"),
        (
            "formats",
            ("--frames", "3"),
            r"'memory': '(\d+ of \d+)', 'json': '\1', 'npz': '\1', 'parquet': '\1'",
        ),
    ],
)
def test_what_is_said_to_be_the_same_is(name: str, arguments: tuple[str, ...], pattern: str) -> None:
    assert re.search(pattern, run(name, *arguments))


def test_frames_alone_and_among_others_are_equal() -> None:
    said = run("solver", "--frames", "4", "--one", "1", "--reference", "1", "--repeats", "1")
    assert float(said.split("among others: ")[1].split()[0]) <= 1e-9


def test_planted_defects_are_found() -> None:
    planted, found, *_ = cells(run("defects", "--clips", "3", "--only", "frozen"))["frozen"]
    assert planted == found == "3"


def test_people_have_a_row_for_each_condition() -> None:
    said = cells(run("people", "--views", "2", "--only", "neck,photograph"))
    assert [said[name][0] for name in ("neck", "photograph")] == ["2", "2"]


def test_repaired_files_keep_their_hierarchy() -> None:
    cases, passed, hierarchy, *_ = cells(run("repair", "--only", "jump"))["jump"]
    assert cases == passed == hierarchy == "1"


def test_peers_meet_the_same_targets() -> None:
    said = cells(run("peers", "--states", "20", "--postures", "4", "--loop", "2"))
    assert said["Robot.configurations, warm"][1] == "100%"


def test_inspect_opens_a_file_once() -> None:
    said = run("start_up", "--runs", "1", "--only", "import posekit")
    modules, opens = map(int, re.findall(r"modules (\d+) opens (\d+)", said)[0])
    assert modules <= 60
    assert opens == 1


def test_damaged_files_are_refused(tmp_path) -> None:
    counted = run("fuzz", "-o", str(tmp_path), "--seconds", "1")
    assert int(counted.split()[0]) > 0
    assert not list(tmp_path.iterdir())


def test_a_newcomer_gets_a_result() -> None:
    job = "configurations of a robot"
    assert re.fullmatch(r"\d+ -\d\.\d+", cells(run("newcomer", "--here", "--only", job))[job][1])
