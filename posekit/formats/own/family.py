"""The family of solutions of one uncalibrated frame, as results hold it (Taylor 2000, section 2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.display.short_repr import ShortRepr
from posekit.formats.own.units import PER_METRE, Unit
from posekit.safe_io.refusal import refusal

Array = NDArray[np.float64]


def _nothing() -> Array:
    return np.empty(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Family(ShortRepr):
    """Which scales an uncalibrated frame can have, and which were taken.

    Parameters
    ----------
    how : str
        How the scale was found: ``min``, ``likely``, ``view``, ``value``, ``stature``, or the constraints.
    bound : float
        The least scale that the lengths allow, pixels a metre (files: a `unit`).
    segment : str
        The segment that sets the bound.
    chosen : array (H,)
        The scales that postures were recovered at, pixels a metre.
    deviation : float, optional
        Relative standard deviation of a likely scale.
    minima_s, minima_residual : array (M,)
        All local minima of the constraints' residual (dimensionless), best first.
    curve_s, curve_residual : array (C,)
        The residual against the scale: the least over all flips.
    mirrored : int
        How many survivors have their mirror image, near and far exchanged throughout, among the survivors.
    """

    how: str
    bound: float
    segment: str
    chosen: Array
    deviation: float | None = None
    minima_s: Array = field(default_factory=_nothing)
    minima_residual: Array = field(default_factory=_nothing)
    curve_s: Array = field(default_factory=_nothing)
    curve_residual: Array = field(default_factory=_nothing)
    mirrored: int = 0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.bound) and self.bound > 0):
            raise refusal("result", "scale.bound", f"{self.bound:g}", "a positive number", "write it again")
        for name in ("chosen", "minima_s", "minima_residual", "curve_s", "curve_residual"):
            values = np.array(getattr(self, name), dtype=np.float64).reshape(-1)
            if not (np.isfinite(values) & (values >= 0)).all():
                raise refusal(
                    "result", f"scale.{name}", "a number below 0", "finite positive numbers", "write it again"
                )
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        for start in ("minima", "curve"):
            a, b = (len(getattr(self, f"{start}_{end}")) for end in ("s", "residual"))
            if a != b:
                raise refusal(
                    "result",
                    f"scale.{start}",
                    f"{a} scales and {b} residuals",
                    "one each",
                    "write it again",
                )

    def fields(self, unit: Unit) -> dict[str, Any]:
        """Return what a file says, in its unit."""
        per = PER_METRE[unit]
        pairs = zip((self.minima_s / per).tolist(), self.minima_residual.tolist(), strict=True)
        return {
            "how": self.how,
            "bound": self.bound / per,
            "segment": self.segment,
            "chosen": (self.chosen / per).tolist(),
            **({} if self.deviation is None else {"deviation": self.deviation}),
            "minima": [{"s": s, "residual": residual} for s, residual in pairs],
            "curve": {"s": (self.curve_s / per).tolist(), "residual": self.curve_residual.tolist()},
            "mirrored": self.mirrored,
        }

    @staticmethod
    def of(fields: Mapping[str, Any], unit: Unit) -> Family:
        """Make a family of what a file says."""
        per = PER_METRE[unit]
        return Family(
            how=fields["how"],
            bound=fields["bound"] * per,
            segment=fields["segment"],
            chosen=np.array(fields["chosen"]) * per,
            deviation=fields.get("deviation"),
            minima_s=np.array([minimum["s"] for minimum in fields["minima"]]) * per,
            minima_residual=np.array([minimum["residual"] for minimum in fields["minima"]]),
            curve_s=np.array(fields["curve"]["s"]) * per,
            curve_residual=np.array(fields["curve"]["residual"]),
            mirrored=fields["mirrored"],
        )
