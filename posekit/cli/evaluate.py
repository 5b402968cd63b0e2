"""`posekit evaluate`: compute the errors of results whose true postures are known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from posekit.cli.command import command, numbers, option, reading, say, settings_from, settings_options
from posekit.settings import RecoverSettings


@command(
    "evaluate",
    "posekit evaluate result.npz --truth view.json",
    "posekit evaluate walk.bvh -o report.json --noise 0,2",
)
@click.argument("source", metavar="RESULT|VIEW|MOTION", type=click.Path(path_type=Path))
@option("-o", "--output", metavar="REPORT", type=click.Path(path_type=Path), help=".json, .csv or .md.")
@option(
    "--truth", default=None, metavar="FILE", help="True joints of a result: a view with truth, or motion."
)
@option("--noise", default="0,2", metavar="LIST", help="Standard deviations of the image points, pixels.")
@option("--views", default=24, metavar="N", type=click.IntRange(1), help="Views of a motion.")
@option("--seed", default=0, type=click.IntRange(0), help="Seed of the random numbers.")
@reading(urdf=False)
@settings_options(RecoverSettings, {"checks": "LIST", "length_deviation": "SHARE"})
def evaluate(
    source: Path, output: Path | None, truth: str | None, noise: str, views: int, seed: int, **given: Any
) -> None:
    """Compare a result with the true joints; or project motion capture, recover it, and compare."""
    from posekit.errors import refusal
    from posekit.evaluation import evaluate as compare
    from posekit.evaluation import evaluate_method
    from posekit.formats import open as open_file
    from posekit.recovery import Recovery

    settings = settings_from(RecoverSettings, given)
    held = open_file(source, **given)
    if isinstance(held, Recovery):
        if truth is None:
            expected = "the true joints of a result: a view with truth, or motion"
            raise refusal(source, "--truth", "none", expected, "give --truth FILE")
        found = compare(held, open_file(truth, **given))
    else:
        found = evaluate_method(held, settings, noise=numbers("--noise", noise), views=views, seed=seed)
    if output is not None:
        found.save(output)
    say(found.table())
