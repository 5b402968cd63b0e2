"""Names from files in what is printed and written: they steer no terminal and are no markup."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.errors import InputError
from posekit.formats.markdown import no_markup, table_lines
from posekit.safe_io import refusal

BELL_AND_LINK = "a\x07\x1b]8;;http://x\x07b\x1b[31m"
MARKUP = "# <img src=x onerror=alert(1)> | `b` [c](d)"


@pytest.mark.parametrize("text", [BELL_AND_LINK, MARKUP, "two\nlines", "a\u202eb"])
def test_no_text_ends_its_cell_or_is_markup(text: str) -> None:
    [row] = table_lines(["name"], [[text]], spelled=no_markup)[2:-1]
    assert row.isprintable()
    assert row.count("|") == 2
    assert not set("<>[]#`") & set(row.replace("&#", ""))
    [plain] = table_lines(["name"], [[text]])[2:-1]
    assert plain.isprintable()
    assert plain.replace("\\|", "").count("|") == 2


def test_a_refusal_has_an_end() -> None:
    error: InputError = refusal("f.json", "names", "x" * 5000, "y" * 5000, "rename it")
    assert len(str(error)) <= 500
    assert str(error).startswith("f.json: names: got x")
    assert str(error).endswith("; rename it")


def test_names_of_recordings_are_text_in_reports_and_on_the_terminal(run: Callable[..., Any]) -> None:
    run("synth", "mocap", "--help")  # the folder of the test is made
    with np.load(_walk(run)) as motion:
        content = dict(motion)
    content["clip_names"] = np.array([MARKUP + BELL_AND_LINK])
    content["clip_action"] = np.array([MARKUP + BELL_AND_LINK])
    np.savez("named.npz", **content)
    quick = ("--noise", "0", "--yaw-step", "180", "--heights", "1.5m", "--frames-per-clip", "2")
    outcome = run("evaluate", "named.npz", "-o", "e.md", *quick)
    assert outcome.code == 0, outcome.err
    report = Path("e.md").read_text()
    assert "onerror" in report
    assert "<" not in report
    assert not any(line.startswith("#") for line in report.splitlines())
    for text in (outcome.out, outcome.err, report):
        assert all(letter.isprintable() for letter in text.replace("\n", ""))
    told = run("inspect", "named.npz")
    assert all(letter.isprintable() for letter in (told.out + told.err).replace("\n", ""))


def test_what_detectors_call_people_does_not_reach_the_terminal_as_it_is(run: Callable[..., Any]) -> None:
    name = BELL_AND_LINK * 2000
    Path("points.json").write_text(json.dumps({"schema": name, "frames": []}))
    for command in ("inspect", "recover", "validate", "convert"):
        more = ("-o", "out.json") if command == "recover" else ("out.npz",) if command == "convert" else ()
        outcome = run(command, "points.json", *more)
        assert outcome.code == 2
        assert len(outcome.err) < 560
        assert outcome.err[:-1].isprintable()


def _walk(run: Callable[..., Any]) -> str:
    """Write a walk as motion capture, and return its name."""
    outcome = run("synth", "walker", "-o", "walk.json", "--frames", 4)
    assert outcome.code == 0, outcome.err
    outcome = run("convert", "walk.json", "walk.npz")
    assert outcome.code == 0, outcome.err
    return "walk.npz"
