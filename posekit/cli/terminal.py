"""What the command says: on the terminal, where text from files must not steer it."""

from __future__ import annotations

from typing import Final

import typer

INTERRUPTED_CODE: Final = 130
TERMINATED_CODE: Final = 143
"""What a shell says of a command that SIGINT or SIGTERM ended: 128 and the signal's number."""


class Ended(BaseException):
    """The command was asked to end: what is half written is taken away on the way out.

    Attributes
    ----------
    code : int
        The exit code of the process.
    """

    def __init__(self, says: str, code: int) -> None:
        super().__init__(says)
        self.code = code


def say(text: str, *, err: bool = False) -> None:
    """Print lines, every letter of which prints: names in files may hold bells, escapes and colours.

    Parameters
    ----------
    text : str
        One line or several.
    err : bool
        Whether it goes to standard error.
    """
    from posekit.safe_io import one_line  # what --help does not need

    typer.echo("\n".join(one_line(line) for line in text.split("\n")), err=err)
