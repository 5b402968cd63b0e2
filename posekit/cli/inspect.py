"""`posekit inspect`: what a file holds, and how it was understood."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from posekit.cli.command import command, reading, say


@command("inspect", "posekit inspect jump.bvh", "posekit inspect keypoints/")
@click.argument("source", metavar="FILE", type=click.Path(path_type=Path))
@reading()
def inspect(source: Path, **given: Any) -> None:
    """Print what a file holds: kind, layout, frames, rate, axes, unit, names, and doubts."""
    from posekit.formats.inspect import inspect as table

    say(table(source, **given))
