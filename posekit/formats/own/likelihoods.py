"""How likely and how sure refined survivors are, as a result says it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.units import PER_METRE, Unit
from posekit.safe_io.refusal import refusal
from posekit.skeleton import JOINTS

Array = NDArray[np.float64]

UPPER: Final = ([0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2])
"""Entries of a covariance that files hold: xx, xy, xz, yy, yz, zz."""

NUMBERS: Final = ("chi2", "dof", "p", "merged")
"""What is one number a survivor."""

DIGITS: Final = 6
"""Significant digits of a covariance in a file."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Likelihoods:
    """What refinement says of N survivors.

    Parameters
    ----------
    chi2 : array (N,)
        Sum of squares of what is off over its standard deviations.
    dof : array (N,)
        Its degrees of freedom.
    p : array (N,)
        The probability that noise alone gives a chi2 as large.
    merged : array (N,)
        How many other branches became the same posture.
    covariance : array (N, 14, 3, 3)
        Of every joint, square metres; NaN where a joint is not known.
    """

    chi2: Array
    dof: Array
    p: Array
    merged: Array
    covariance: Array

    def __post_init__(self) -> None:
        count = len(self.chi2)
        for item in fields(self):
            values = np.array(getattr(self, item.name), dtype=np.float64)
            shape = (count, len(JOINTS), 3, 3) if item.name == "covariance" else (count,)
            if values.shape != shape or np.isinf(values).any():
                raise refusal(
                    "result",
                    f"refined.{item.name}",
                    f"shape {values.shape}",
                    f"finite numbers of shape {shape}",
                    "correct what made the result",
                )
            values.flags.writeable = False
            object.__setattr__(self, item.name, values)

    def __len__(self) -> int:
        """Count the survivors."""
        return len(self.chi2)

    @staticmethod
    def nothing(count: int) -> Likelihoods:
        """Say nothing of some survivors."""
        unknown = np.full(count, np.nan)
        covariance = np.full((count, len(JOINTS), 3, 3), np.nan)
        return Likelihoods(chi2=unknown, dof=unknown, p=unknown, merged=unknown, covariance=covariance)

    def packed(self, unit: Unit) -> Array:
        """Return the covariances as files hold them (N, 14, 6), in the square of a unit."""
        values = self.covariance[..., UPPER[0], UPPER[1]] * PER_METRE[unit] ** 2
        with np.errstate(divide="ignore", invalid="ignore"):
            digits = DIGITS - 1 - np.floor(np.log10(np.abs(values)))
            scale = np.where(np.isfinite(digits), 10.0**digits, 1.0)
        return np.asarray(np.round(values * scale) / scale)

    @staticmethod
    def unpacked(values: Array, unit: Unit) -> Array:
        """Return covariances (N, 14, 3, 3), square metres, of what files hold."""
        covariance = np.empty((*values.shape[:-1], 3, 3))
        covariance[..., UPPER[0], UPPER[1]] = values / PER_METRE[unit] ** 2
        covariance[..., UPPER[1], UPPER[0]] = values / PER_METRE[unit] ** 2
        return covariance

    def rows(self, unit: Unit) -> list[dict[str, Any]]:
        """Return what a file says of each survivor, in its unit."""
        covariance = [
            [None if np.isnan(joint).any() else joint.tolist() for joint in posture]
            for posture in self.packed(unit)
        ]
        return [
            {
                "chi2": float(self.chi2[k]),
                "dof": int(self.dof[k]),
                "p": float(self.p[k]),
                "merged": int(self.merged[k]),
                "covariance": covariance[k],
            }
            for k in range(len(self))
        ]

    @staticmethod
    def of(rows: Sequence[Mapping[str, Any]], unit: Unit) -> Likelihoods:
        """Make them of what a file says."""
        packed = np.array(
            [[[np.nan] * 6 if joint is None else joint for joint in row["covariance"]] for row in rows],
            dtype=np.float64,
        ).reshape(-1, len(JOINTS), 6)
        return Likelihoods(
            covariance=Likelihoods.unpacked(packed, unit),
            **{name: np.array([row[name] for row in rows], dtype=np.float64) for name in NUMBERS},
        )
