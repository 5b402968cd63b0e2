"""`posekit reproduce`: the papers' tables, beside the print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, cast

import typer

from posekit.cli.options import Pictures, examples, option
from posekit.cli.terminal import say
from posekit.errors import InputError

PAPER_NAMES = ("all", "lee-chen", "taylor")
REPRODUCE_EXAMPLES = examples(
    "posekit reproduce all -o papers", "posekit reproduce lee-chen -o tables --effort fine"
)


def reproduce(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="all, lee-chen or taylor.")],
    output: Annotated[Path, option("--output", "DIR", "Where to write the tables.", short="-o")],
    pictures: Pictures = True,
    effort: Annotated[
        str, option("--effort", "quick|fine", "Over how many settings of the walker lee-chen counts.")
    ] = "quick",
) -> None:
    """Write what a paper prints, reproduced beside it; of all, each row with its check in one page."""
    from posekit import papers
    from posekit.safe_io.writing import results_folder

    if paper not in PAPER_NAMES:
        raise InputError(
            f"{paper!r} is not a paper that can be reproduced; expected {', '.join(PAPER_NAMES)}"
        )
    work = _effort(effort)
    with results_folder(output):
        if paper == "taylor":
            lines = papers.reproduce_taylor(output, pictures=pictures)
        else:
            make = papers.reproduce_all if paper == "all" else papers.reproduce_lee_chen
            lines = make(output, pictures=pictures, effort=work)
    for line in lines:
        say(line)
    names = (
        ("papers.html", "papers.md", "papers.json") if paper == "all" else (f"{paper}.md", f"{paper}.json")
    )
    say(f"written: {', '.join(str(output / name) for name in names)}")


def _effort(text: str) -> Literal["quick", "fine"]:
    if text in ("quick", "fine"):
        return cast(Literal["quick", "fine"], text)
    raise InputError(f"--effort: {text!r}; expected quick or fine")
