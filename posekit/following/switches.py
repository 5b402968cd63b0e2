r"""Near and far along a path: where a segment's end changes from one side to the other.

A segment's end is at one of the two places where its ray meets the sphere around the segment's start; between them lies
the tangent, where the segment is at a right angle to the ray. To change sides it has to pass through that plane: to
turn by at least :math:`|\varphi_1| + |\varphi_2|`, the angles at which it stands to the plane before and after. In the
time between two frames it can turn by so much and no more (`MotionModel.max_swing`): where it lies nearly in the plane
it passes, where it stands well out of it it cannot.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.following.channels import SEGMENT_ENDS, SEGMENT_STARTS, directions
from posekit.geometry import Array
from posekit.skeleton import SEGMENT_NAMES


class Switch(NamedTuple):
    """A change of sides.

    Attributes
    ----------
    frame : int
        The frame after it.
    segment : str
        Its name, ``a-b``.
    far : bool
        Whether it changed to far.
    angle : float
        The least angle that it had to turn by, degrees.
    speed : float
        The speed at which it would have done so, radians a second.
    """

    frame: int
    segment: str
    far: bool
    angle: float
    speed: float


def elevations(joints: Array, *, perspective: bool = True) -> Array:
    """Return how far segments stand out of the plane across the ray of their end.

    Parameters
    ----------
    joints : array (..., 14, 3)
        Camera frame, metres.
    perspective : bool
        Whether rays come together in the camera; otherwise all go along z.

    Returns
    -------
    array (..., 13)
        Radians: positive away from the camera, far, and negative towards it, near. NaN where not known.
    """
    unit, _ = directions(joints)
    if not perspective:  # all rays go along z
        return np.asarray(np.arcsin(np.clip(unit[..., 2], -1, 1)))
    end = joints[..., SEGMENT_ENDS, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        ray = end / np.linalg.norm(end, axis=-1, keepdims=True)
    return np.asarray(np.arcsin(np.clip((unit * ray).sum(axis=-1), -1, 1)))


def switches_of(
    time: Array, joints: Array, seen: NDArray[np.bool_], *, perspective: bool = True
) -> tuple[Switch, ...]:
    """List the changes of sides along a path (T, 14, 3), frame by frame.

    A segment changes from one frame that shows both its ends to the next that does: `seen` (T, 14) says which do.
    """
    level = elevations(joints, perspective=perspective)
    shown = seen[:, SEGMENT_STARTS] & seen[:, SEGMENT_ENDS]
    found = []
    for segment in range(level.shape[1]):
        frames = np.flatnonzero(shown[:, segment])
        side = level[frames, segment]
        with np.errstate(invalid="ignore"):
            changed = np.flatnonzero(side[1:] * side[:-1] < 0)
        for k in changed.tolist():
            angle = float(abs(side[k]) + abs(side[k + 1]))
            found.append(
                Switch(
                    frame=int(frames[k + 1]),
                    segment=SEGMENT_NAMES[segment],
                    far=bool(side[k + 1] > 0),
                    angle=float(np.degrees(angle)),
                    speed=angle / float(time[frames[k + 1]] - time[frames[k]]),
                )
            )
    return tuple(sorted(found, key=lambda one: one.frame))
