r"""What the tree must allow for so that nothing is dropped which the noise can explain.

A lift puts the end of a segment of length l, seen d long, at the depth :math:`z = \sqrt{l^2 - d^2}` from its foot on
the ray, so that :math:`dz / dd = -d / z`: without bound where the ray is tangent. But an error of d that is no larger
than e changes the depth by no more than :math:`\sqrt{2 l e + e^2}`, and the direction by no more than
:math:`\arccos(1 - e / l)`, wherever the segment points: at the tangent ray both are reached. These caps are what the
tolerances are made of, with e the worst that the stated number of standard deviations does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from posekit.body import Figure
from posekit.cameras import Camera
from posekit.errors import InputError
from posekit.refinement.optics import optics_of
from posekit.settings import ALLOWED_DEVIATIONS
from posekit.skeleton import N_TRUNK_JOINTS, PARENTS, RIGID_SEGMENTS, TREE_SEGMENTS, segment_name

ROUNDING_METRES = 1e-6
"""Metres that the distances inside a found trunk may be off: they come from its own projections."""


@dataclass(frozen=True, kw_only=True)
class NoiseTolerance:
    """Allowances that follow from the noise.

    Parameters
    ----------
    rigid : float
        Metres by which distances inside torso and hips may be off.
    tangent : float
        Metres by which a segment may be too short for its image.
    angle : float
        Degrees by which the direction of a segment may be off, at the worst.
    contact : float
        Metres by which bodies may overlap: the most that a depth may be off, over the number of deviations, since a
        limb and what it touches are seldom off against each other by more.
    bound : float
        What `posekit.refinement.allowance.under_noise` needs to allow each segment its own angle.
    stretch : float
        The same of lengths, and of what scales them.
    """

    rigid: float
    tangent: float
    angle: float
    contact: float
    bound: float
    stretch: float = 0.0


def tolerance_of(
    deviation: float,
    camera: Camera,
    figure: Figure,
    depth: float,
    *,
    deviations: float = ALLOWED_DEVIATIONS,
    length_deviation: float = 0.0,
    root_depth_deviation: float = 0.0,
    trunks: bool = False,
) -> NoiseTolerance:
    r"""Derive tolerances from the noise of key points.

    Parameters
    ----------
    deviation : float
        Standard deviation of the key points in each coordinate, pixels: the largest that counts.
    camera : Camera
        What projects and lifts; its first axis counts frames.
    figure : Figure
        The person's figure: lengths, capsules, limits.
    depth : float
        How far the person is at most, metres; of no meaning for a scaled orthographic camera.
    deviations : float
        How many standard deviations are allowed for.
    length_deviation : float
        Relative standard deviation of segment lengths, beside the trunk that limbs are put on.
    root_depth_deviation : float
        Standard deviation of the root's depth, metres: to first order it scales all that is lifted.
    trunks : bool
        Whether the tree is grown on trunks that `posekit.refinement.find_trunks` found: then the rigid parts are
        exact, and the trunk is off by no more than one point's noise.

    Returns
    -------
    NoiseTolerance

    Raises
    ------
    InputError
        Where a number is negative or not finite.
    """
    for name, value in (
        ("deviation", deviation),
        ("depth", depth),
        ("deviations", deviations),
        ("length_deviation", length_deviation),
        ("root_depth_deviation", root_depth_deviation),
    ):
        if not (math.isfinite(value) and value >= 0):
            raise InputError(f"tolerance_of: {name} is {value!r}; expected zero or a positive, finite number")
    optics = optics_of(camera, np.zeros(1, dtype=np.intp))
    focal = float(np.min(optics.focal[[0, 2]]))
    scale = depth / focal if optics.perspective else 1.0 / focal
    bound = deviations * deviation / focal
    beside = deviations * deviation * scale
    stretch = deviations * math.hypot(
        length_deviation, root_depth_deviation / depth if root_depth_deviation else 0.0
    )
    lengths = {joint: figure.lengths[segment_name(pair)] for joint, pair in enumerate(TREE_SEGMENTS, start=1)}
    # Both ends of a segment are off beside their rays, and its length by its own deviation.
    excess = {joint: math.hypot(math.sqrt(2) * beside, stretch * length) for joint, length in lengths.items()}
    tangent = max(excess.values())
    turn = {joint: _turn(excess[joint], length) for joint, length in lengths.items()}
    limb = max(turn[joint] for joint in range(N_TRUNK_JOINTS, len(PARENTS)))
    if trunks:
        rigid, trunk = ROUNDING_METRES, _turn(beside, lengths[3])
    else:
        rigid, trunk = (
            max(_apart(pair, lengths, excess) for pair in RIGID_SEGMENTS) + tangent,
            max(turn[1], turn[3]),
        )
    contact = (
        max(_cap(lengths[joint], excess[joint]) for joint in range(N_TRUNK_JOINTS, len(PARENTS))) / deviations
        if deviations
        else 0.0
    )
    return NoiseTolerance(
        rigid=rigid,
        tangent=tangent,
        angle=min(math.degrees(math.hypot(limb, trunk)), 180.0),
        contact=contact,
        bound=bound,
        stretch=deviations * length_deviation,
    )


def _cap(length: float, excess: float) -> float:
    """Return how far a lift's depth may be off."""
    return math.sqrt(2 * length * excess + excess * excess)


def _turn(excess: float, length: float) -> float:
    """Return by what angle a segment's direction may be off, radians."""
    return math.acos(max(1 - excess / length, -1.0))


def _apart(pair: tuple[int, int], lengths: dict[int, float], excess: dict[int, float]) -> float:
    """Return how far the distance of two joints of a rigid part may be off when each is lifted by itself."""
    shared = {3} if min(pair) > 3 else set()
    caps = [_cap(lengths[joint], excess[joint]) for joint in pair if joint not in shared and joint > 0]
    return math.hypot(*caps)
