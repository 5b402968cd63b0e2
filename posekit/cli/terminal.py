"""What the command says: on the terminal, where text from files must not steer it."""

from __future__ import annotations

import typer

from posekit.safe_io import one_line


def say(text: str, *, err: bool = False) -> None:
    """Print lines, every letter of which prints: names in files may hold bells, escapes and colours.

    Parameters
    ----------
    text : str
        One line or several.
    err : bool
        Whether it goes to standard error.
    """
    typer.echo("\n".join(one_line(line) for line in text.split("\n")), err=err)
