"""Survivors that were refined: the likeliest postures, and how sure they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.refinement import Merged


@dataclass(frozen=True, kw_only=True, eq=False)
class RefinedSurvivors:
    """N survivors under noise, in the order of the leaves that they came from.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Camera frame, metres; NaN where a joint is not known.
    head : array (N, 5, 3)
        The head's points; NaN where the head was not seen.
    chi2 : array (N,)
        Sum of squares of what is off over its standard deviations.
    dof : int array (N,)
        Its degrees of freedom.
    p : array (N,)
        The probability that noise alone gives a chi2 as large.
    covariance : array (N, 14, 3, 3)
        Of every joint, square metres.
    merged : int array (N,)
        How many other leaves became the same posture.
    """

    joints: Array
    head: Array
    chi2: Array
    dof: NDArray[np.intp]
    p: Array
    covariance: Array
    merged: NDArray[np.intp]

    def __post_init__(self) -> None:
        for item in fields(self):
            getattr(self, item.name).flags.writeable = False

    def __len__(self) -> int:
        """Count the survivors."""
        return len(self.joints)

    @staticmethod
    def of(merged: Merged, known: NDArray[np.bool_]) -> RefinedSurvivors:
        """Take what was merged; joints that are not `known` (of all leaves) become NaN."""
        order = np.argsort(merged.rows)
        unknown = ~known[merged.rows[order]]
        chosen = merged.refined.select(order)
        joints, covariance = chosen.joints.copy(), chosen.covariance.copy()
        joints[unknown] = np.nan
        covariance[unknown] = np.nan
        size = np.bincount(merged.group[merged.group >= 0], minlength=len(order))[order]
        return RefinedSurvivors(
            joints=joints,
            head=chosen.head.copy(),
            chi2=chosen.chi2.copy(),
            dof=chosen.dof.copy(),
            p=chosen.p.copy(),
            covariance=covariance,
            merged=size - 1,
        )

    @staticmethod
    def joined(parts: Sequence[RefinedSurvivors]) -> RefinedSurvivors:
        """Put those of one part behind those of the last."""
        return RefinedSurvivors(
            **{
                item.name: np.concatenate([getattr(part, item.name) for part in parts])
                for item in fields(RefinedSurvivors)
            }
        )

    def part(self, rows: slice) -> RefinedSurvivors:
        """Return some of them."""
        return RefinedSurvivors(**{item.name: getattr(self, item.name)[rows] for item in fields(self)})
