r"""Balance of a standing person: distance of the centre of mass from the base of support, and height of the ankles.

One picture does not show the height of the ground. The lower foot supports a standing person; if both feet have almost
the same height, both support the person. The base of support is a line from the lower ankle towards the higher ankle,
shortened by the factor :math:`e^{-h^2 / 2 (10 cm)^2}`, with h the height difference of the ankles.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array, dot, perpendicular
from posekit.skeleton import JOINT, SIDES

#: Length scale of the height difference at which the higher ankle stops supporting the body, metres.
SUPPORT_HEIGHT_METRES: Final = 0.10

TRUNK_MASS: Final = 0.0681 + 0.31195 + 0.1182
#: Head, torso and hips: share of the body's mass, and share times distance along the line from neck to mid-hips, as a
#: fraction of that line (de Leva 1996, J Biomech 29:1223, Table 4, means of women and men).
TRUNK_MOMENT: Final = 0.0681 * -0.203 + 0.31195 * 0.3640 + 0.1182 * 0.8781

#: Upper arm, forearm, hand, thigh, shank, foot: line, share of the body's mass, centre along the line (same table).
LIMB_MASSES: Final = (
    ("shoulder", "elbow", 0.0263, 0.5763),
    ("elbow", "wrist", 0.0150, 0.4567),
    ("elbow", "wrist", 0.00585, 1.237),
    ("hip", "knee", 0.1447, 0.3854),
    ("knee", "ankle", 0.0457, 0.4374),
    ("knee", "ankle", 0.0133, 1.0),
)


def centre_of_mass(joints: Array) -> Array:
    """Return the centre of mass (N, 3) of postures (N, 14, 3).

    Limb segments with an unknown end are omitted. The result is NaN if the neck or a hip is unknown.
    """
    neck = joints[:, JOINT["neck"]]
    down = joints[:, [JOINT["right_hip"], JOINT["left_hip"]]].mean(axis=1) - neck
    total = TRUNK_MASS * neck + TRUNK_MOMENT * down
    mass = np.full(len(joints), TRUNK_MASS)
    for side in SIDES:
        for start, end, share, along in LIMB_MASSES:
            a, b = joints[:, JOINT[f"{side}_{start}"]], joints[:, JOINT[f"{side}_{end}"]]
            part = share * ((1 - along) * a + along * b)
            known = np.asarray(np.isfinite(part).all(axis=1))
            total = total + np.where(known[:, None], part, 0.0)
            mass += share * known
    return np.asarray(total / mass[:, None])


def standing(joints: Array, up: Array) -> tuple[Array, Array]:
    """Return the distance of the centre of mass from the base of support, and the height difference of the ankles.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Metres; NaN where a joint is not known.
    up : array (3,)
        Unit vector against gravity, in the same frame.

    Returns
    -------
    off : array (N,)
        Horizontal distance of the centre of mass from the base of support, metres; NaN if neck, a hip or an ankle is
        unknown.
    apart : array (N,)
        Height of one ankle above the other, metres; NaN if an ankle is unknown.
    """
    right, left = joints[:, JOINT["right_ankle"]], joints[:, JOINT["left_ankle"]]
    rise = dot(left - right, up)
    apart = np.abs(rise)
    higher = np.asarray(rise >= 0)[:, None]
    lower = np.where(higher, right, left)
    fade = np.exp(-0.5 * (apart / SUPPORT_HEIGHT_METRES) ** 2)
    support = perpendicular(np.where(higher, left - right, right - left), up) * fade[:, None]
    centre = perpendicular(centre_of_mass(joints) - lower, up)
    along = dot(centre, support) / np.maximum(dot(support, support), 1e-12)
    beside = centre - np.clip(along, 0.0, 1.0)[:, None] * support
    return np.sqrt(dot(beside, beside)), apart
