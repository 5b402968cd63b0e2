"""A command that looks at what it is given first: outputs are no inputs, names are a system's, numbers are finite."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import typer
import typer.core

from posekit.cli.options import distinct
from posekit.cli.terminal import INTERRUPTED_CODE, Ended
from posekit.errors import InputError

OUTPUT_OPTIONS: Final = frozenset({"output", "write_urdf", "page", "timeline", "keep", "repair", "pictures"})
"""Parameters of commands that name what is written."""


class GuardedCommand(typer.core.TyperCommand):
    """A command that looks at the names of all its files before it does anything."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; an output that is also read, or written twice, is refused first."""
        check_numbers({option.opts[0]: ctx.params.get(option.name) for option in self.params})
        check_files(ctx.params)
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise Ended("interrupted", INTERRUPTED_CODE) from None


def check_files(given: dict[str, Any]) -> None:
    """Refuse names that no file can have, and outputs that are inputs or one another.

    Parameters
    ----------
    given : dict
        The parameters of a command, by name: paths, or text that may name a file, one or several.

    Raises
    ------
    InputError
        With the name and what it would be written over.
    """
    read: set[Path] = set()
    written: list[Path] = []
    for name, value in given.items():
        for path in _paths(value):
            if name in OUTPUT_OPTIONS:
                written.append(path)
            elif path.is_file():
                read.add(path.resolve())
    distinct(*sorted(read), *written)


def check_numbers(given: dict[str, Any]) -> None:
    """Refuse numbers that are not finite, wherever an option takes one.

    Raises
    ------
    InputError
        With the option.
    """
    for name, value in given.items():
        if isinstance(value, float) and not math.isfinite(value):
            raise InputError(f"{name}: {value}; expected a finite number; correct it")


def _paths(value: Any) -> Iterator[Path]:
    """Yield what may name a file, of ``FILE:NAME`` the file too."""
    for one in value if isinstance(value, list | tuple) else [value]:
        if not isinstance(one, Path | str):
            continue
        listed = isinstance(one, str) and "," in one
        for text in (str(one), one.rpartition(":")[0] if isinstance(one, str) else ""):
            if text and _may_be_named(text, listed):
                yield Path(text)


def _may_be_named(path: str, listed: bool) -> bool:
    """Tell whether a file may have a name, which need not exist.

    A name that no system takes is refused; what lists several things by commas is only then none.
    """
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass
    except ValueError:  # a NUL
        return False
    except OSError as error:
        if listed:
            return False
        raise InputError(f"{path[:20]}…: {error.strerror}; expected a name that the system takes") from None
    return True
