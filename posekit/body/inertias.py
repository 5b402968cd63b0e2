"""Mass, centre of mass and moments of inertia of each link of the body.

Masses, centres of mass and radii of gyration are from de Leva 1996, "Adjustments to Zatsiorsky-Seluyanov's segment
inertia parameters", J Biomech 29:1223, Table 4. The values are means of women and men, as fractions of body mass and
segment length. In this table, the trunk extends from the seventh cervical vertebra to the middle of the hips, and the
shank ends at the centre of the ankle. Body parts that are not segments of the figure use another length. Head and trunk
use the distance from the neck to the middle of the hips. The hand uses the forearm's length. The foot, placed at the
ankle, uses the shank's length. The trunk below the navel belongs to the hips link. The torso link has the moments of
the whole trunk minus the moments of the lower trunk (Steiner's theorem).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from posekit.body.lengths import hips_points, stature_from_lengths
from posekit.geometry import Array
from posekit.skeleton import SIDES

#: Body mass divided by squared stature, kg/m^2: mean mass of de Leva's women and men (61.9 and 73 kg) over their mean
#: stature (1.735 and 1.741 m) squared.
MASS_OF_STATURE_SQUARED: Final = 22.33

#: Head and trunk by link: mass, as a fraction of body mass; position of the centre of mass on the line from the neck to
#: the middle of the hips, as a fraction of the line's length; radii of gyration about the forward, left and upward axes
#: of a standing body with hanging arms, as fractions of that length. The torso is the trunk above the navel, the hips
#: the trunk below it.
TRUNK_PARTS: Final = {
    "head": (0.0681, -0.203, (0.1146, 0.1218, 0.1043)),
    "torso": (0.31195, 0.3640, (0.2433, 0.2116, 0.1653)),
    "hips": (0.1182, 0.8781, (0.1382, 0.1259, 0.1364)),
}

#: The same values for limbs, by link, start joint and end joint of the line, without the side. The links "wrist" and
#: "ankle" are hand and foot.
LIMB_PARTS: Final = {
    ("upper_arm", "shoulder", "elbow"): (0.0263, 0.5763, (0.2815, 0.2645, 0.1530)),
    ("forearm", "elbow", "wrist"): (0.0150, 0.4567, (0.2685, 0.2610, 0.1075)),
    ("wrist", "elbow", "wrist"): (0.00585, 1.237, (0.1792, 0.1493, 0.1138)),
    ("thigh", "hip", "knee"): (0.1447, 0.3854, (0.3490, 0.3465, 0.1555)),
    ("shank", "knee", "ankle"): (0.0457, 0.4374, (0.2590, 0.2545, 0.0970)),
    ("ankle", "knee", "ankle"): (0.0133, 1.0, (0.0725, 0.1531, 0.1444)),
}


def inertias(lengths: Mapping[str, float]) -> dict[str, tuple[float, Array, Array]]:
    """Return mass, centre of mass and principal moments of inertia of each link.

    Parameters
    ----------
    lengths : mapping
        The 17 lengths, metres. Body mass is proportional to the square of the stature that is estimated from the limbs.

    Returns
    -------
    dict
        By link name: mass, kg; centre of mass (3,), metres; moments about the centre of mass (3,), kg m^2. Axes are the
        link's: x forward, y left, z up.
    """
    body = MASS_OF_STATURE_SQUARED * stature_from_lengths(lengths) ** 2
    to_pelvis = lengths["neck-pelvis"]
    trunk = to_pelvis - float(hips_points(lengths)[1, 2])
    lines = {name: (part, trunk, to_pelvis if name == "hips" else 0.0) for name, part in TRUNK_PARTS.items()}
    for side in SIDES:
        for (name, start, end), part in LIMB_PARTS.items():
            length = lengths[f"{side}_{start}-{side}_{end}"]
            lines[f"{side}_{name}"] = (part, length, length if name == end else 0.0)
    return {
        name: (
            body * mass,
            np.array([0.0, 0.0, origin - along * length]),
            body * mass * (np.array(gyration) * length) ** 2,
        )
        for name, ((mass, along, gyration), length, origin) in lines.items()
    }
