"""Many postures screened by one rule."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import frame_kernels
from posekit.compiled.compiling import compiled
from posekit.compiled.frame_kernels import NUMBERS
from posekit.geometry import Array
from posekit.tree import Rule


def screened(rule: Rule, points: Array) -> tuple[NDArray[np.int8], Array | None]:
    """Tell what is clear in postures given as a check's own points (N, P, 3); see `posekit.tree.Screened`."""
    places = np.empty(len(points), dtype=np.int8)
    presumed = np.empty((len(points), rule.presumed))
    w = np.concatenate([np.zeros(NUMBERS), rule.numbers])
    count = compiled(frame_kernels, rule.kernels).screens(
        rule.kind, np.ascontiguousarray(points), w, places, presumed
    )
    return places, presumed[:count] if rule.presumed else None
