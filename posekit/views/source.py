"""How a detector's file is to be read: who, with which camera, with which lengths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Final

from posekit.errors import InputError
from posekit.formats.own.units import POSSIBLE_RATES
from posekit.safe_io import perhaps

OPTION_NAMES: Final = {"rate": "--fps", "minimum_confidence": "--min-confidence"}
"""The options that are called otherwise than what they set."""

OWN_PROPORTIONS: Final = ("figure", "taylor")
"""Those that come with the figure, and with Taylor's; others are tables of anthropometry."""


@dataclass(frozen=True, kw_only=True)
class Source:
    """What a user says about a detector's file.

    Parameters
    ----------
    format : str
        Of the file; empty where its structure tells.
    skeleton : str
        A skeleton map by name or file; empty for the format's own.
    person : str
        ``largest``, ``surest``, ``first``, a track's number, ``all``; empty for the only one, else the largest.
    swap_sides : bool
        Whether left and right are exchanged.
    camera : str
        A calibration file or a photograph, with the camera's name after a colon where it has several; empty for none.
    fov, focal35 : float, optional
        Guesses: the horizontal field of view in degrees, or the focal length in 35 mm equivalents.
    size : (int, int), optional
        Width and height of the picture, pixels.
    rate : float, optional
        Frames a second.
    minimum_confidence : float
        Points that are less sure count as not seen.
    deviation : float, optional
        Standard deviation of each coordinate of the points, pixels.
    stature : float, optional
        Metres.
    lengths, calibrate : path, optional
        The person's lengths, or a recording of the person that gives them.
    proportions : str
        By which proportions a stature gives lengths.

    Raises
    ------
    InputError
        Where two say the same thing differently.
    """

    format: str = ""
    skeleton: str = ""
    person: str = ""
    swap_sides: bool = False
    camera: str = ""
    fov: float | None = None
    focal35: float | None = None
    size: tuple[int, int] | None = None
    rate: float | None = None
    minimum_confidence: float = 0.0
    deviation: float | None = None
    stature: float | None = None
    lengths: Path | None = None
    calibrate: Path | None = None
    proportions: str = "figure"

    def __post_init__(self) -> None:
        cameras = {
            "--camera": self.camera or None,
            "--fov": self.fov,
            "--focal35": self.focal35,
        }
        _one_of(cameras, "one camera")
        if self.proportions not in OWN_PROPORTIONS:
            from posekit.body.anthropometry import proportion_names

            names = (*OWN_PROPORTIONS, *proportion_names())
            if self.proportions not in names:
                raise InputError(
                    f"--proportions: {self.proportions!r}; expected one of {', '.join(names)}"
                    + perhaps(self.proportions, names)
                )
        _one_of({"--lengths": self.lengths, "--calibrate": self.calibrate}, "one source of lengths")
        inf = float("inf")
        bounds = (
            ("--fps", self.rate, *POSSIBLE_RATES, "frames a second, as 30"),
            ("--fov", self.fov, 0.0, 180.0, "degrees, more than 0 and less than 180"),
            ("--focal35", self.focal35, 0.0, 10_000.0, "millimetres, more than 0 and less than 10,000"),
            ("--deviation", self.deviation, 0.0, inf, "a positive number of pixels"),
            ("--min-confidence", self.minimum_confidence, -inf, inf, "a number, mostly 0 to 1"),
        )
        for name, value, lower, upper, expected in bounds:
            if value is not None and not lower < value < upper:
                raise InputError(f"{name}: {value!r}; expected {expected}")

    @property
    def given(self) -> dict[str, bool]:
        """Which options are given, by name."""
        nothing = Source()
        return {
            OPTION_NAMES.get(one.name, f"--{one.name.replace('_', '-')}"): getattr(self, one.name)
            != getattr(nothing, one.name)
            for one in fields(self)
        }


def _one_of(given: Mapping[str, object], what: str) -> None:
    named = [name for name, value in given.items() if value is not None]
    if len(named) > 1:
        raise InputError(f"{named[1]}: {named[0]} is given too; expected {what}; leave out all but one")
