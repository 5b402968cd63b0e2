"""`posekit samples`: write small files for first trials."""

from __future__ import annotations

from pathlib import Path

import click

from posekit.cli.command import command, say


@command("samples", "posekit samples samples", "posekit validate samples/jump.bvh")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
def samples(folder: Path) -> None:
    """Write a folder of small files: views, motion, key points, a photograph, a robot."""
    from posekit.samples import samples as write

    for line in write(folder):
        say(line)
