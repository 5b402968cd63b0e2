r"""Standing: how far the centre of mass is from over the feet, and how level the feet are.

Of one picture the ground's height is not known. What is: whoever stands, stands on the lower foot, and on both where
both are low. The support is the line from the lower ankle towards the other, as much of it as the other is low:
:math:`e^{-h^2 / 2 (10 cm)^2}` of its length, h its height above the lower. (`posekit.validators.robot.balance` judges
soles, which the figure does not have.)
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array, dot, perpendicular
from posekit.ranking.centre_of_mass import centre_of_mass
from posekit.skeleton import JOINT

SUPPORT_HEIGHT_METRES: Final = 0.10
"""Metres above the lower ankle at which the other carries little any more."""


def standing(joints: Array, up: Array) -> tuple[Array, Array]:
    """Measure how postures stand.

    Parameters
    ----------
    joints : array (14, 3, N)
        Metres; NaN where a joint is not known.
    up : array (3, N) or (3, 1)
        Unit vectors against gravity, in the same frame.

    Returns
    -------
    off : array (N,)
        How far the centre of mass is from over the support, metres.
    apart : array (N,)
        How much one ankle is higher than the other, metres. Both are NaN where the joints do not tell.
    """
    right, left = joints[JOINT["right_ankle"]], joints[JOINT["left_ankle"]]
    rise = dot(left - right, up, axis=-2)
    apart = np.abs(rise)
    lower = np.where(rise >= 0, right, left)
    support = perpendicular(np.where(rise >= 0, left - right, right - left), up, axis=-2) * np.exp(
        -0.5 * (apart / SUPPORT_HEIGHT_METRES) ** 2
    )
    centre = perpendicular(centre_of_mass(joints) - lower, up, axis=-2)
    along = dot(centre, support, axis=-2) / np.maximum(dot(support, support, axis=-2), 1e-12)
    # The support is a line from the lower foot: the nearest point of it to the centre of mass.
    beside = centre - np.clip(along, 0.0, 1.0) * support
    return np.sqrt(dot(beside, beside, axis=-2)), apart
