"""What a format of motion is: its name, the ends of its files' names, how it is read and written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

from posekit.geometry import Array

if TYPE_CHECKING:
    from posekit.body import Figure
    from posekit.formats.motion.motion import Motion

UNITS: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
"""Metres in a unit, by the names that can be stated."""

Read: TypeAlias = "Callable[[Path, str | None], Motion]"
WritePoints: TypeAlias = "Callable[[Path, Motion], None]"
WriteConfigurations: TypeAlias = "Callable[[Path, Figure, Array, Array], None]"


@dataclass(frozen=True, kw_only=True)
class MotionFormat:
    """One format.

    Parameters
    ----------
    name : str
        As ``--format`` takes it.
    says : str
        What it is, in a line.
    suffixes : tuple of str
        Ends of its files' names, lower case with the dot; empty for a folder.
    read : callable, optional
        Reads a path: ``read(path, unit)``; `unit` is one of `UNITS`, or None for what the file says or, where files do
        not say, what is customary. Missing where a file alone does not give points.
    write_points : callable, optional
        ``write_points(path, motion)`` writes points, whole or not at all.
    write_configurations : callable, optional
        ``write_configurations(path, figure, q, time)`` writes joint angles: q (T, nq) in Pinocchio's order, free-flyer
        first, metres and radians, and the frames' times (T,), seconds; whole or not at all.
    suits : callable, optional
        Tells whether a file looks like it, for formats that share an end; never raises for what is another format.
    """

    name: str
    says: str
    suffixes: tuple[str, ...]
    read: Read | None = None
    write_points: WritePoints | None = None
    write_configurations: WriteConfigurations | None = None
    suits: Callable[[Path], bool] | None = None
