"""Where the body was put in depth in one calibrated frame, as results hold it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.units import Unit, from_metres, to_metres
from posekit.safe_io.refusal import refusal

Array = NDArray[np.float64]

ROOT_ARRAYS = ("intervals", "chosen", "minima_depth", "minima_residual", "curve_depth", "curve_residual")


def _nothing() -> Array:
    return np.empty(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Root:
    """How the neck's depth was found, how far it can be off, and which depths were taken.

    Parameters
    ----------
    method : str
        ``given``, ``head`` (perspective-n-point of its points), ``torso`` (of its four), or ``search`` along the
        neck's ray.
    chosen : array (H,)
        The depths of the neck (z in the camera frame, metres) that postures were recovered at.
    residual : float
        Of the method: root mean square reprojection error in pixels, or for a search the least misfit of the rigid
        parts in metres; NaN where there is none.
    residual_unit : {"px", "m"}
        What the residual is in.
    estimate : float
        The single most likely depth, metres; NaN where there is none.
    deviation : float
        Standard deviation of the depth, metres, to first order; NaN where the method gives none.
    lower, upper : float
        The whole feasible interval of the depth, metres; NaN where it is not known.
    segment : str
        The segment that sets the upper end: farther away it is too short for its image.
    intervals : array (I, 2)
        The parts of it in which the rigid parts can close within the tolerance, metres.
    minima_depth, minima_residual : array (M,)
        Local minima of the misfit, metres.
    curve_depth, curve_residual : array (C,)
        The misfit against the depth, the least over all branches, metres.
    note : str
        Why another method was not used, where that needs saying.
    """

    method: str
    chosen: Array
    residual: float = np.nan
    residual_unit: str = "m"
    estimate: float = np.nan
    deviation: float = np.nan
    lower: float = np.nan
    upper: float = np.nan
    segment: str = ""
    intervals: Array = field(default_factory=_nothing)
    minima_depth: Array = field(default_factory=_nothing)
    minima_residual: Array = field(default_factory=_nothing)
    curve_depth: Array = field(default_factory=_nothing)
    curve_residual: Array = field(default_factory=_nothing)
    note: str = ""

    def __post_init__(self) -> None:
        for name in ROOT_ARRAYS:
            values = np.array(getattr(self, name), dtype=np.float64)
            values = values.reshape(-1, 2) if name == "intervals" else values.reshape(-1)
            if not np.isfinite(values).all():
                raise refusal("result", f"root.{name}", "NaN or infinity", "finite depths", "write it again")
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        for start in ("minima", "curve"):
            a, b = (len(getattr(self, f"{start}_{end}")) for end in ("depth", "residual"))
            if a != b:
                raise refusal(
                    "result", f"root.{start}", f"{a} depths and {b} residuals", "one each", "write it again"
                )

    def fields(self, unit: Unit) -> dict[str, Any]:
        """Return what a file says, in its unit."""
        in_metres = self.residual_unit == "m"
        return {
            "method": self.method,
            "chosen": from_metres(self.chosen, unit).tolist(),
            "residual": _known(from_metres(self.residual, unit) if in_metres else self.residual),
            "residual_unit": unit if in_metres else "px",
            "estimate": _known(from_metres(self.estimate, unit)),
            "deviation": _known(from_metres(self.deviation, unit)),
            "lower": _known(from_metres(self.lower, unit)),
            "upper": _known(from_metres(self.upper, unit)),
            "segment": self.segment,
            "intervals": from_metres(self.intervals, unit).tolist(),
            "minima": [
                {"depth": depth, "residual": residual}
                for depth, residual in zip(
                    from_metres(self.minima_depth, unit).tolist(),
                    from_metres(self.minima_residual, unit).tolist(),
                    strict=True,
                )
            ],
            "curve": {
                "depth": from_metres(self.curve_depth, unit).tolist(),
                "residual": from_metres(self.curve_residual, unit).tolist(),
            },
            "note": self.note,
        }

    @staticmethod
    def of(fields: Mapping[str, Any], unit: Unit) -> Root:
        """Make it of what a file says."""
        in_metres = fields["residual_unit"] != "px"
        residual = np.nan if fields["residual"] is None else float(fields["residual"])
        lengths = {
            name: np.nan if fields[name] is None else float(to_metres(fields[name], unit))
            for name in ("estimate", "deviation", "lower", "upper")
        }
        return Root(
            method=fields["method"],
            chosen=to_metres(fields["chosen"], unit),
            residual=float(to_metres(residual, unit)) if in_metres else residual,
            residual_unit="m" if in_metres else "px",
            segment=fields["segment"],
            intervals=to_metres(fields["intervals"], unit),
            minima_depth=to_metres([one["depth"] for one in fields["minima"]], unit),
            minima_residual=to_metres([one["residual"] for one in fields["minima"]], unit),
            curve_depth=to_metres(fields["curve"]["depth"], unit),
            curve_residual=to_metres(fields["curve"]["residual"], unit),
            note=fields["note"],
            **lengths,
        )


def _known(value: float | Array) -> float | None:
    """Write what is not known as None: JSON has no NaN."""
    return None if np.isnan(value) else float(value)
