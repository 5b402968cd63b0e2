"""`posekit inspect`: what is in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from posekit.cli.detector_options import Format, Reading, Size, Skeleton, SwapSides, Unit, Who
from posekit.cli.detector_source import source_of
from posekit.cli.options import examples
from posekit.cli.terminal import say

INSPECT_EXAMPLES = examples(
    "posekit inspect keypoints/",
    "posekit inspect predictions.json --skeleton coco_17 --size 1920x1080",
    "posekit inspect trial.trc",
    "posekit inspect postures.json",
    "posekit inspect results",
)


def inspect(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A file or folder of any format that posekit reads.")
    ],
    format: Format = "",
    skeleton: Skeleton = "",
    size: Size = "",
    swap_sides: SwapSides = False,
    unit: Unit = "",
) -> None:
    """Say what is in a file: its format, who is in it, which joints are missing; of results what survived, and how."""
    from posekit.inspection import describe

    source = source_of(Reading(format=format, skeleton=skeleton, size=size, swap_sides=swap_sides), Who())
    for line in describe(file, source, unit=unit):
        say(line)
