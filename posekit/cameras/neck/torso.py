"""The neck's depth from the rigid torso: neck, both shoulders and the pelvis behind a known camera.

Four points determine the pose; seen from afar the torso, which is nearly flat, has two that look almost alike, tilted
towards the camera and away from it. Both are kept where the image does not tell them apart.
"""

from __future__ import annotations

import numpy as np

from posekit.body import Figure
from posekit.body.lengths import torso_points
from posekit.cameras import PinholeCamera
from posekit.cameras.neck.pose import poses
from posekit.cameras.neck.suggestion import PartSuggestion, suggest
from posekit.geometry import Array
from posekit.skeleton import JOINT, TORSO

TORSO_POINTS = [JOINT[name] for name in TORSO]


def torso_suggestion(
    camera: PinholeCamera, figure: Figure, image: Array, ray: Array, deviation: Array, offset: Array
) -> PartSuggestion:
    """Place the torso in F frames and tell the neck's distance.

    Parameters
    ----------
    image : array (F, 14, 2)
        Pixels, NaN where not seen.
    ray : array (F, 3)
        Unit vectors to the neck's image.
    deviation : array (F, 14)
        Pixels.
    offset : array (14,)
        Metres by which the joints may be elsewhere than on the figure.
    """
    torso = image[:, TORSO_POINTS]
    body = torso_points(figure.lengths, behind=figure.shoulder_offset < 0)
    placed = poses(camera, body, torso, deviation[:, TORSO_POINTS], offset[TORSO_POINTS])
    seen = np.isfinite(torso).all(axis=-1).sum(axis=1)
    return suggest("torso", placed, ray, seen, 0.0)
