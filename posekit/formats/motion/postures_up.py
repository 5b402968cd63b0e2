"""Which way is up, where a file does not say: people stand, and are taller than they are wide."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.errors import InputError
from posekit.formats.motion.motion import UP_DIRECTIONS
from posekit.geometry import Array
from posekit.skeleton import JOINT

CLEAR_UP_SHARE: Final = 0.7
"""What one axis must have of the mean way from ankles to neck: beyond 45 degrees it is nearer to no other axis."""


def guess_up(joints: Array, source: str = "motion") -> str:
    """Guess the axis along which necks lie above ankles, over all frames.

    Parameters
    ----------
    joints : array (T, 14, 3)
        In tree order, metres.
    source : str
        What to call it in errors.

    Returns
    -------
    str
        ``+x`` … ``-z``.

    Raises
    ------
    InputError
        Where no frame has a neck and both ankles, or people are not upright along an axis: then it is to be stated.
    """
    ankles = joints[:, [JOINT["right_ankle"], JOINT["left_ankle"]]].mean(axis=1)
    way = joints[:, JOINT["neck"]] - ankles
    way = way[np.isfinite(way).all(axis=1)]
    length = np.linalg.norm(way, axis=1)
    mean = (way[length > 0] / length[length > 0, None]).mean(axis=0) if (length > 0).any() else np.zeros(3)
    axis = int(np.argmax(np.abs(mean)))
    if abs(mean[axis]) < CLEAR_UP_SHARE:
        raise InputError(
            f"{source}: the file does not say which way is up, and nobody in it stands along an axis (the way from "
            f"ankles to neck is {mean.round(2).tolist()}); state it: {', '.join(UP_DIRECTIONS)}"
        )
    return f"{'+' if mean[axis] > 0 else '-'}{'xyz'[axis]}"
