"""`posekit demo`: all of it on the built-in views."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from posekit.cli.options import Pictures, examples, option

DEMO_EXAMPLES = examples("posekit demo -o demo-results")


def demo(
    output: Annotated[Path, option("--output", "DIR", "Where to write the results.", short="-o")],
    pictures: Pictures = True,
) -> None:
    """Recover the built-in views, validate what came out, and reproduce the 1985 paper's tables."""
    from posekit import papers
    from posekit.safe_io.writing import make_folder

    make_folder(output)
    for line in papers.demo(output, pictures=pictures):
        typer.echo(line)
