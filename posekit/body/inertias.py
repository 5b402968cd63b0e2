"""What each part of the body weighs, where its centre of mass is, and how hard it is to turn.

Masses, centres and radii of gyration are de Leva 1996, "Adjustments to Zatsiorsky-Seluyanov's segment inertia
parameters", J Biomech 29:1223, Table 4, means of women and men: fractions of the body's mass and of a segment's
length. The trunk is that from the cervicale to the middle of the hips, the shank that to the ankle's centre. What has
no segment in the figure is said in the length of one that it has: head and trunk in that from the neck to the middle
of the hips, the hand in the forearm's, the foot, which is put into the ankle, in the shank's. Below the navel the
trunk moves with the hips; what is left of the whole trunk's moments, by Steiner's theorem, is that of the torso.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.body.lengths import hips_points
from posekit.body.stature import stature_from_lengths
from posekit.geometry import Array
from posekit.skeleton import SIDES

MASS_OF_STATURE_SQUARED: Final = 22.33
"""kg/m^2: the mean mass of de Leva's women and men (61.9 and 73 kg) over their mean stature (1.735 and 1.741 m)
squared."""

TURNED_MASS, TURNED_MOMENT = 1e-3, 1e-6
"""kg, kg m^2: of a link that only joins two axes of one joint: it has no mass, but simulators refuse links of none."""


@dataclass(frozen=True, kw_only=True)
class SegmentMass:
    """What de Leva's table says of a part of the body.

    Parameters
    ----------
    mass : float
        Fraction of the body's mass.
    along : float
        How far along its line, from the end nearer to the trunk, its centre is: fraction of the line's length.
    gyration : tuple of float
        Radii of gyration about the axes that point forward, to the left, and up in a standing body with hanging arms:
        fractions of the line's length.
    """

    mass: float
    along: float
    gyration: tuple[float, float, float]


TRUNK_PARTS: Final = {
    "head": SegmentMass(mass=0.0681, along=-0.203, gyration=(0.1146, 0.1218, 0.1043)),
    "torso": SegmentMass(mass=0.31195, along=0.3640, gyration=(0.2433, 0.2116, 0.1653)),
    "hips": SegmentMass(mass=0.1182, along=0.8781, gyration=(0.1382, 0.1259, 0.1364)),
}
"""By link, on the line from the neck to the middle of the hips. The torso is the trunk above the navel, the hips that
below it."""

LIMB_PARTS: Final = {
    "upper_arm": SegmentMass(mass=0.0263, along=0.5763, gyration=(0.2815, 0.2645, 0.1530)),
    "forearm": SegmentMass(mass=0.0150, along=0.4567, gyration=(0.2685, 0.2610, 0.1075)),
    "wrist": SegmentMass(mass=0.00585, along=1.237, gyration=(0.1792, 0.1493, 0.1138)),
    "thigh": SegmentMass(mass=0.1447, along=0.3854, gyration=(0.3490, 0.3465, 0.1555)),
    "shank": SegmentMass(mass=0.0457, along=0.4374, gyration=(0.2590, 0.2545, 0.0970)),
    "ankle": SegmentMass(mass=0.0133, along=1.0, gyration=(0.0725, 0.1531, 0.1444)),
}
"""By link, without its side; the links of wrist and ankle carry hand and foot, on the lines of forearm and shank."""

LINE_OF_LIMB: Final = {
    "upper_arm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
    "wrist": ("elbow", "wrist"),
    "thigh": ("hip", "knee"),
    "shank": ("knee", "ankle"),
    "ankle": ("knee", "ankle"),
}


def inertias(lengths: Mapping[str, float]) -> dict[str, tuple[float, Array, Array]]:
    """Return mass, centre and principal moments of each link that is a part of the body.

    Parameters
    ----------
    lengths : mapping
        The 17 lengths, metres. Mass grows with the square of the stature that the limbs have.

    Returns
    -------
    dict
        By link: kg; its centre, metres, and the moments about it, kg m^2, (3,) each, along the link's axes (x forward,
        y left, z up).
    """
    body = MASS_OF_STATURE_SQUARED * stature_from_lengths(lengths) ** 2
    to_pelvis = lengths["neck-pelvis"]
    trunk = to_pelvis - float(hips_points(lengths)[1, 2])
    lines = {name: (part, trunk, to_pelvis if name == "hips" else 0.0) for name, part in TRUNK_PARTS.items()}
    for side in SIDES:
        for name, part in LIMB_PARTS.items():
            start, end = LINE_OF_LIMB[name]
            length = lengths[f"{side}_{start}-{side}_{end}"]
            lines[f"{side}_{name}"] = (part, length, length if name == end else 0.0)
    return {
        name: (
            body * part.mass,
            np.array([0.0, 0.0, origin - part.along * length]),
            body * part.mass * (np.array(part.gyration) * length) ** 2,
        )
        for name, (part, length, origin) in lines.items()
    }
