"""Where a body's centre of mass is, from its joints and the mass of each segment.

Masses and centres are de Leva 1996, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters", J Biomech
29:1223, Table 4, means of women and men, fractions of the body's mass and of the segment's length. The trunk is that
from the cervicale to the middle of the hips, the shank that to the ankle's centre. Head and hand have no segment in the
figure: the head's centre is beyond the neck by its height above the cervicale over the trunk's length, the hand's past
the wrist in the forearm's line; the foot's is put into the ankle.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array
from posekit.skeleton import JOINT, SIDES

HEAD_MASS: Final = 0.0681
TRUNK_MASS: Final = 0.43015
"""Fractions of the body's mass."""

HEAD_ABOVE_NECK: Final = 0.203
TRUNK_BELOW_NECK: Final = 0.5051
"""Where their centres are on the line from the neck to the middle of the hips, in its lengths."""

LIMB_MASSES: Final = (
    ("shoulder", "elbow", 0.0263, 0.5763),
    ("elbow", "wrist", 0.0150, 0.4567),
    ("elbow", "wrist", 0.00585, 1.237),
    ("hip", "knee", 0.1447, 0.3854),
    ("knee", "ankle", 0.0457, 0.4374),
    ("knee", "ankle", 0.0133, 1.0),
)
"""Upper arm, forearm, hand, thigh, shank, foot: between which joints, mass, how far along its centre is."""


def centre_of_mass(joints: Array) -> Array:
    """Return the centre of mass of postures.

    Parameters
    ----------
    joints : array (14, 3, N)
        Any frame; NaN where a joint is not known: a limb's segment without one of its ends is left out.

    Returns
    -------
    array (3, N)
        NaN where neck or hips are not known.
    """
    neck = joints[JOINT["neck"]]
    down = (joints[JOINT["right_hip"]] + joints[JOINT["left_hip"]]) / 2 - neck
    total = (HEAD_MASS + TRUNK_MASS) * neck + (
        TRUNK_MASS * TRUNK_BELOW_NECK - HEAD_MASS * HEAD_ABOVE_NECK
    ) * down
    known = np.isfinite(joints).all()
    mass: Array | float = HEAD_MASS + TRUNK_MASS
    for side in SIDES:
        for upper, lower, share, along in LIMB_MASSES:
            start, end = joints[JOINT[f"{side}_{upper}"]], joints[JOINT[f"{side}_{lower}"]]
            part = share * ((1 - along) * start + along * end)
            if known:
                total += part
                mass += share
            else:
                seen = np.isfinite(part).all(axis=0)
                total += np.where(seen, part, 0.0)
                mass = mass + share * seen
    return np.asarray(total / mass)
