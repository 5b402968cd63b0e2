"""The neck's depth from the head: eyes, ears and nose behind a known camera.

Four points or more, mostly these five, give its pose: a detector's neck is the middle of the shoulders, not rigid with
the head (`posekit.cameras.head` needs a sixth point, because it finds f too). The neck is then the head's own, where
the figure's head turns about; on a person it moves against the head by a centimetre or two when the head nods, which
`offset` of the neck allows for. Meeting the neck's ray with the sphere of the neck's distance about the head would
use its image too, but the neck mostly hangs below the head, across the line of sight: there the ray only touches that
sphere, and a pixel's error becomes centimetres of depth.
"""

from __future__ import annotations

import numpy as np

from posekit.cameras import PinholeCamera
from posekit.cameras.neck.pose import poses
from posekit.cameras.neck.suggestion import PartSuggestion, suggest
from posekit.geometry import Array


def head_suggestion(
    camera: PinholeCamera,
    head: Array,
    head_image: Array,
    ray: Array,
    deviation: Array,
    offset: Array,
    bent: float,
) -> PartSuggestion:
    """Place the head in F frames and tell the neck's distance.

    Parameters
    ----------
    head : array (P, 3)
        Points of the head from its neck, the head's frame, metres.
    head_image : array (F, P, 2)
        Pixels, NaN where not seen.
    ray : array (F, 3)
        Unit vectors to the neck's image.
    deviation : array (F, P)
        Pixels.
    offset : array (P,)
        Metres by which the head's points may be elsewhere than on the figure's head.
    bent : float
        The same for its neck.
    """
    placed = poses(camera, head, head_image, deviation, offset)
    seen = np.isfinite(head_image).all(axis=-1).sum(axis=1)
    return suggest("head", placed, ray, seen, bent)
