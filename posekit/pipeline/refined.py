"""Survivors that were refined: the likeliest postures, and how sure they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.pipeline.contact import Overlaps
from posekit.refinement import Merged, Refined
from posekit.refinement.merging import merge
from posekit.tree import Check


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

    def part(self, rows: slice) -> RefinedSurvivors:
        """Return some of them."""
        return RefinedSurvivors(**{item.name: getattr(self, item.name)[rows] for item in fields(self)})


@dataclass(frozen=True, kw_only=True, eq=False)
class Sifted:
    """What became of N leaves: their probabilities, which of them stand for themselves, and those.

    Parameters
    ----------
    p : array (N,)
        The probability that noise alone gives a chi2 as large.
    overlaps : Overlaps
        Which of those that the noise explains have bodies that overlap too far.
    explained, kept : bool array (N,)
        Those that the noise explains, and of those whose bodies do not overlap the likeliest that became one.
    survivors : RefinedSurvivors
        Those kept, in the leaves' order.
    """

    p: Array
    overlaps: Overlaps
    explained: NDArray[np.bool_]
    kept: NDArray[np.bool_]
    survivors: RefinedSurvivors

    @staticmethod
    def of(refined: Refined, known: NDArray[np.bool_], collisions: Sequence[Check]) -> Sifted:
        """Reject what noise cannot explain, then what `collisions` do, and merge what became one.

        Joints that are not `known` become NaN.
        """
        explained = refined.explained()
        likely = np.flatnonzero(explained)
        joints = np.where(known[likely, :, None], refined.joints[likely], np.nan)
        points = np.concatenate([joints, refined.head[likely]], axis=1)
        overlaps = Overlaps.of(collisions, points).at(likely, len(refined))
        merged: Merged = merge(refined, keep=explained & (overlaps.place < 0))
        order = np.argsort(merged.rows)
        rows = merged.rows[order]
        size = np.bincount(merged.group[merged.group >= 0], minlength=len(rows))[order]
        chosen = merged.refined.select(order)
        joints, covariance = chosen.joints.copy(), chosen.covariance.copy()
        joints[~known[rows]] = np.nan
        covariance[~known[rows]] = np.nan
        kept = np.zeros(len(refined), dtype=np.bool_)
        kept[rows] = True
        return Sifted(
            p=refined.p,
            overlaps=overlaps,
            explained=explained,
            kept=kept,
            survivors=RefinedSurvivors(
                joints=joints,
                head=chosen.head.copy(),
                chi2=chosen.chi2.copy(),
                dof=chosen.dof.copy(),
                p=chosen.p.copy(),
                covariance=covariance,
                merged=size - 1,
            ),
        )

    @staticmethod
    def joined(parts: list[Sifted]) -> Sifted:
        """Put the leaves of one part behind those of the last."""
        survivors = RefinedSurvivors(
            **{
                item.name: np.concatenate([getattr(part.survivors, item.name) for part in parts])
                for item in fields(RefinedSurvivors)
            }
        )
        p, explained, kept = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("p", "explained", "kept")
        )
        overlaps = Overlaps.joined([part.overlaps for part in parts])
        return Sifted(p=p, overlaps=overlaps, explained=explained, kept=kept, survivors=survivors)
