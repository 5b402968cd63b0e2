"""How much a view of an object may disagree with its linkage."""

from __future__ import annotations

import math
from dataclasses import dataclass

from posekit.errors import InputError


@dataclass(frozen=True, kw_only=True)
class ObjectTolerance:
    """Allowances for lengths and image points that are not exact, in the linkage's unit of length.

    Parameters
    ----------
    rigid : float
        How far the lengths that close loops, and points on a plane or line, may be off.
    tangent : float
        By how much a segment may be too short for its image.
    point : float
        How far a point may be off in the image. What that does to depths is accounted for where it is not
        rounding alone (`posekit.objects.spread`).
    """

    rigid: float
    tangent: float
    point: float

    def __post_init__(self) -> None:
        for name in ("rigid", "tangent", "point"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"--{name}-tolerance: {value!r}; expected zero or a positive length")

    @staticmethod
    def exact(longest: float) -> ObjectTolerance:
        """Return what rounding costs of a linkage whose longest segment is so long.

        A segment that is seen at full length has a foreshortening that is the root of what rounding leaves.
        """
        return ObjectTolerance(rigid=1e-6 * longest, tangent=1e-9 * longest, point=1e-6 * longest)

    @staticmethod
    def measured(longest: float) -> ObjectTolerance:
        """Return what image points that were picked by hand cost: a hundredth of the longest segment each."""
        return ObjectTolerance(rigid=0.01 * longest, tangent=0.02 * longest, point=0.01 * longest)

    def times(self, factor: float) -> ObjectTolerance:
        """Return the same in another unit."""
        return ObjectTolerance(
            rigid=self.rigid * factor, tangent=self.tangent * factor, point=self.point * factor
        )
