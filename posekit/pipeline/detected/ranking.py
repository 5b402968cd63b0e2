"""The order of survivors by how well their lengths agree with the person's."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.skeleton import RIGID_SEGMENTS, segment_name


def rank_by_fit(joints: Array, length_residual: Array, lengths: Mapping[str, float]) -> NDArray[np.intp]:
    """Order survivors, the one that disagrees least with the person's lengths first.

    What counts is the sum of squares of the four distances inside torso and hips, which lift nothing, and of the
    length that was lost to a tangent ray: the only evidence that one picture has. Equals stay in their order.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Metres; NaN where not known.
    length_residual : array (N,)
        Metres.
    lengths : mapping
        The person's, by segment name, metres.

    Returns
    -------
    int array (N,)
        Indices, the best first.
    """
    ends = np.array(RIGID_SEGMENTS)
    apart = np.linalg.norm(joints[:, ends[:, 0]] - joints[:, ends[:, 1]], axis=-1)
    off = apart - [lengths[segment_name(segment)] for segment in RIGID_SEGMENTS]
    misfit = np.nansum(off**2, axis=1) + np.nan_to_num(length_residual) ** 2
    return np.argsort(misfit, kind="stable")
