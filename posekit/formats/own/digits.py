"""The digits that numbers have: what noise leaves open is not written to the last bit.

In frames whose noise is known, positions are written to a twentieth of the least standard deviation of a joint in the
middle, which adds two ten-thousandths to its variance. JSON keeps so many decimals; an NPZ keeps so many bits, which
pack better. Exact frames keep every bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from posekit.geometry import Array

FEWEST_DECIMALS: Final = 3
"""Of metres that positions are written with: a millimetre, however much noise there is."""
MOST_DECIMALS: Final = 6
OF_DEVIATION: Final = 0.05
"""Which part of a standard deviation is written."""

OF_EIGENVALUE: Final = 0.1
"""Which part of the least eigenvalue of a covariance is written: it is off by 15 % at most then."""
LEAST_EIGENVALUE: Final = 1e-7
"""Of the largest one: below it a covariance is taken for singular."""
LEAST_COVARIANCE: Final = 1e-15
"""Of the square of a file's unit: what is less is not written."""


@dataclass(frozen=True, kw_only=True)
class Precision:
    """What is written of the numbers of a frame whose noise is known.

    Parameters
    ----------
    decimals : int
        Of metres, of positions.
    binary : bool
        Whether numbers are rounded to binary places that are as fine.
    """

    decimals: int
    binary: bool = False

    @staticmethod
    def of(covariance: Array) -> Precision:
        """Choose it by the covariances of joints (..., 3, 3), square metres, NaN where they are not known."""
        variance = np.diagonal(covariance, axis1=-2, axis2=-1).min(axis=-1)
        known = variance[variance > 0]
        # The median: a neck that was given is not what the others are known by.
        decimals = -math.log10(OF_DEVIATION * math.sqrt(np.median(known))) if known.size else MOST_DECIMALS
        return Precision(decimals=min(max(round(decimals), FEWEST_DECIMALS), MOST_DECIMALS))

    def places(self, values: Array, decimals: int | Array) -> Array:
        """Round to decimals, which may be an array that broadcasts."""
        if self.binary:
            scale = np.exp2(np.ceil(np.multiply(decimals, math.log2(10))))
        elif isinstance(decimals, int):
            return np.asarray(np.round(values, decimals))
        else:
            scale = 10.0**decimals
        return np.asarray(np.round(values * scale) / scale)

    def covariances(self, values: Array) -> Array:
        """Round covariances (..., 3, 3) to a tenth of their least eigenvalue: they stay positive definite."""
        # Twice, so that what was read is written as it is: its eigenvalue may have passed a power of ten.
        for _ in range(2):
            eigenvalues = np.linalg.eigvalsh(np.where(np.isfinite(values), values, 0.0))
            least = np.maximum(eigenvalues[..., 0], LEAST_EIGENVALUE * eigenvalues[..., -1])
            decimals = np.ceil(-np.log10(np.maximum(OF_EIGENVALUE * least, LEAST_COVARIANCE)))
            values = self.places(values, decimals[..., None, None])
        return values

    def significant(self, values: Array, digits: int) -> Array:
        """Round to significant digits."""
        if not self.binary:
            return significant(values, digits)
        mantissa, exponent = np.frexp(values)
        bits = math.ceil(digits * math.log2(10))
        return np.asarray(np.ldexp(np.round(np.ldexp(mantissa, bits)), exponent - bits))


def significant(values: Array, digits: int) -> Array:
    """Round to significant decimal digits."""
    with np.errstate(divide="ignore", invalid="ignore"):
        places = digits - 1 - np.floor(np.log10(np.abs(values)))
        scale = np.where(np.isfinite(places), 10.0**places, 1.0)
    return np.asarray(np.round(values * scale) / scale)


def shortened(value: Any) -> Any:
    """Round the floats of plain nested values to five significant digits."""
    if isinstance(value, float):
        return float(f"{value:.5g}")
    if isinstance(value, dict):
        return {key: shortened(one) for key, one in value.items()}
    return [shortened(one) for one in value] if isinstance(value, list) else value


def whole_as_integers(value: Any) -> Any:
    """Take the floats of plain nested values that are whole for integers: JSON spells them in two characters less."""
    if isinstance(value, float):
        return int(value) if value.is_integer() else value
    if isinstance(value, dict):
        return {key: whole_as_integers(one) for key, one in value.items()}
    return [whole_as_integers(one) for one in value] if isinstance(value, list) else value
