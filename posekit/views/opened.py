"""One person's view, and what it was made of."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from posekit.formats.own import View


@dataclass(frozen=True, kw_only=True)
class Opened:
    """One person's view.

    Parameters
    ----------
    person : int
        The number to choose them by.
    view : View
        The person's view.
    says : tuple of str
        What it was made of, a line each: format, person, camera, lengths.
    pictures : tuple of str
        The pictures that the frames were detected in, by name; empty where nobody says.
    """

    person: int
    view: View
    says: tuple[str, ...]
    pictures: tuple[str, ...] = ()


def of_person(path: Path, one: Opened, *, alone: bool) -> Path:
    """Name the file of one of several people: ``out.json`` becomes ``out.person2.json``."""
    return path if alone else path.with_name(f"{path.stem}.person{one.person}{path.suffix}")
