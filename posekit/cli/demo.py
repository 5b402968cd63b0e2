"""`posekit demo`: all of it on the built-in views."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Annotated, Final

from posekit.cli.options import Pictures, examples, option
from posekit.cli.terminal import say

DEMO_EXAMPLES = examples("posekit demo -o demo-results")

TRY_NEXT: Final = (
    "samples samples",
    "recover samples/walk.json -o postures.json",
    "render postures.json --view samples/walk.json -o postures.html",
)
"""What somebody does who has seen the demo: the page is then the first result of their own."""


def demo(
    output: Annotated[Path, option("--output", "DIR", "Where to write the results.", short="-o")],
    pictures: Pictures = True,
) -> None:
    """Recover the built-in views, validate what came out, and reproduce the 1985 paper's tables."""
    from posekit import papers
    from posekit.safe_io.writing import results_folder

    with results_folder(output):
        for line in papers.demo(output, pictures=pictures):
            say(line)
    say("\ntry next, and open postures.html in a browser:")
    for command in TRY_NEXT:
        say(f"  {program()} {command}")


def program() -> str:
    """Return what to type for this command: its name where that is on PATH, else its path."""
    found = shutil.which("posekit")
    run = Path(sys.argv[0])
    if run.name != "posekit" or not run.is_file() or (found and Path(found).samefile(run)):
        return "posekit"
    here = run.absolute()
    return str(here.relative_to(Path.cwd()) if here.is_relative_to(Path.cwd()) else here)
