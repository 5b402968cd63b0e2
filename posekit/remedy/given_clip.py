"""An array of postures over time as the clip that checks over time see."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import InputError
from posekit.formats.motion import UP_DIRECTIONS
from posekit.geometry import Array
from posekit.settings import ValidateSettings
from posekit.skeleton import JOINTS, POINTS
from posekit.validators.measured import recorded_noise
from posekit.validators.motion import MotionClip


def joints_and_head(given: Array, head: ArrayLike | None) -> tuple[Array, Array | None]:
    """Split points (N, 19, 3) into joints (N, 14, 3) and head (N, 5, 3); joints alone, or a single posture, stay."""
    points = given[None] if given.ndim == 2 else given
    own = None if head is None else np.asarray(head, dtype=np.float64)
    if head is None and points.ndim == 3 and points.shape[1] == len(POINTS):
        return points[:, : len(JOINTS)], points[:, len(JOINTS) :]
    return points, own


def clip_given(
    joints: Array, head: Array | None, rate: float | None, up: str, settings: ValidateSettings
) -> MotionClip | None:
    """Take postures for the frames of a motion where their rate is given, with noise as `posekit.validate` measures it.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Metres.
    head : array (T, 5, 3), optional
        Metres.
    rate : float, optional
        Frames a second; None for postures that are not in time.
    up : str
        The axis that points up, as ``+z``; empty where it is not known.
    settings : ValidateSettings
        Where the ground is, and how large the noise.

    Raises
    ------
    InputError
        Where `rate` or `up` is impossible, or only `up` is given.
    """
    axis = up if up in UP_DIRECTIONS else f"+{up}"
    if up and axis not in UP_DIRECTIONS:
        raise InputError(f"repair: up is {up!r}; expected one of {', '.join(UP_DIRECTIONS)}; name the axis")
    if rate is None:
        if up:
            raise InputError("repair: up is of motion; expected rate=, too; give the frames a second")
        return None
    if not 0 < rate < np.inf:
        raise InputError(f"repair: rate is {rate:g}; expected frames a second, as 30; give it so")
    others: dict[str, Any] = {} if head is None else {"head": head}
    return MotionClip(
        joints=joints,
        time=np.arange(len(joints)) / rate,
        rate=rate,
        up=UP_DIRECTIONS[axis] if up else None,
        ground=settings.ground,
        noise=recorded_noise(joints, settings),
        **others,
    )
