"""Joints of refined postures that were not seen: the regions in which their covariances leave them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own import Inferred
from posekit.skeleton import JOINTS

if TYPE_CHECKING:
    from posekit.recovery.refined import RefinedSurvivors

WITHIN_DEVIATIONS: Final = 2.8
"""Standard deviations within which a point of three dimensions is with 95 %: the root of chi-square's 7.81."""


def untold_regions(refined: RefinedSurvivors, untold: NDArray[np.bool_]) -> list[dict[str, Inferred]]:
    """Describe the joints of N survivors that are not told (N, 14): the boxes about their 95 % ellipsoids."""
    if not untold.any():
        return [{} for _ in untold]
    covariance = refined.covariance
    found: list[dict[str, Inferred]] = []
    for row, joints in enumerate(untold):
        regions = {}
        for joint in np.flatnonzero(joints).tolist():
            at, spread = refined.joints[row, joint], covariance[row, joint]
            if not (np.isfinite(at).all() and np.isfinite(spread).all()):
                continue
            reach = WITHIN_DEVIATIONS * np.sqrt(np.diag(spread))
            radius = WITHIN_DEVIATIONS * float(np.sqrt(np.linalg.eigvalsh(spread)[-1]))
            regions[JOINTS[joint]] = Inferred(
                kind="region", lower=at - reach, upper=at + reach, radius=radius
            )
        found.append(regions)
    return found
