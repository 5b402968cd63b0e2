"""`posekit reproduce`: the papers' tables, beside the print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, cast

import typer

from posekit.cli.options import Pictures, examples, option
from posekit.cli.terminal import say
from posekit.errors import InputError

PAPER_NAMES = ("lee-chen", "taylor")
REPRODUCE_EXAMPLES = examples("posekit reproduce lee-chen -o tables", "posekit reproduce taylor -o tables")


def reproduce(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="lee-chen or taylor.")],
    output: Annotated[Path, option("--output", "DIR", "Where to write the tables.", short="-o")],
    pictures: Pictures = True,
    effort: Annotated[
        str, option("--effort", "quick|fine", "Over how many settings of the walker lee-chen counts.")
    ] = "quick",
) -> None:
    """Write a paper's tables, reproduced, beside what it prints."""
    from posekit import papers
    from posekit.safe_io.writing import make_folder

    if paper not in PAPER_NAMES:
        raise InputError(
            f"{paper!r} is not a paper that can be reproduced; expected {', '.join(PAPER_NAMES)}"
        )
    work = _effort(effort)
    make_folder(output)
    if paper == "lee-chen":
        lines = papers.reproduce_lee_chen(output, pictures=pictures, effort=work)
    else:
        lines = papers.reproduce_taylor(output, pictures=pictures)
    for line in lines:
        say(line)
    say(f"written: {output / f'{paper}.md'}, {output / f'{paper}.json'}")


def _effort(text: str) -> Literal["quick", "fine"]:
    if text in ("quick", "fine"):
        return cast(Literal["quick", "fine"], text)
    raise InputError(f"--effort: {text!r}; expected quick or fine")
