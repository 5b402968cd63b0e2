"""`posekit convert`: convert a file to another format."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from posekit.cli.command import command, option, reading, say


@command(
    "convert",
    "posekit convert walk.bvh walk.trc",
    "posekit convert postures.npz walk.bvh --posture path",
    "posekit convert g1_motion.pkl g1_motion.csv --urdf g1",
)
@click.argument("source", metavar="IN", type=click.Path(path_type=Path))
@click.argument("output", metavar="OUT", type=click.Path(path_type=Path))
@option(
    "--posture",
    "--which",
    "which",
    default="",
    metavar="WHICH",
    help="Of a result: answer, path, all, first.",
)
@reading()
def convert(source: Path, output: Path, **given: Any) -> None:
    """Convert a file; the suffix of the second path determines the format."""
    from posekit.doors import convert as convert_file

    convert_file(source, output, **given)
    say(str(output))
