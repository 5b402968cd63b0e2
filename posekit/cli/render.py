"""`posekit render`: draw a file as a picture, an animation or a page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from posekit.cli.command import command, option, output, reading, say


@command(
    "render",
    "posekit render postures.json --view walk.json -o postures.html",
    "posekit render walk.bvh -o walk.mp4",
    "posekit render g1_motion.csv --urdf g1 -o g1.gif",
    "posekit render postures.npz --view view.json --over pictures/ -o over.mp4",
)
@click.argument("source", metavar="FILE", type=click.Path(path_type=Path))
@output("FILE", "Picture .png, animation .gif or .mp4, page .html, plot .svg or .pdf.")
@option("--view", default=None, metavar="VIEW", help="View of a result: draws its image, too.")
@option(
    "--frame", default=None, metavar="K|A-B", help="Frame, or first and last, from 0. Default: all that fit."
)
@option(
    "--posture",
    "--which",
    "which",
    default="",
    metavar="WHICH",
    help="answer, path, all, first, numbers as 0,4; or angles, timeline for plots.",
)
@option("--size", default="1280x720", metavar="WxH", help="Pixels.")
@option("--azimuth", type=float, default=None, metavar="DEGREES", help="0 looks from the front.")
@option("--elevation", type=float, default=None, metavar="DEGREES", help="Angle above the horizontal.")
@option("--over", default=None, metavar="PICTURES", help="Picture, folder or film to draw over.")
@reading()
def render(source: Path, output: Path, **given: Any) -> None:
    """Draw postures, motion, a result, a view or a report. Right limbs are orange, left limbs are blue."""
    from posekit.doors import render as draw

    draw(source, output, **given)
    say(f"{output}")
