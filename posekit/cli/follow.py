"""`posekit follow`: live, JSON lines of key points in, JSON lines of postures out."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from posekit.cli.asked import settings_of
from posekit.cli.detector_options import Who
from posekit.cli.detector_source import source_of
from posekit.cli.groups import with_groups
from posekit.cli.judging_options import Judging, Tolerances
from posekit.cli.live_options import Watching
from posekit.cli.noise_options import UncertainAsRecover
from posekit.cli.options import ContactMargin, examples, signed_length
from posekit.errors import InputError

FOLLOW_EXAMPLES = examples(
    "detector | posekit follow --stdin --layout coco_17 --size 1280x720 --stature 175cm | viewer",
    "posekit follow --stdin --camera calibration.toml:cam_01 --lengths me.toml --deviation 2 < joints.jsonl",
)


@with_groups
def follow(
    *,
    stdin: Annotated[
        bool, typer.Option("--stdin", help="Read JSON lines from standard input, and answer each at once.")
    ] = False,
    keep_going: Annotated[
        bool,
        typer.Option("--keep-going", help='Answer a line that cannot be read with {"error": …}, and go on.'),
    ] = False,
    watching: Watching,
    who: Who,
    judging: Judging,
    tolerances: Tolerances,
    contact_margin: ContactMargin = "0cm",
    uncertain: UncertainAsRecover,
) -> None:
    """Follow a person live: a line of key points in, a line with the likeliest posture and the path out.

    A line is {"time": seconds, "points": [[x, y], …]} or {"time": …, "points": {"left_wrist": [x, y, confidence], …}}.
    The first may be a header instead: camera, size, lengths, stature, deviation, layout; options come before it.
    Of a recording, all frames at once: posekit recover --follow. From Python live: posekit.Tracker; of a recovery:
    posekit.follow.
    """
    if not stdin:
        raise InputError("posekit follow: nothing says what to follow; expected JSON lines; give --stdin")
    from posekit.live.lines import line_of
    from posekit.live.stream import LiveRequest, answers

    asked = LiveRequest(
        settings=settings_of(
            judging, tolerances, uncertain, contact_margin=signed_length(contact_margin, "--contact-margin")
        ),
        source=source_of(watching.reading(), who, deviation=uncertain.deviation),
        lag=watching.lag,
    )
    told = answers(
        sys.stdin.buffer, asked.tracker, least=asked.source.minimum_confidence, keep_going=keep_going
    )
    try:
        for one in told:
            sys.stdout.write(line_of(one))
            sys.stdout.flush()
    except KeyboardInterrupt:
        return  # how a live stream usually ends
