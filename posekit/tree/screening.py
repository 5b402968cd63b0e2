"""Many postures screened by some rules."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import check_kernels, frame_kernels
from posekit.compiled.compiling import compiled
from posekit.compiled.frame_kernels import MAX_POINTS, NUMBERS_AT
from posekit.geometry import Array
from posekit.tree.check import Rule


def screened(
    rules: Sequence[Rule], of: Sequence[Sequence[int]], points: Array, *, presuming: bool = False
) -> tuple[NDArray[np.int8], Array]:
    """Tell what is clear in postures.

    Parameters
    ----------
    rules : sequence of C Rule
        The compiled forms of checks.
    of : sequence of C sequences
        The points that each reads.
    points : array (N, P, 3)
        Postures, metres.
    presuming : bool
        Whether what is to be confirmed is asked for: then all rules presume as many numbers.

    Returns
    -------
    places : int array (N, C)
        The first place violated, `posekit.compiled.verdicts.NO_VIOLATION` or `NOT_CLEAR`.
    presumed : array (M, W)
        Of every place violated what is to be confirmed (`posekit.tree.Check.confirm`).
    """
    numbers = [rule.numbers for rule in rules]
    begins = np.cumsum([NUMBERS_AT, *map(len, numbers)])[:-1]
    kinds = np.array([rule.kind for rule in rules], dtype=np.int64)
    read = np.full((len(rules), MAX_POINTS), -1)
    for row, each in zip(read, of, strict=True):
        row[: len(each)] = each
    places = np.empty((len(points), len(rules)), dtype=np.int8)
    presumed = np.empty((places.size, rules[0].presumed) if presuming else (0, 0))
    count = compiled(frame_kernels, check_kernels).screens(
        np.stack([kinds, begins], axis=1),
        read,
        np.ascontiguousarray(points),
        np.concatenate([np.zeros(NUMBERS_AT), *numbers]),
        places,
        presumed,
    )
    return places, presumed[:count]
