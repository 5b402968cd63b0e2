"""`posekit reproduce`: compare tables and figures of Lee & Chen 1985 and Taylor 2000 with posekit's results."""

from __future__ import annotations

from pathlib import Path

import click

from posekit.cli.command import command, option, output, say


@command("reproduce", "posekit reproduce all -o papers", "posekit reproduce lee-chen -o tables")
@click.argument("paper", type=click.Choice(["lee-chen", "taylor", "all"]))
@output("DIR", "Folder for the tables.")
@option("--pictures/--no-pictures", default=True, help="Draw the figures, too.")
@option(
    "--effort",
    type=click.Choice(["quick", "fine"]),
    default="quick",
    help="Number of settings of the walker.",
)
def reproduce(paper: str, output: Path, pictures: bool, effort: str) -> None:
    """Compare the values printed in the papers with computed values, row by row. Exit code 1 if a row fails."""
    from posekit.papers import reproduce as write

    rows = write(paper, output, effort=effort, pictures=pictures)
    say(f"{output / 'papers.md'}: {rows.counts()}")
    raise SystemExit(0 if rows.passed else 1)
