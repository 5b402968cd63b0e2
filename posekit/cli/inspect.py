"""`posekit inspect`: the content of a file, and the facts that posekit found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from posekit.cli.command import command, reading, say


@command("inspect", "posekit inspect jump.bvh", "posekit inspect keypoints/")
@click.argument("source", metavar="FILE", type=click.Path(path_type=Path))
@reading()
def inspect(source: Path, **given: Any) -> None:
    """Print the content of a file: kind, layout, frames, rate, axes, unit, names, and warnings."""
    from posekit.formats.inspect import inspect as table

    say(table(source, **given))
