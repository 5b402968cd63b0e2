"""The units of length that files and options are written in; inside posekit all lengths are metres."""

from __future__ import annotations

import re
from collections.abc import Sequence
from decimal import Decimal
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.safe_io.refusal import refusal, shown

Unit = Literal["m", "cm", "mm"]
UNIT_NAMES: Final = get_args(Unit)

UNIT_METRES: Final[dict[str, float]] = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Metres in one unit."""
POSSIBLE_RATES: Final = (1e-3, 1e6)
"""Frames a second that somebody may mean."""

FARTHEST_COORDINATE: Final = 1e9
"""Metres, or pixels, beyond which nothing of a person or of a picture is."""

PER_METRE: Final[dict[str, float]] = {"m": 1.0, "cm": 100.0, "mm": 1000.0}
"""Units in one metre. Whole numbers: dividing by them errs by half a unit in the last place, no more."""

METRES_BELOW: Final = 3.0
"""A number with a decimal point below this, and without a unit, was most likely meant in metres: 1.75."""

_EXPONENTS: Final[dict[str, int]] = {"m": 0, "cm": -2, "mm": -3}
_LENGTH = re.compile(
    r"([+-]?(?:\d{1,40}\.?\d{0,40}|\.\d{1,40})(?:e[+-]?\d{1,4})?)\s*([a-z]*)", re.ASCII | re.I
)


def to_metres(values: ArrayLike | Sequence[Any], unit: str) -> NDArray[np.float64]:
    """Turn values in a unit into metres; None is NaN."""
    return np.asarray(np.asarray(values, dtype=np.float64) / PER_METRE[unit])


def from_metres(values: ArrayLike, unit: str) -> NDArray[np.float64]:
    """Turn values in metres into a unit."""
    return np.asarray(np.asarray(values, dtype=np.float64) * PER_METRE[unit])


def parse_length(text: str, *, name: str = "") -> float:
    """Read a length with its unit, as options of the command line give it.

    Parameters
    ----------
    text : str
        ``"5cm"``, ``"0.05 m"``, ``"50mm"``.
    name : str
        The option, for the error: ``"--group"``.

    Returns
    -------
    float
        Metres, the float nearest to what is written; finite and not negative.

    Raises
    ------
    InputError
        Where it is no number with a unit, or negative.

    Examples
    --------
    >>> parse_length("50mm")
    0.05
    """
    match = _LENGTH.fullmatch(text.strip())
    number = float(match[1]) if match else np.nan
    if match is None or not np.isfinite(number):
        raise refusal(name, "", shown(text), "a length with its unit", "write it as 5cm, 0.05m or 50mm")
    if not match[2]:
        unit = "m" if "." in match[1] and number < METRES_BELOW else "cm"
        raise refusal(
            name, "", shown(text), "a length with its unit", f"add cm, m or mm, as in {match[1]}{unit}"
        )
    if match[2] not in PER_METRE:
        raise refusal(name, "", shown(text), "the unit cm, m or mm", "convert it to one of these")
    if number > FARTHEST_COORDINATE:
        raise refusal(name, "", shown(text), f"a length up to {FARTHEST_COORDINATE:g}", "check the number")
    if number < 0:
        raise refusal(name, "", shown(text), "a length of zero or more", "remove the sign")
    return float(Decimal(match[1]).scaleb(_EXPONENTS[match[2]]))


def check_step(dt: float) -> None:
    """Refuse seconds from frame to frame that nobody means.

    Raises
    ------
    InputError
        Where they are not between those of `POSSIBLE_RATES`.
    """
    low, high = POSSIBLE_RATES
    if not 1 / high <= dt <= 1 / low:
        raise InputError(f"dt is {dt:g} s; expected seconds from frame to frame, as 0.2")
