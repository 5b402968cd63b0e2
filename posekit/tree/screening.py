"""Many postures screened by one rule."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import check_kernels, frame_kernels
from posekit.compiled.compiling import compiled
from posekit.compiled.frame_kernels import NUMBERS_AT
from posekit.geometry import Array
from posekit.tree.check import Rule


def screened(rule: Rule, points: Array) -> tuple[NDArray[np.int8], Array | None]:
    """Tell what is clear in postures.

    Parameters
    ----------
    rule : Rule
        The compiled form of a check.
    points : array (N, P, 3)
        The check's own points, metres.

    Returns
    -------
    places : int array (N,)
        The first place violated, `posekit.compiled.verdicts.NO_VIOLATION` or `NOT_CLEAR`.
    presumed : array (M, W) or None
        Of every place violated what is to be confirmed (`posekit.tree.Check.confirm`); None where nothing is presumed.
    """
    places = np.empty(len(points), dtype=np.int8)
    presumed = np.empty((len(points), rule.presumed))
    w = np.concatenate([np.zeros(NUMBERS_AT), rule.numbers])
    count = compiled(frame_kernels, check_kernels).screens(
        rule.kind, np.ascontiguousarray(points), w, places, presumed
    )
    return places, presumed[:count] if rule.presumed else None
