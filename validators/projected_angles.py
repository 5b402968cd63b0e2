"""The angles of Lee & Chen 1985, §3.2.A, as printed: projections onto the planes of the torso's frame.

That frame has x forward, y down and z left. Where the print and the anatomy disagree (the knee's sign) or the print is
silent (a projection without direction), what holds is said at the angle. Where a limb passes the normal of a plane its
projection turns over, and the angle jumps: `posekit.validators.rotation_angles` has angles that do not.
"""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array, cross, dot

ROUNDING_DEGREES = 1e-3
"""Degrees within which -180 is taken for 180."""


def angle_in_plane(x: Array, y: Array, shortest: Array | float, tolerance: float = ROUNDING_DEGREES) -> Array:
    """Return the angle (deg) from the y axis towards x, NaN where the projection (x, y) is too short.

    In (-180, 180], and up to the tolerance (deg) beyond: an arm straight up is flexed by 180, on whichever side
    of it rounding or noise leaves the arm.
    """
    angle = np.degrees(np.arctan2(x, y))
    angle = np.where(angle < max(tolerance, ROUNDING_DEGREES) - 180, angle + 360, angle)
    return np.where(np.hypot(x, y) < shortest, np.nan, angle)


def projected_ball(u: Array, outward: float, shortest: float, tolerance: float) -> Array:
    """Return flexion and abduction (N, 2), deg, of upper segments (N, 3) (§3.2.A i).

    Flexion is the angle from y to the projection on xy, towards x; abduction the one on yz, away from the body, which
    is along z where `outward` is 1 and against it where that is -1. Either is undecided where its projection is shorter
    than a part of the segment: an arm held straight forward has no abduction.
    """
    least = shortest * np.linalg.norm(u, axis=1)
    return np.stack(
        [angle_in_plane(across, u[:, 1], least, tolerance) for across in (u[:, 0], outward * u[:, 2])],
        axis=-1,
    )


def projected_hinge(u: Array, v: Array, forward: float, tolerance: float) -> Array:
    r"""Return the angle between upper and lower segments (N, 3), deg, signed (N,) (§3.2.A ii).

    Elbow flexion has :math:`(v \times u)_z \ge 0`. The paper says the knee's is "similarly defined"; a shank bends
    backward, so its sign is the opposite: `forward` is 1 for an elbow and -1 for a knee.
    """
    w = cross(v, u)
    size = np.linalg.norm(w, axis=1)
    bend = np.degrees(np.arctan2(size, dot(u, v)))
    # An arm held sideways bends its elbow about y: z is zero but for rounding, and zero is flexion.
    return np.asarray(np.where(forward * w[:, 2] >= -np.radians(tolerance) * size, bend, -bend))


def projected_plane(normal: Array, along: Array, shortest: float) -> Array:
    """Return flexion, rotation and bending (N, 3), deg, of a plane against the torso's (§3.2.A iii).

    Flexion is measured from x to the normal's projection on xy, positive where the normal rises (towards
    -y); rotation to its projection on zx, positive towards z; bending from y to the projection of `along` on
    yz, positive towards z.
    """
    return np.stack(
        [
            angle_in_plane(-normal[:, 1], normal[:, 0], shortest),
            angle_in_plane(normal[:, 2], normal[:, 0], shortest),
            angle_in_plane(along[:, 2], along[:, 1], shortest * np.linalg.norm(along, axis=1)),
        ],
        axis=-1,
    )
