"""Legal postures of consecutive frames, whose changes are tied to each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.remedy.postures import nearest_valid
from posekit.tree import Check

TIE_WEIGHT: Final = 1.0
"""Of the squared difference between the changes of neighbouring frames, beside that of the change itself."""

TIED_SWEEPS: Final = 3
"""How often each frame is sought again with the changes of its neighbours."""


def tied_postures(points: Array, bad: NDArray[np.intp], suite: Sequence[Check], weight: Array) -> Array:
    r"""Find legal postures of some frames (T, 19, 3) whose changes are alike in neighbouring frames.

    With changes :math:`\delta_t`, :math:`|\delta_t|^2 + \mu |\delta_t - \delta_{t-1}|^2 + \mu |\delta_t -
    \delta_{t+1}|^2` is least where a frame is sought near its own posture moved by
    :math:`\mu (\delta_{t-1} + \delta_{t+1}) / (1 + 2 \mu)`. Frames that are legal stay, with no change.
    """
    out = points.copy()
    out[bad] = nearest_valid(points[bad], suite, weight[bad])
    inside = np.zeros(len(points), dtype=np.bool_)
    inside[bad] = True
    tied = bad[(np.r_[False, inside[:-1]] | np.r_[inside[1:], False])[bad]]
    for _ in range(TIED_SWEEPS if tied.size else 0):
        change = np.nan_to_num(out - points)
        around = np.zeros_like(change)
        around[1:] += change[:-1]
        around[:-1] += change[1:]
        aim = points[tied] + TIE_WEIGHT / (1 + 2 * TIE_WEIGHT) * around[tied]
        out[tied] = nearest_valid(aim, suite, weight[tied], start=out[tied])
    return out
