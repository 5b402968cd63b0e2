"""How the scale of an uncalibrated picture is to be found: what `--scale` says."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from posekit.errors import InputError

SCALE_CONSTRAINTS = ("closure", "coplanar", "perpendicular", "collinear")

How = Literal["min", "likely", "value", "stature", "constraints"]

SCALE_EXPECTED = (
    f"min, a number, stature:PX, likely, or some of {', '.join(SCALE_CONSTRAINTS)}, "
    "as in closure or closure:1,coplanar:0.5"
)


@dataclass(frozen=True, kw_only=True)
class Scale:
    """One way to fix s (Taylor 2000, sections 2.1, 3.1 and 3.2).

    Parameters
    ----------
    how : {"min", "likely", "value", "stature", "constraints"}
        ``min`` takes the least scale that the lengths allow; ``likely`` that at which a normal body's segments look
        as long as they are seen (`posekit.recovery.likely_scale`); ``value`` a given one; ``stature`` the ratio of a
        height in pixels to the true one; ``constraints`` searches the minima of their residual.
    value : float, optional
        Pixels a metre, or the height in pixels.
    weights : mapping of str to float
        The constraints and their weights.
    """

    how: How = "min"
    value: float | None = None
    weights: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        given = [self.value] if self.how in ("value", "stature") else list(self.weights.values())
        if not all(number is not None and math.isfinite(number) and number > 0 for number in given):
            raise InputError(f"--scale: {given} is not positive and finite; expected {SCALE_EXPECTED}")
        unknown = [name for name in self.weights if name not in SCALE_CONSTRAINTS]
        if unknown or (self.how == "constraints" and not self.weights):
            raise InputError(
                f"--scale: {(unknown or ['nothing'])[0]!r} is no way to find a scale; expected {SCALE_EXPECTED}"
            )


def parse_scale(text: str, *, per_unit: float = 1.0) -> Scale:
    """Read what `--scale` says.

    Parameters
    ----------
    text : str
        ``min``, ``likely``, ``VALUE`` in pixels a unit of length, ``stature:PX``, or constraints with optional weights.
    per_unit : float
        Units of length in a metre, to turn VALUE into pixels a metre.

    Raises
    ------
    InputError
        Where it is none of these.

    Examples
    --------
    >>> parse_scale("closure:1,coplanar:0.5").weights
    {'closure': 1.0, 'coplanar': 0.5}
    """
    text = text.strip()
    if text in ("min", "likely"):
        return Scale(how="min" if text == "min" else "likely")
    if text.startswith("stature:"):
        return Scale(how="stature", value=_number(text.removeprefix("stature:")))
    if _is_number(text):
        return Scale(how="value", value=_number(text) * per_unit)
    parts = [part.strip().partition(":") for part in text.split(",")]
    return Scale(
        how="constraints",
        weights={name: _number(weight) if colon else 1.0 for name, colon, weight in parts},
    )


def way_of(known: float | None, scale: Scale | None) -> tuple[str, Scale]:
    """Return how a scale is found, by name, and the way itself: as was asked, else the view's own, else the least."""
    if scale is not None:
        return "+".join(scale.weights) or scale.how, scale
    return ("min", Scale()) if known is None else ("view", Scale(how="value", value=known))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _number(text: str) -> float:
    if not _is_number(text):
        raise InputError(f"--scale: {text!r} is not a number; expected {SCALE_EXPECTED}")
    return float(text)
