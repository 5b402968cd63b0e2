"""`posekit samples`: files to try the other commands with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from posekit.cli.options import examples
from posekit.cli.terminal import say

SAMPLES_EXAMPLES = examples(
    "posekit samples samples",
    "posekit recover samples/walk.json -o postures.json",
)


def samples(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Where to write; made where it is not there.")
    ],
) -> None:
    """Write a folder of small files to try posekit with: views, motion, key points, a photograph, robots."""
    from posekit.safe_io.writing import results_folder
    from posekit.samples import write_samples

    with results_folder(folder):
        contents = write_samples(folder)
    width = max(map(len, contents))
    for name, what in contents.items():
        say(f"{name:{width}}  {what}")
    say(f"written: {folder}")
