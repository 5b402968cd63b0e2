"""How tall a body is by its limbs, and which unit that tells: of a person, a child, or a robot like a person."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from posekit.formats.motion.motion_format import METRES_IN_UNIT
from posekit.formats.own.units import FARTHEST_COORDINATE
from posekit.geometry import Array
from posekit.safe_io import refusal
from posekit.skeleton import JOINT, SIDES

LIMB_SHARES: Final = {
    ("hip", "knee"): 0.245,
    ("knee", "ankle"): 0.246,
    ("shoulder", "elbow"): 0.186,
    ("elbow", "wrist"): 0.146,
}
"""Lengths as shares of stature: Drillis & Contini 1966, in Winter 2009, *Biomechanics and Motor Control of Human
Movement*, fig. 4.1."""
SMALLEST_METRES, TALLEST_METRES = 0.4, 2.5
"""Statures by which another unit is recognised: of a toddler or a small robot of a person's form, and of a giant."""
USUAL_METRES: Final = (1.2, 2.2)
"""Statures of nearly all who are recorded: a body of 67 is one of inches, and no toddler in centimetres."""
LEAST_METRES, MOST_METRES = 0.2, 5.0
"""Statures that are taken for metres: anything that is nearer to a body in metres than in another unit."""


class BodyUnit(NamedTuple):
    """A unit, the metres in it, and the stature that it makes of a body; NaN where no limb is known."""

    name: str
    metres: float
    stature: float


def stature_of(joints: Array) -> float:
    """Return how tall a body is by its limbs: the median limb by its share of stature.

    Parameters
    ----------
    joints : array (T, 14, 3)
        In tree order, any unit.

    Returns
    -------
    float
        In that unit; NaN where no limb is known in any frame.
    """
    found = []
    joints = np.where(np.abs(joints) < FARTHEST_COORDINATE, joints, np.nan)
    for (start, end), share in LIMB_SHARES.items():
        for side in SIDES:
            way = joints[:, JOINT[f"{side}_{end}"]] - joints[:, JOINT[f"{side}_{start}"]]
            length = np.linalg.norm(way, axis=-1)
            length = length[np.isfinite(length)]
            if len(length):
                found.append(float(np.median(length)) / share)
    return float(np.median(found)) if found else float("nan")


def body_unit(joints: Array, source: str, *, told: bool) -> BodyUnit:
    """Tell the unit by the body's size.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Metres where the unit is told, else in the unit of the file.
    source : str
        What to call it in errors.
    told : bool
        Whether the file, or its format, says the unit.

    Raises
    ------
    InputError
        Where the body is none in the unit that the file says, or fits none or two of the units.
    """
    size = stature_of(joints)
    if not (np.isfinite(size) and size > 0):
        return BodyUnit("m", 1.0, size)
    if LEAST_METRES <= size <= MOST_METRES:
        return BodyUnit("m", 1.0, size)
    usual, fitting = (
        [name for name, metres in METRES_IN_UNIT.items() if low <= size * metres <= high]
        for low, high in (USUAL_METRES, (SMALLEST_METRES, TALLEST_METRES))
    )
    fitting = usual if len(usual) == 1 else fitting
    if len(fitting) == 1 and not told:
        metres = METRES_IN_UNIT[fitting[0]]
        return BodyUnit(fitting[0], metres, size * metres)
    word = "the file's own word, by which" if told else "none, and in metres"
    expected = f"one in which it is {LEAST_METRES:g} to {MOST_METRES:g} m tall"
    likely = METRES_IN_UNIT if told or not fitting else fitting
    remedy = f"state it: {' or '.join(f'--unit {name}' for name in likely)}"
    raise refusal(source, "unit", f"{word} a body is {size:.3g} m tall", expected, remedy)
