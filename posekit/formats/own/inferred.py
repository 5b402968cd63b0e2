"""What a result says of a joint that was not seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.units import Unit, from_metres, to_metres
from posekit.safe_io.refusal import refusal

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Inferred:
    """The set of positions that a joint can have which was not seen, in one posture.

    The posture's own joint is a feasible position in the middle of the set.

    Parameters
    ----------
    kind : str
        What the set is: ``completed`` or ``point`` from its rigid part, ``circle``, ``sphere region``, ``depth
        interval`` of a joint that was seen beyond a hidden one, or ``region`` of space.
    lower, upper : array (3,)
        Its bounding box, camera frame, metres.
    radius : float
        The largest distance from the posture's joint to a feasible position, metres.
    fraction : float
        How much of the circle or sphere is feasible; 1 where there is only one position.
    """

    kind: str
    lower: Array
    upper: Array
    radius: float
    fraction: float = 1.0

    def __post_init__(self) -> None:
        for name in ("lower", "upper"):
            values = np.array(getattr(self, name), dtype=np.float64)
            if values.shape != (3,) or not np.isfinite(values).all():
                raise refusal(
                    "result",
                    f"inferred.{name}",
                    f"shape {values.shape}",
                    "three finite numbers",
                    "correct it",
                )
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if not (np.isfinite(self.radius) and self.radius >= 0 and 0 <= self.fraction <= 1):
            raise refusal(
                "result",
                "inferred",
                f"radius {self.radius:g} and fraction {self.fraction:g}",
                "a radius from 0 and a fraction from 0 to 1",
                "correct what made the result",
            )

    def fields(self, unit: Unit) -> dict[str, Any]:
        """Return what a file says, in its unit."""
        return {
            "kind": self.kind,
            "lower": from_metres(self.lower, unit).tolist(),
            "upper": from_metres(self.upper, unit).tolist(),
            "radius": float(from_metres(self.radius, unit)),
            "fraction": float(self.fraction),
        }

    @staticmethod
    def of(fields: Mapping[str, Any], unit: Unit) -> Inferred:
        """Make it of what a file says."""
        return Inferred(
            kind=fields["kind"],
            lower=to_metres(fields["lower"], unit),
            upper=to_metres(fields["upper"], unit),
            radius=float(to_metres(fields["radius"], unit)),
            fraction=fields["fraction"],
        )
