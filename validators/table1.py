r"""Joint ranges of the angles of Lee & Chen 1985, §3.2.A, defined as rotations from standing or as in the paper.

In the coordinate frame of the torso, x points forward, y down and z to the left. The angles of kind ``rotation`` are
continuous in all postures that limbs reach:

For an arm, let u be the direction of the upper arm. The shortest rotation from y to u has the angle
:math:`\rho = \arccos u_y`. The z component of this rotation's vector is flexion, the x component is abduction:
:math:`(\theta, \varphi) = \frac{\rho}{\sin\rho} (u_x, \pm u_z)`. The flexion of a thigh is
:math:`\operatorname{atan2}(u_x, u_y)`, as in the paper; its abduction is the angle between the thigh and the xy plane.
Elbow and knee bend about the axis z', which is z rotated together with the upper segment. Let v be the direction of the
lower segment and :math:`\psi` the angle between u and v. The flexion of an elbow is
:math:`\psi\,(v \times u) \cdot z' / \sin\psi`; a knee has the opposite sign. The angles of pelvis and neck are
components z, y and x of a rotation vector: of the plane of the hips, or of the head, relative to the torso.

The angles in the paper (kind ``projected``) are those of segments projected onto the coordinate planes of the torso. An
angle is undecided if its projection is short. It jumps if a limb passes through the normal of the plane.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np

from posekit.body.frames import hips_frame, torso_frame
from posekit.geometry import Array, cross, dot, perpendicular, unit, vector_from_rotation
from posekit.skeleton import JOINT, TORSO
from posekit.validators.body import Body
from posekit.validators.check import Judgement

HIP_SIGNS: Final = (1.0, -1.0, 1.0)
#: Signs that turn flexion, rotation and bending of a plane into the angles of the head.
HEAD_SIGNS: Final = (-1.0, 1.0, -1.0)

PLANE_ANGLES: Final = ("flexion", "rotation", "bending")

#: Smallest sine or cosine used as a divisor.
LEAST_SINE: Final = 1e-12

#: Largest distance from -180 degrees at which an angle counts as 180, degrees.
ROUNDING_DEGREES: Final = 1e-3


def table1_angles(body: Body, table: Mapping[str, Any], parts: Sequence[str]) -> Judgement:
    """Judge neck, pelvis or limbs by a table of kind ``rotation`` or ``projected``."""
    R = torso_frame(*(body.joints[:, JOINT[name]] for name in TORSO))
    axes = np.stack([R[..., 0], -R[..., 2], R[..., 1]], axis=-2)
    return Judgement.stacked(
        [(_plane if part in ("neck", "pelvis") else _limb)(body, axes, table, part) for part in parts]
    )


def _plane(body: Body, axes: Array, table: Mapping[str, Any], part: str) -> Judgement:
    """Judge the rotation of the plane of the hips or of the head relative to the torso (§3.2.A iii and iv).

    The normal of the head's plane is the direction that the head faces.
    """
    joints = body.joints
    if part == "pelvis":
        pelvis, right, left = (joints[:, JOINT[name]] for name in ("pelvis", "right_hip", "left_hip"))
        below = (right + left) / 2 - pelvis
        if body.figure.pelvis_between_hips:
            below = -hips_frame(pelvis, right, left, joints[:, 0])[..., 2]
        along = np.einsum("nij,nj->ni", axes, below)
        normal, signs = unit(cross(along, np.einsum("nij,nj->ni", axes, left - right))), HIP_SIGNS
    else:
        R_head = body.figure.ik.head_frame(joints[:, 0], body.head)
        normal, crown = (np.einsum("nij,nj->ni", axes, R_head[:, :, k]) for k in (0, 2))
        along, signs = -crown, HEAD_SIGNS
    if table["kind"] == "rotation":
        down = unit(along)
        turn = np.degrees(vector_from_rotation(np.stack([normal, down, cross(normal, down)], axis=-1)))
        value = turn[:, [2, 1, 0]] * [-1.0, -1.0, 1.0]
    else:
        least = table.get("shortest_projection", 0.1)
        value = np.stack(
            [
                angle_in_plane(-normal[:, 1], normal[:, 0], least),
                angle_in_plane(normal[:, 2], normal[:, 0], least),
                angle_in_plane(along[:, 2], along[:, 1], least * np.linalg.norm(along, axis=1)),
            ],
            axis=-1,
        )
    lower, upper = np.array([table[part][angle] for angle in PLANE_ANGLES], dtype=np.float64).T
    places = [f"{part}.{angle}" for angle in PLANE_ANGLES]
    return Judgement(places, value * signs, lower, upper, body.angle_tolerance())


def _limb(body: Body, axes: Array, table: Mapping[str, Any], part: str) -> Judgement:
    """Judge a limb (§3.2.A i and ii); hip flexion has a wider range if the knee is flexed (Table 1, note a)."""
    side, ball = part.split("_")
    hinge, end = ("elbow", "wrist") if ball == "shoulder" else ("knee", "ankle")
    joints = [JOINT[f"{side}_{name}"] for name in (ball, hinge, end)]
    segments = tuple(pairwise(joints))
    u, v = (np.einsum("nij,nj->ni", axes, body.joints[:, b] - body.joints[:, a]) for a, b in segments)
    tolerance = body.angle_tolerance(*segments)
    value, gain = _ball(u, ball, 1.0 if side == "left" else -1.0, table, tolerance)
    flexion, hinge_gain = _hinge(u, v, hinge, table, tolerance)
    limits = [table[ball]["flexion"], table[ball]["abduction"], table[hinge]["flexion"]]
    ends = np.tile(np.array(limits, dtype=np.float64), (len(u), 1, 1))
    if ball == "hip":
        least = table.get("knee_flexed", 5.0)
        share = np.clip(flexion / max(least, ROUNDING_DEGREES), 0.0, 1.0)
        if table["kind"] == "projected":
            share = np.where(flexion > least, 1.0, 0.0)
        narrow = np.array(table["hip"]["flexion_with_straight_knee"], dtype=np.float64)
        known = ~np.isnan(flexion)
        ends[known, 0] += ((1 - share)[:, None] * (narrow - ends[:, 0]))[known]
    return Judgement(
        [f"{part}.flexion", f"{part}.abduction", f"{side}_{hinge}.flexion"],
        np.column_stack([value, flexion]),
        ends[..., 0],
        ends[..., 1],
        tolerance * np.column_stack([gain, hinge_gain]),
    )


def _ball(
    u: Array, joint: str, outward: float, table: Mapping[str, Any], tolerance: float
) -> tuple[Array, Array]:
    """Return flexion and abduction of shoulder or hip (N, 2), degrees, and factors (N, 2) of their tolerances."""
    one = np.ones((len(u), 2))
    if table["kind"] == "projected":
        least = table.get("shortest_projection", 0.1) * np.linalg.norm(u, axis=1)
        across = (u[:, 0], outward * u[:, 2])
        return np.stack([angle_in_plane(x, u[:, 1], least, tolerance) for x in across], axis=-1), one
    x, y, z = unit(u).T * np.array([[1.0], [1.0], [outward]])
    if joint == "shoulder":
        sine = np.hypot(x, z)
        rho = np.arctan2(sine, y)
        raised = np.where(sine > 0, [x, z], [[1.0], [0.0]])  # a raised vertical arm is flexed by 180
        gain = np.maximum(rho / np.maximum(sine, LEAST_SINE), 1.0)
        return np.degrees(rho * raised / np.where(sine > 0, sine, 1.0)).T, one * gain[:, None]
    across, middle = np.hypot(x, y), sum(table["hip"]["flexion"]) / 2
    # Flexion is at most half a turn from the middle of its range, so that it jumps farthest from both limits.
    flexion = middle + np.mod(np.degrees(np.arctan2(x, y)) - middle + 180.0, 360.0) - 180.0
    gains = np.stack([1 / np.maximum(across, LEAST_SINE), np.ones_like(across)], axis=-1)
    return np.stack([flexion, np.degrees(np.arctan2(z, across))], axis=-1), gains


def _hinge(u: Array, v: Array, joint: str, table: Mapping[str, Any], tolerance: float) -> tuple[Array, Array]:
    """Return the flexion of an elbow or a knee (N,), degrees, and the factor of its tolerance."""
    forward = 1.0 if joint == "elbow" else -1.0
    if table["kind"] == "projected":
        w = cross(v, u)
        size = np.linalg.norm(w, axis=1)
        bend = np.degrees(np.arctan2(size, dot(u, v)))
        # The elbow of an arm that points sideways bends about y. The z component is rounding; it counts as flexion.
        flexion = np.where(forward * w[:, 2] >= -np.radians(tolerance) * size, bend, -bend)
        return flexion, np.ones(len(flexion))
    u, v = unit(u), unit(v)
    x, y, z = u.T
    if joint == "elbow":
        # 1 + y without cancellation for a nearly vertical raised arm, where it is quadratic in the angle from vertical.
        top = np.where(y < 0, (x * x + z * z) / (1 - np.minimum(y, 0.0)), 1 + y)
        safe = np.maximum(top, LEAST_SINE**2)
        axis = np.stack([-x * z / safe, -z, 1 - z * z / safe], axis=-1)
        carried = np.sqrt((1 - y) / safe)
    else:
        axis = -unit(perpendicular(np.broadcast_to([0.0, 0.0, 1.0], u.shape), u))
        carried = np.abs(z) / np.maximum(np.hypot(x, y), LEAST_SINE)
    w = cross(v, u)
    sine = np.linalg.norm(w, axis=1)
    rate = np.where(sine > LEAST_SINE, np.arctan2(sine, dot(u, v)) / np.maximum(sine, LEAST_SINE), 1.0)
    part = dot(w, axis)
    beside = np.sqrt(np.maximum(sine * sine - part * part, 0.0))
    gain = 1 + (rate - 1) * beside / np.maximum(sine, LEAST_SINE) + rate * beside * carried
    return np.degrees(rate * part), gain


def angle_in_plane(x: Array, y: Array, shortest: Array | float, tolerance: float = ROUNDING_DEGREES) -> Array:
    """Return the angle from the y axis towards x, degrees; NaN if the projection (x, y) is too short.

    The angle is between -180 and 180. Angles within the tolerance of -180 are increased by 360: an arm that points
    straight up is flexed by 180, not by -180.
    """
    angle = np.degrees(np.arctan2(x, y))
    angle = np.where(angle < max(tolerance, ROUNDING_DEGREES) - 180, angle + 360, angle)
    return np.where(np.hypot(x, y) < shortest, np.nan, angle)
