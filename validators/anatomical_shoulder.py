r"""The shoulder's elevation, its plane and the arm's turn: angles of the arm without the poles of its three turns.

An arm stretched out sideways stands at a pole of flexion, abduction, rotation: flexion and rotation then say nothing
alone, and a box of limits lets the arm turn about itself by nearly anything. Ranges of axial rotation are published at
stated elevations, so they are judged by elevation:

- *elevation* :math:`e`, from the arm's hanging direction;
- *plane* :math:`p`, in which it is raised: 0 forward, 90 sideways, 180 backward;
- *turn* :math:`t = \tau - (1 - \cos e)(90^\circ - p)`, internal positive. :math:`\tau` is the twist of the swing-twist
  decomposition (the rotation about the arm that is left after the shortest swing from hanging). The second term is the
  rotation that an arm gathers when it is carried around the vertical at constant elevation without turning about
  itself, counted from the frontal plane. There, and with the arm at the side, the turn is the angle that a goniometer
  reads: zero with the forearm forward.

The turn has no pole: at :math:`e = 180^\circ`, where plane and twist mean nothing alone, their combination does. It has
a seam, as any such angle must, since an arm carried all the way around gathers a rotation: the seam is behind the
back, on the other arm's side (`SEAM_DEGREES`), where an arm hardly gets.
"""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array

SEAM_DEGREES = -115.0
"""Degrees of the plane at which the turn is cut."""


def elevation_and_plane(flexion: Array, abduction: Array) -> tuple[Array, Array]:
    """Return elevation and plane (deg) of an arm's direction from its first two angles (deg)."""
    a, b = np.radians(flexion), np.radians(abduction)
    forward, outward, down = np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b)
    elevation = np.arctan2(np.hypot(forward, outward), down)
    return np.degrees(elevation), np.degrees(np.arctan2(outward, forward))


def turn_offset(flexion: Array, abduction: Array) -> Array:
    r"""Return the turn (deg) of an arm whose rotation is zero; any rotation adds to it, up to full turns.

    The twist of :math:`R_y(\alpha) R_x(\beta)` is
    :math:`-2\operatorname{atan2}(\sin\frac\alpha2\sin\frac\beta2, \cos\frac\alpha2\cos\frac\beta2)`.
    """
    a, b = np.radians(flexion) / 2, np.radians(abduction) / 2
    twist = -2 * np.degrees(np.arctan2(np.sin(a) * np.sin(b), np.cos(a) * np.cos(b)))
    elevation, plane = elevation_and_plane(flexion, abduction)
    from_side = 90.0 - np.where(plane < SEAM_DEGREES, plane + 360.0, plane)
    return np.asarray(twist - (1 - np.cos(np.radians(elevation))) * from_side)
