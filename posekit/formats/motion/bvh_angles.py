r"""Three angles for a rotation, in the order x, z, y, and their continuity along time.

:math:`R = R_x(a) R_z(b) R_y(c)`, each about the axes that the one before has turned. The same rotation has the angles
:math:`(a + \pi, \pi - b, c + \pi)` too, and full turns more; at :math:`b = \pm\pi/2` only :math:`c \mp a` counts.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array, coordinate_rotation, other_branch, turned_near

AXIS_ORDER: Final = (0, 2, 1)
"""The axes of the three angles."""
LOCKED_COSINE: Final = 1e-9
"""Cosine of the middle angle below which the first may be any: choosing it turns the rotation by less than that."""


def euler_rotation(angles: Array) -> Array:
    """Return the rotations (..., 3, 3) of angles (..., 3), radians, in the order of `AXIS_ORDER`."""
    x, z, y = (coordinate_rotation(axis, angles[..., k]) for k, axis in enumerate(AXIS_ORDER))
    return x @ z @ y


def euler_angles(R: Array) -> Array:
    """Return the angles (..., 3) of rotations (..., 3, 3), radians; the middle one within a quarter turn.

    The first is taken out of the rotation before the last is read: where the middle one is a quarter turn the first is
    any, and the last makes up for it.
    """
    a = np.arctan2(R[..., 2, 1], R[..., 1, 1])
    cosine, sine = np.cos(a), np.sin(a)
    up = cosine * R[..., 1, 1] + sine * R[..., 2, 1]
    b = np.arctan2(-R[..., 0, 1], up)
    c = np.arctan2(sine * R[..., 1, 0] - cosine * R[..., 2, 0], cosine * R[..., 2, 2] - sine * R[..., 1, 2])
    return np.stack([a, b, c], axis=-1)


def continuous(angles: Array) -> Array:
    """Choose among the angles of the same rotations those that jump least from frame to frame.

    Parameters
    ----------
    angles : array (T, J, 3)
        Radians.

    Returns
    -------
    array (T, J, 3)
        The same rotations. The first frame stays; no step is a full turn, and none goes to the other branch.
    """
    angles = np.array(angles, dtype=np.float64)
    if len(angles) < 2:
        return angles
    _hold_locked(angles)
    # A frame's branch against the one before is the same for both branches of that one: parity adds up.
    step = turned_near(np.diff(angles, axis=0), 0.0)
    other = turned_near(other_branch(angles[1:]) - angles[:-1], 0.0)
    turns = (other**2).sum(axis=-1) < (step**2).sum(axis=-1)
    odd = np.zeros(angles.shape[:2], dtype=bool)
    odd[1:] = np.cumsum(turns, axis=0) % 2 == 1
    angles[odd] = other_branch(angles[odd])
    return np.unwrap(angles, axis=0)


def _hold_locked(angles: Array) -> None:
    """Where the first angle may be any, keep that of the frame before; the last makes up for it."""
    locked = np.abs(np.cos(angles[..., 1])) < LOCKED_COSINE
    if not locked.any():
        return
    frame = np.where(locked, 0, np.arange(len(angles))[:, None])
    last = np.maximum.accumulate(frame, axis=0)
    held = np.take_along_axis(angles[..., 0], last, axis=0)
    angles[..., 2] += np.where(locked, np.sin(angles[..., 1]) * (held - angles[..., 0]), 0.0)
    angles[..., 0] = np.where(locked, held, angles[..., 0])
