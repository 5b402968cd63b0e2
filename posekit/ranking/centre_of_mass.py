"""Where a body's centre of mass is, from its joints and the mass of each segment.

Masses and centres are de Leva's (1996), as `posekit.body.inertias` has them. Head and hand have no segment in the
figure: the head's centre is beyond the neck by its height above the cervicale over the trunk's length, the hand's past
the wrist in the forearm's line; the foot's is put into the ankle.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.body.inertias import LIMB_PARTS, LINE_OF_LIMB, TRUNK_PARTS
from posekit.geometry import Array
from posekit.skeleton import JOINT, SIDES

TRUNK_MASS: Final = sum(part.mass for part in TRUNK_PARTS.values())
TRUNK_MOMENT: Final = sum(part.mass * part.along for part in TRUNK_PARTS.values())
"""Of head and trunk: fractions of the body's mass, and of that times the line from neck to mid-hips."""


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
    total = TRUNK_MASS * neck + TRUNK_MOMENT * down
    known = np.isfinite(joints).all()
    mass: Array | float = TRUNK_MASS
    for side in SIDES:
        for name, segment in LIMB_PARTS.items():
            upper, lower = LINE_OF_LIMB[name]
            share, along = segment.mass, segment.along
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
