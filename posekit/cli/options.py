"""Options that several commands share, and how their texts are read."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from posekit.errors import InputError, PosekitError

PHYSICAL_CHECKS_TEXT = "rigid-parts,joint-range,collision"


def option(name: str, metavar: str | None, help: str, *, short: str = "", **more: Any) -> Any:
    """Return an option that takes a value."""
    return typer.Option(*([short] if short else []), name, metavar=metavar, help=help, **more)


Rules = Annotated[str, option("--rules", "LIST", "Rules of walking, for the check `walking`: some of 1-5.")]
ContactMargin = Annotated[
    str,
    option(
        "--contact-margin", "LENGTH", "Clearance that bodies must keep, as 1cm; negative allows penetration."
    ),
]
AngleTolerance = Annotated[
    float | None,
    option("--angle-tolerance", "DEGREES", "How far the direction of a segment may be off.", min=0.0),
]
Pictures = Annotated[
    bool, typer.Option("--pictures/--no-pictures", help="Draw the results too: plots, pages and scenes.")
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the random numbers.")]
Noise = Annotated[
    float, typer.Option("--noise", min=0.0, help="Standard deviation of the image points' noise, pixels.")
]
OutputView = Annotated[Path, option("--output", "VIEW", "The view file to write.", short="-o")]


def as_recover(name: str, metavar: str | None = None, more: str = ".") -> Any:
    """Return an option that `posekit recover` explains."""
    return option(name, metavar, f"As `posekit recover` has it{more}")


def examples(*lines: str) -> str:
    """Lay out a command's examples for the end of its help; the first character keeps the lines as they are."""
    return "\n".join(["\b", "Examples:" if len(lines) > 1 else "Example:", *(f"  {line}" for line in lines)])


@contextmanager
def about(file: Path) -> Iterator[None]:
    """Name the file in errors about what it holds; those about an option name the option."""
    try:
        yield
    except PosekitError as error:
        if str(error).startswith("--"):
            raise
        raise type(error)(f"{file}: {error}") from error


def distinct(*paths: Path | None) -> None:
    """Refuse to write over what is read, or two outputs over each other."""
    places: set[str] = set()
    for path in paths:
        if path is None:
            continue
        place = os.path.realpath(path)
        if place in places:
            raise InputError(
                f"{path}: would be written over another file of this command; choose another name"
            )
        places.add(place)


def split(text: str) -> tuple[str, ...]:
    """Split a list by commas."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def rule_numbers(text: str) -> tuple[int, ...]:
    """Read the list of rules."""
    try:
        return tuple(int(word) for word in split(text))
    except ValueError as error:
        raise InputError(f"--rules: {text!r}; expected numbers from 1 to 5 with commas, as 1,2") from error


def numbers(text: str, count: int, option: str) -> tuple[float, ...]:
    """Read some finite numbers by commas."""
    try:
        values = tuple(float(word) for word in split(text))
    except ValueError:
        values = ()
    if len(values) != count or not all(abs(value) < float("inf") for value in values):
        raise InputError(f"{option}: {text!r}; expected {count} numbers with commas, as 400,0,0")
    return values


def options_given(ctx: typer.Context) -> list[str]:
    """List the options that the command line gives, as help spells them; a switch that is turned off by its `--no-`."""
    given = []
    for parameter in ctx.command.params:
        source = ctx.get_parameter_source(str(parameter.name))
        if parameter.param_type_name == "option" and source is not None and source.name == "COMMANDLINE":
            off = parameter.secondary_opts and ctx.params.get(str(parameter.name)) is False
            given.append((parameter.secondary_opts if off else parameter.opts)[-1])
    return given


def signed_length(text: str, option: str) -> float:
    """Read a length that may be negative, metres."""
    from posekit.formats.own import parse_length

    negative = text.startswith("-")
    return (-1.0 if negative else 1.0) * parse_length(text.removeprefix("-"), name=option)


@contextmanager
def progress(label: str, total: int) -> Iterator[Any]:
    """Show a progress bar on a terminal's stderr; yield the function to call with the number done since then."""
    with _bar(label, total) as (bar, task):
        yield lambda done: bar.advance(task, done)


@contextmanager
def progress_so_far(label: str) -> Iterator[Any]:
    """Show the same; yield the function to call with the number done so far, and of how many."""
    with _bar(label, None) as (bar, task):
        yield lambda done, total: bar.update(task, completed=done, total=total)


def on_terminal() -> bool:
    """Tell whether stderr is a terminal."""
    return sys.stderr.isatty()


class _NoBar:
    """A bar that nobody sees: where there is no terminal, what draws one is not even loaded."""

    def advance(self, task: Any, advance: float) -> None:
        """Do nothing."""

    def update(self, task: Any, **fields: Any) -> None:
        """Do nothing."""


@contextmanager
def _bar(label: str, total: int | None) -> Iterator[tuple[Any, Any]]:
    if not on_terminal():
        yield _NoBar(), None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (TextColumn(label), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        yield bar, bar.add_task(label, total=total)
