"""What a result says of a joint that was not seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from posekit.formats.own.column import column, columns_in
from posekit.formats.own.units import Unit
from posekit.geometry import Array
from posekit.safe_io.refusal import refusal


@dataclass(frozen=True, kw_only=True, eq=False)
class Inferred:
    """The set of positions that a joint can have which was not seen, in one posture.

    The posture's own joint is a feasible position in the middle of the set.
    """

    schema_title: ClassVar = (
        "ResultInferred",
        "What is known of the position of a joint that was not seen.",
    )

    kind: str = column(
        "completed, point, circle, sphere region, depth interval or region: what the set of positions is.",
        kind="str",
    )
    lower: Array = column("The least x, y, z of the set, in `unit`.", shape=(3,), length_power=1)
    upper: Array = column("The greatest x, y, z of the set, in `unit`.", shape=(3,), length_power=1)
    radius: float = column(
        "From the posture's joint to the farthest feasible position, in `unit`.", length_power=1
    )
    fraction: float = column("How much of the circle or sphere is feasible.", default=1.0)

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
        for name in ("radius", "fraction"):
            object.__setattr__(self, name, float(getattr(self, name)))
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
            each.key: self.kind
            if each.kind == "str"
            else each.in_file(np.asarray(getattr(self, name)), unit).tolist()
            for name, each in columns_in(Inferred).items()
        }

    @staticmethod
    def of(fields: Mapping[str, Any], unit: Unit) -> Inferred:
        """Make it of what a file says."""
        values: dict[str, Any] = {
            name: fields[each.key]
            if each.kind == "str"
            else each.in_memory(np.asarray(fields[each.key], dtype=np.float64), unit)
            for name, each in columns_in(Inferred).items()
        }
        return Inferred(**values)
