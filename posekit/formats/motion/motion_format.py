"""What a format of motion declares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

from posekit.formats.format import Content, Format
from posekit.geometry import Array

if TYPE_CHECKING:
    from posekit.body import Figure
    from posekit.formats.motion.motion import Motion

STATE_RATE: Final = "state it: posekit convert FILE OUT.trc --fps RATE"
"""What to do with a file that says no frame rate."""

METRES_IN_UNIT: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
"""How many metres a unit is, by the names that can be stated."""

ReadMotion: TypeAlias = "Callable[[Path, str | None], Motion]"
WritePoints: TypeAlias = "Callable[[Path, Motion], None]"
WriteConfigurations: TypeAlias = "Callable[[Path, Figure, Array, Array], None]"


@dataclass(frozen=True, kw_only=True)
class MotionFormat(Format):
    """A format of motion: points, or the angles of a body, over time.

    Parameters
    ----------
    read : callable, optional
        ``read(path, unit)`` reads a file; `unit` is one of `METRES_IN_UNIT`, or None for what the file says or, where
        files do not say it, what is customary. Missing where a file alone does not give points.
    read_recorded : callable, optional
        Reads as `read` does, and takes times that do not ascend, and a rate that is missing or none, as they are: see
        `Motion.as_recorded`. Missing where `read` finds no such times.
    write_points : callable, optional
        ``write_points(path, motion)`` writes points, whole or not at all.
    write_configurations : callable, optional
        ``write_configurations(path, figure, q, time)`` writes joint angles: q (T, nq) in Pinocchio's order, free-flyer
        first, metres and radians, and the frames' times (T,), seconds; whole or not at all.
    written_by : tuple of str
        The optional package that writes it, as `posekit.safe_io.extras.extra` takes it; empty where none is needed. It
        is asked for before anything is read.
    """

    holds: Content = Content.MOTION
    read: ReadMotion | None = None
    read_recorded: ReadMotion | None = None
    write_points: WritePoints | None = None
    write_configurations: WriteConfigurations | None = None
    written_by: tuple[str, str, str] | tuple[()] = ()

    @property
    def reads(self) -> bool:
        """Whether files of this format can be read."""
        return self.read is not None

    @property
    def writes(self) -> bool:
        """Whether files of this format can be written."""
        return self.write_points is not None or self.write_configurations is not None
