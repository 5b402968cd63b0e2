"""`posekit batch`: process an archive of inputs; a stopped run can be continued."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click

from posekit.cli.command import command, option, output, say, seeing, settings_from, settings_options
from posekit.settings import RecoverSettings


@command(
    "batch",
    "posekit batch archive/ -o results --camera calibration.toml:cam1 --stature 175cm",
    "posekit batch views/*.json -o results --jobs 16",
)
@click.argument("inputs", nargs=-1, required=True, metavar="INPUT…", type=click.Path(path_type=Path))
@output("DIR", "Folder of results; a stopped run continues there.")
@option("--jobs", default=None, type=click.IntRange(1), metavar="N", help="Processes. Default: one per core.")
@option("--cluster", "ray", default="", metavar="ADDRESS", help="Ray cluster, or local (extra ray).")
@seeing()
@settings_options(RecoverSettings, {"stature": "LENGTH", "deviation": "PX", "checks": "LIST"})
def batch(inputs: tuple[Path, ...], output: Path, jobs: int | None, ray: str, **given: Any) -> None:
    """Recover or validate each input of an archive. Exit code 1 if some inputs fail; other inputs are processed."""
    from posekit.batch import batch as run

    settings = settings_from(RecoverSettings, given)
    done = run(list(inputs), output, settings, jobs=jobs or os.cpu_count() or 1, ray=ray, say=say, **given)
    raise SystemExit(1 if done.failed else 0)
