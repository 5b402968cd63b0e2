"""Survivors that were refined: the likeliest postures, and how sure they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.display.short_repr import ShortRepr
from posekit.geometry import Array
from posekit.refinement import Merged, Refined

ALL_ROWS = slice(None)

SURVIVOR_ARRAYS = ("joints", "head", "chi2", "dof", "p", "merged", "size", "size_deviation")


class Covariances:
    """Covariances of N survivors, all found at the first reading: small arrays of each frame would take longer.

    Parameters
    ----------
    refined : Refined
        The survivors.
    unknown : bool array (N, 14)
        Joints whose covariances are NaN.
    """

    def __init__(self, refined: Refined, unknown: NDArray[np.bool_]) -> None:
        self._asked: tuple[Refined, NDArray[np.bool_]] | Sequence[Covariances] = (refined, unknown)
        self._count = len(refined)
        self._found: Array | None = None

    @staticmethod
    def joined(parts: Sequence[Covariances]) -> Covariances:
        """Put those of one part behind those of the last."""
        out = object.__new__(Covariances)
        out._asked = list(parts)
        out._count = sum(map(len, parts))
        out._found = None
        return out

    def __len__(self) -> int:
        """Count the survivors."""
        return self._count

    def read(self) -> Array:
        """Return the covariances (N, 14, 3, 3), square metres."""
        if self._found is None:
            self._found = self._find()
            self._found.flags.writeable = False
            self._asked = []
        return self._found

    def _find(self) -> Array:
        if isinstance(self._asked, tuple):
            refined, unknown = self._asked
            covariance = refined.covariance.copy()
            covariance[unknown] = np.nan
            return np.asarray(covariance)
        return np.concatenate([part.read() for part in self._asked])

    def __getstate__(self) -> dict[str, object]:
        """Give away what was found: what it is found from is larger."""
        return {"_asked": [], "_count": self._count, "_found": self.read()}


@dataclass(frozen=True, kw_only=True, eq=False)
class RefinedSurvivors(ShortRepr):
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
    merged : int array (N,)
        How many other leaves became the same posture.
    size, size_deviation : array (N,)
        By what factor each body is larger than its figure, and the standard deviation of the logarithm of that, beside
        what the covariance has of it.
    covariances : Covariances
        Of these survivors and others, found when they are read.
    rows : slice
        Which of those these are.
    """

    joints: Array
    head: Array
    chi2: Array
    dof: NDArray[np.intp]
    p: Array
    merged: NDArray[np.intp]
    size: Array
    size_deviation: Array
    covariances: Covariances
    rows: slice

    def __post_init__(self) -> None:
        for name in SURVIVOR_ARRAYS:
            getattr(self, name).flags.writeable = False

    @property
    def covariance(self) -> Array:
        """The covariance of every joint (N, 14, 3, 3), square metres; NaN where it is not known."""
        return self.covariances.read()[self.rows]

    def __len__(self) -> int:
        """Count the survivors."""
        return len(self.joints)

    @staticmethod
    def of(merged: Merged, known: NDArray[np.bool_]) -> RefinedSurvivors:
        """Take what was merged; joints that are not `known` (of all leaves) become NaN."""
        order = np.argsort(merged.rows)
        unknown = ~known[merged.rows[order]]
        chosen = merged.refined.select(order)
        joints = chosen.joints.copy()
        joints[unknown] = np.nan
        count = np.bincount(merged.group[merged.group >= 0], minlength=len(order))[order]
        return RefinedSurvivors(
            joints=joints,
            head=chosen.head.copy(),
            chi2=chosen.chi2.copy(),
            dof=chosen.dof.copy(),
            p=chosen.p.copy(),
            merged=count - 1,
            size=np.ones(len(order)) if chosen.size is None else chosen.size.factor.copy(),
            size_deviation=np.zeros(len(order)) if chosen.size is None else chosen.size.deviation.copy(),
            covariances=Covariances(chosen, unknown),
            rows=ALL_ROWS,
        )

    @staticmethod
    def joined(parts: Sequence[RefinedSurvivors]) -> RefinedSurvivors:
        """Put those of one part behind those of the last, each of them whole."""
        arrays: dict[str, Any] = {
            name: np.concatenate([getattr(part, name) for part in parts]) for name in SURVIVOR_ARRAYS
        }
        covariances = Covariances.joined([part.covariances for part in parts])
        return RefinedSurvivors(**arrays, covariances=covariances, rows=ALL_ROWS)

    def part(self, rows: slice) -> RefinedSurvivors:
        """Return some of them, one after the other."""
        own = range(*self.rows.indices(len(self.covariances)))[rows]
        arrays: dict[str, Any] = {name: getattr(self, name)[rows] for name in SURVIVOR_ARRAYS}
        return RefinedSurvivors(
            **arrays,
            covariances=self.covariances,
            rows=slice(own.start, max(own.stop, own.start)),
        )
