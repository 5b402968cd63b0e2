"""`posekit view`: draw a file as an HTML page and show it in the browser."""

from __future__ import annotations

import tempfile
import webbrowser
from pathlib import Path
from typing import Any

import click

from posekit.cli.command import command, option, reading, say


@command("view", "posekit view walk.bvh", "posekit view postures.json --view walk.json")
@click.argument("source", metavar="FILE", type=click.Path(path_type=Path))
@option("--view", default=None, metavar="VIEW", help="View of a result.")
@option("--open/--no-open", "show", default=True, help="Open the browser.")
@reading()
def view(source: Path, view: str | None, show: bool, **given: Any) -> None:
    """Draw a file as an HTML page in a temporary folder, and open the page in the browser."""
    from posekit.doors import render

    page = Path(tempfile.mkdtemp(prefix="posekit-")) / f"{source.stem}.html"
    render(source, page, view=view, **given)
    say(str(page))
    if show:
        webbrowser.open(page.as_uri())
