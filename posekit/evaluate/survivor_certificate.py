"""Whether survivors have the person's lengths and move within the ranges, asked of Pinocchio instead of the checks.

The checks prune branches while they grow. What is asked here is asked of whole postures, in another way. Lengths are
measured on the joints and compared with forward kinematics' at neutral. For ranges a *witness* is looked at: a
configuration whose angles are within the limits of Pinocchio's model, and whose forward kinematics gives every limb the
survivor's direction. However it was found, it shows that a body within its ranges takes that posture.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.body.closed_form import with_head
from posekit.geometry import Array, unit
from posekit.settings import Tolerance
from posekit.skeleton import DOFS, JOINT, SEGMENTS, SIDES, TREE_SEGMENTS, segment_name
from posekit.validators import Ranges, judge, make_checks

ROUNDING_ALLOWANCE: Final = 1e-6
"""Metres, and degrees, that rounding may add to what is allowed."""

MAX_TURN_DEGREES: Final = 1e-3
"""Degrees by which a witness's limb may differ: 5 um at a wrist. Limbs that are nearly straight are made straight."""

UNSEEN_DEGREES: Final = 45.0
"""Degrees that an axial rotation may be off before it is not seen: as the ranges are defined (docs, "Real motion")."""

LIMB_SEGMENTS: Final = np.array(
    [
        (JOINT[f"{side}_{start}"], JOINT[f"{side}_{end}"])
        for side in SIDES
        for start, end in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
    ]
)


class SurvivorCertificate(NamedTuple):
    """What was found of N survivors.

    Attributes
    ----------
    length : array (N,)
        By how much the worst segment's length is off beyond what the tolerance allows, metres; at most 0 where none is.
    angle : array (N,)
        Likewise of the worst angle, degrees; NaN where ranges were not asked for.
    turned : array (N,)
        The largest angle between a limb's segment and its witness's, degrees; NaN without a witness.
    """

    length: Array
    angle: Array
    turned: Array

    @property
    def violations(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Survivors that break lengths, and ranges (N,) each."""
        ranges = (self.angle > ROUNDING_ALLOWANCE) | (self.turned > MAX_TURN_DEGREES)
        return self.length > ROUNDING_ALLOWANCE, np.asarray(ranges)


def certify(
    joints: Array, figure: Figure, ranges: Ranges | None, tolerance: Tolerance
) -> SurvivorCertificate:
    """Measure survivors against the person.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Metres.
    figure : Figure
        The person, whose lengths and limits they are measured against.
    ranges : Ranges or None
        Those that pruned; None where joint ranges were not among the checks.
    tolerance : Tolerance
        What pruned: segments may be off by its `tangent`, distances inside rigid parts by its `rigid`.
    """
    nothing = np.full(len(joints), np.nan)
    length = _lengths(joints, figure, tolerance)
    if ranges is None or not len(joints):
        return SurvivorCertificate(length, nothing, nothing)
    if ranges.kind == "configuration" and ranges.anatomy is None:
        angle, turned = _witnessed(joints, _limited(figure, ranges), tolerance.angle)
        return SurvivorCertificate(length, angle, turned)
    # Projected angles and couplings are no limits of a model: whole postures are judged again.
    checks = make_checks(
        figure,
        ("joint-range",),
        ranges=ranges,
        rigid_tolerance=tolerance.rigid,
        angle_tolerance=tolerance.angle,
    )
    (judgement,) = judge(checks, with_head(joints))
    beyond = np.where(judgement.violated, -judgement.margin, np.minimum(-judgement.margin, 0.0))
    return SurvivorCertificate(length, np.fmax.reduce(beyond, axis=1), nothing)


def _lengths(joints: Array, figure: Figure, tolerance: Tolerance) -> Array:
    ends = np.array(SEGMENTS)
    away = np.linalg.norm(joints[:, ends[:, 0]] - joints[:, ends[:, 1]], axis=-1)
    expected = np.array([figure.lengths[segment_name(segment)] for segment in SEGMENTS])
    # The first segments lift joints and may be too short for their image; the rest are distances inside rigid parts.
    allowed = np.where(np.arange(len(SEGMENTS)) < len(TREE_SEGMENTS), tolerance.tangent, tolerance.rigid)
    return np.asarray(np.fmax.reduce(np.abs(away - expected) - allowed, axis=1))


def _witnessed(joints: Array, figure: Figure, tolerance: float) -> tuple[Array, Array]:
    """Return by how much the witnesses' angles are outside, and how far their limbs are turned away (N,), degrees."""
    q = figure.inverse_kinematics(with_head(joints))
    angles = np.degrees(q[:, figure.angle_index])
    model = figure.model
    lower, upper = (
        np.degrees(bound[figure.angle_index])
        for bound in (model.lowerPositionLimit, model.upperPositionLimit)
    )
    allowed = np.full(angles.shape, tolerance)
    for side in SIDES:
        for joint, hinge in (("shoulder", "elbow"), ("hip", "knee")):
            bend = np.abs(np.sin(np.radians(angles[:, DOFS.index(f"{side}_{hinge}.flexion")])))
            rotation = DOFS.index(f"{side}_{joint}.rotation")
            # A limb that is almost straight hardly shows its axial rotation: the tolerance grows as 1 / sin(bend).
            allowed[:, rotation] /= np.maximum(bend, 1e-12)
    beyond = np.maximum(lower - angles, angles - upper) - allowed
    beyond[allowed > UNSEEN_DEGREES] = np.nan
    turned = np.full(len(joints), np.nan)
    placed = np.isfinite(q).all(axis=1)
    if placed.any():
        shown = figure.forward_kinematics(q[placed])
        a, b = (
            unit(each[:, LIMB_SEGMENTS[:, 1]] - each[:, LIMB_SEGMENTS[:, 0]])
            for each in (shown, joints[placed])
        )
        # By the chord: the arc cosine of two unit vectors has no digits where the angle is small.
        chord = np.linalg.norm(a - b, axis=-1) / 2
        turned[placed] = np.degrees(2 * np.arcsin(np.minimum(chord, 1.0))).max(axis=1)
    return np.asarray(np.fmax.reduce(beyond, axis=1)), turned


@lru_cache(maxsize=4)
def _limited_figure(figure: Figure, limits: tuple[tuple[str, tuple[float, float]], ...]) -> Figure:
    return figure.with_limits({dof: (np.radians(a), np.radians(b)) for dof, (a, b) in limits})


def _limited(figure: Figure, ranges: Ranges) -> Figure:
    limits = ranges.of(figure).limits
    return _limited_figure(figure, tuple(limits.items())) if limits else figure
