"""Write docs/reference/mistakes.md: what the command line answers to the mistakes of tests/cli/mistakes.toml.

python docs/make_mistakes.py
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import sys
import tempfile
from itertools import groupby
from pathlib import Path
from typing import Final
from unittest import mock

ROOT: Final = Path(__file__).parents[1]
PAGE: Final = ROOT / "docs/reference/mistakes.md"
HEAD: Final = """# What the answers to mistakes look like

Whatever is wrong, `posekit` writes one line to the standard error, ends with 2, and leaves nothing half-written. The
line says where and what was found, what is expected, and what to do. Below is what is typed behind `posekit`, and what
it answers, made in the tests among the files of `posekit samples`, a result `postures.npz`, and files of other
programs. Long lists of names are cut here, and what an answer above ends with too.

"""
LONG_LIST: Final = re.compile(r"((?:[\w.-]+, ){2})(?:[\w.-]+, ){3,}([\w.-]+)")
"""Six names and more: the first two and the last are shown."""


def answers() -> str:
    """Make every mistake, and return the page."""
    sys.path.insert(0, str(ROOT))
    import posekit
    from tests.cli.mistakes import MISTAKES, lay_out

    with tempfile.TemporaryDirectory() as made, tempfile.TemporaryDirectory() as work:
        posekit.recover(posekit.builtin_view("seq1")).save(Path(made) / "result.npz")
        view = posekit.open(Path(made) / "result.npz", "postures")
        posekit.write_postures(Path(made) / "postures.json", view)
        answer("validate", f"{made}/postures.json", "-o", f"{made}/report.json")
        lay_out(
            Path(work), Path(made) / "result.npz", (Path(made) / "report.json").read_text(encoding="utf-8")
        )
        here = Path.cwd()
        os.chdir(work)
        try:
            parts = [HEAD.rstrip("\n")]
            for group, mistakes in groupby(
                sorted(MISTAKES, key=lambda one: one.group), key=lambda one: one.group
            ):
                ends: set[str] = set()
                said = "\n".join(
                    f"{one.command}\n  {shown(answer(*one.command.split()), ends)}\n" for one in mistakes
                )
                parts.append(f"\n\n## {group}\n\n```text\n{said}```")
        finally:
            os.chdir(here)
    return "".join(parts) + "\n"


def shown(said: str, ends: set[str]) -> str:
    """Cut the program's name, the middle of long lists, and an end that was shown before, from an answer."""
    said = LONG_LIST.sub(r"\1…, \2", said.removeprefix("posekit: error: ").strip())
    start, word, end = said.partition("; expected ")
    if word and end in ends:
        return f"{start}{word}…"
    ends.add(end)
    return said


def answer(*words: str) -> str:
    """Run the command line in this process, and return what it writes to the standard error."""
    from posekit.cli.main import main

    said = io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["posekit", *words]),
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(said),
        contextlib.suppress(SystemExit),
    ):
        main()
    return said.getvalue()


if __name__ == "__main__":
    PAGE.write_text(answers(), encoding="utf-8")
