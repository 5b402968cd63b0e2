r"""The angles of Table 1 (Lee & Chen 1985) as rotations from standing: nothing jumps where a limb can be.

The torso's frame has x forward, y down and z left, as in §3.2.A; an angle of one kind alone is that of the print.

An upper arm u at :math:`\rho` from y is carried there from y by one shortest rotation. Its part about z is flexion, its
part about x abduction:

.. math:: (\theta, \varphi) = \frac{\rho}{\sin \rho}\,(u_x, \pm u_z), \qquad \rho = \arccos u_y

Both rows of the shoulder end at the arm straight up, 180 of flexion or 180 of abduction: there, and nowhere else, no
two angles can be continuous, whatever their definition. A thigh has the flexion of the print,
:math:`\theta = \operatorname{atan2}(u_x, u_y)`, and abduction is the angle out of the plane of flexion,
:math:`\varphi = \arcsin(\pm u_z)`: it has no flexion where it points straight sideways, which no thigh does.

Elbow and knee bend about the axis z that the upper segment takes with it, by the rotation of the shoulder or by flexion
and abduction of the hip. With v the lower segment, :math:`\psi` its angle to u, their flexion is the part about that
axis z' of the rotation from v to u, :math:`\psi\,(v \times u) \cdot z' / \sin \psi`, and the opposite at a knee.
Pelvis and neck: the parts of the rotation of the plane, about z, y and x.

What an angle's tolerance is times where the angle turns faster than its segments is returned with it.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from posekit.geometry import Array, cross, dot, perpendicular, unit, vector_from_rotation

LEAST_SINE: Final = 1e-12
"""Sine and cosine that are not divided by when smaller."""


class TurnedAngles(NamedTuple):
    """Angles (N, ...), degrees, and how many times as fast as a segment they may turn."""

    value: Array
    gain: Array


def shoulder_angles(u: Array, outward: float) -> TurnedAngles:
    """Return flexion and abduction (N, 2) of upper arms (N, 3), unit vectors; `outward` is 1 left and -1 right."""
    x, y, z = u[:, 0], u[:, 1], outward * u[:, 2]
    sine = np.hypot(x, z)
    rho = np.arctan2(sine, y)
    gain = np.maximum(rho / np.maximum(sine, LEAST_SINE), 1.0)
    raised = np.where(sine > 0, [x, z], [[1.0], [0.0]])  # straight up an arm is flexed by 180
    angles = np.degrees(rho * raised / np.where(sine > 0, sine, 1.0))
    return TurnedAngles(angles.T, np.stack([gain, gain], axis=-1))


def hip_angles(u: Array, outward: float, middle: float) -> TurnedAngles:
    """Return flexion and abduction (N, 2) of thighs (N, 3), unit vectors.

    Flexion is within 180 degrees of the middle of its range: from above it to below it is beyond both ends alike.
    """
    x, y, z = u[:, 0], u[:, 1], outward * u[:, 2]
    across = np.hypot(x, y)
    flexion = middle + np.mod(np.degrees(np.arctan2(x, y)) - middle + 180.0, 360.0) - 180.0
    abduction = np.degrees(np.arctan2(z, across))
    return TurnedAngles(
        np.stack([flexion, abduction], axis=-1),
        np.stack([1 / np.maximum(across, LEAST_SINE), np.ones_like(across)], axis=-1),
    )


def elbow_flexion(u: Array, v: Array) -> TurnedAngles:
    """Return an elbow's flexion (N,), of unit vectors along upper arm and forearm (N, 3)."""
    x, y, z = u[:, 0], u[:, 1], u[:, 2]
    # 1 + y, without cancelling near straight up: from there it grows as the square of how far the arm is away.
    top = np.where(y < 0, (x * x + z * z) / (1 - np.minimum(y, 0.0)), 1 + y)
    safe = np.maximum(top, LEAST_SINE**2)
    axis = np.stack([-x * z / safe, -z, 1 - z * z / safe], axis=-1)
    return _about(axis, u, v, np.sqrt((1 - y) / safe))


def knee_flexion(u: Array, v: Array) -> TurnedAngles:
    """Return a knee's flexion (N,), of unit vectors along thigh and shank (N, 3)."""
    across = np.maximum(np.hypot(u[:, 0], u[:, 1]), LEAST_SINE)
    axis = unit(perpendicular(np.broadcast_to([0.0, 0.0, 1.0], u.shape), u))
    return _about(-axis, u, v, np.abs(u[:, 2]) / across)


def _about(axis: Array, u: Array, v: Array, carried: Array) -> TurnedAngles:
    """Return the part about an axis of the rotation from v to u; `carried` is how fast u turns the axis."""
    w = cross(v, u)
    sine = np.linalg.norm(w, axis=1)
    bend = np.arctan2(sine, dot(u, v))
    rate = np.where(sine > LEAST_SINE, bend / np.maximum(sine, LEAST_SINE), 1.0)
    part = dot(w, axis)
    beside = np.sqrt(np.maximum(sine * sine - part * part, 0.0))
    share = beside / np.maximum(sine, LEAST_SINE)
    gain = 1 + (rate - 1) * share + rate * beside * carried
    return TurnedAngles(np.degrees(rate * part), gain)


def plane_angles(normal: Array, along: Array) -> Array:
    """Return flexion, rotation and bending (N, 3), deg, of planes by unit normal and a direction in each (N, 3).

    Signs are those of `posekit.validators.projected_angles.projected_plane`.
    """
    down = unit(along)
    turn = np.degrees(vector_from_rotation(np.stack([normal, down, cross(normal, down)], axis=-1)))
    return np.asarray(turn[:, [2, 1, 0]] * [-1.0, -1.0, 1.0])
