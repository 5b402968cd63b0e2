"""`posekit render`: a picture, an animation or a page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from posekit.cli.command import command, option, output, reading, say
from posekit.cli.recover import picture_size


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
@option("--size", default="1280x720", metavar="WxH", help="Pixels.", show_default=True)
@option("--azimuth", type=float, default=None, metavar="DEGREES", help="0 looks from the front.")
@option("--elevation", type=float, default=None, metavar="DEGREES", help="Above the level.")
@option("--over", default=None, metavar="PICTURES", help="Picture, folder or film to draw over.")
@reading()
def render(source: Path, output: Path, view: str | None, frame: str | None, size: str, **given: Any) -> None:
    """Draw postures, motion, a result, a view or a report. Right limbs are orange, left ones blue."""
    from posekit.doors import render as draw

    given.pop("unit"), given.pop("up")
    draw(source, output, view=view, frame=frames(frame), size=picture_size(size) or (1280, 720), **given)
    say(f"{output}")


def frames(text: str | None) -> int | tuple[int, int] | None:
    """Read ``K`` or ``A-B``."""
    from posekit.errors import refusal, shown

    if text is None:
        return None
    first, dash, last = text.partition("-")
    if not first.isdigit() or (dash and not last.isdigit()):
        raise refusal(
            "", "--frame", shown(text), "a frame from 0, or the first and the last", "write it as 3 or 0-9"
        )
    return (int(first), int(last)) if dash else int(first)
