"""Covariances of survivors, found when they are first read: many runs never ask."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.refinement import Refined


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
