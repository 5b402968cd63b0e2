"""`posekit follow`: read key points line by line and write postures line by line, live."""

from __future__ import annotations

import sys
from typing import Any

import click

from posekit.cli.command import command, option, settings_from, settings_options
from posekit.errors import InputError
from posekit.settings import RecoverSettings


@command(
    "follow",
    "detector | posekit follow --stdin --layout coco_17 --size 1280x720 --stature 175cm | viewer",
)
@option("--stdin", is_flag=True, help="Read JSON lines from standard input and answer each immediately.")
@option("--keep-going", is_flag=True, help='Answer an unreadable line with {"error": …} and continue.')
@option("--layout", "--skeleton", default="", metavar="NAME|FILE.toml", help="Names of the key points.")
@option("--camera", metavar="FILE[:NAME]", default=None, help="Calibration. Default: a webcam of --size.")
@option("--size", default=None, metavar="WxH", help="Width and height of the pictures, pixels.")
@option("--lag", default=5, type=click.IntRange(0, 1000), metavar="N", help="Later pictures to wait for.")
@settings_options(RecoverSettings, {"stature": "LENGTH", "deviation": "PX", "checks": "LIST"})
def follow(
    stdin: bool, keep_going: bool, layout: str, camera: str | None, size: str | None, lag: int, **given: Any
) -> None:
    """Follow a person live.

    An input line is {"time": seconds, "points": [[x, y], …]}. Points can also have names and confidences: "points":
    {"left_wrist": [x, y, confidence]}.
    """
    if not stdin:
        raise InputError("posekit follow: got no input; expected JSON lines; give --stdin")
    from posekit.doors import opened_camera
    from posekit.following.lines import answers
    from posekit.following.tracker import Tracker

    tracker = Tracker(
        settings=settings_from(RecoverSettings, given),
        camera=opened_camera(camera),
        layout=layout,
        size=size,
        lag=lag,
    )
    for line in answers(sys.stdin.buffer, tracker, keep_going=keep_going):
        sys.stdout.write(line)
        sys.stdout.flush()
