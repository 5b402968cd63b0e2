"""Length units and axis names of files; in memory every length is in metres."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.geometry.vectors import Array

#: Number of units in one metre. The numbers are whole, so that divisions by them are correctly rounded.
PER_METRE: Final[dict[str, float]] = {"m": 1.0, "cm": 100.0, "mm": 1000.0}

#: Largest accepted coordinate, metres or pixels.
FARTHEST_COORDINATE: Final = 1e9

#: Words for units of length, in lower case.
UNIT_WORDS: Final = {
    **{name: name for name in ("m", "cm", "mm", "in")},
    **dict.fromkeys(("meters", "metres", "meter", "metre"), "m"),
    **dict.fromkeys(("centimeters", "centimetres", "centimeter", "centimetre"), "cm"),
    **dict.fromkeys(("millimeters", "millimetres", "millimeter", "millimetre"), "mm"),
    **dict.fromkeys(("inches", "inch"), "in"),
}

#: Names of the axes that can point up; an unknown axis is the empty string.
UP_AXES: Final = ("+x", "-x", "+y", "-y", "+z", "-z")

#: Words for axes that point up, in lower case.
UP_WORDS: Final = {
    **{axis: axis for axis in UP_AXES},
    **{f"{axis}{up}": f"+{axis}" for axis in "xyz" for up in ("", "up", "-up", "_up", " up")},
}


def to_metres(values: ArrayLike, unit: str) -> Array:
    """Convert lengths in a given unit to metres; None becomes NaN."""
    return np.asarray(np.asarray(values, dtype=np.float64) / PER_METRE[unit])


def from_metres(values: ArrayLike, unit: str) -> Array:
    """Convert lengths in metres to a given unit."""
    return np.asarray(np.asarray(values, dtype=np.float64) * PER_METRE[unit])


def up_vector(up: str) -> Array:
    """Return the unit vector (3,) of an axis name such as ``"-y"``; NaN if the name is empty."""
    if not up:
        return np.full(3, np.nan)
    vector = np.zeros(3)
    vector["xyz".index(up[1])] = 1.0 if up[0] == "+" else -1.0
    return vector
