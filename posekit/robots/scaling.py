"""A model with the segment lengths of a person: joint placements, geometry and centres of mass move along."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import pinocchio as pin

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.robots.kinematics import Kinematics
from posekit.robots.stretching import EXACT_METRES, ModelStretching, shoulders_are_behind
from posekit.safe_io import nearest
from posekit.skeleton import JOINTS, SEGMENT_NAMES, SEGMENTS, segment_name

__all__ = ["ScaledRobot", "model_lengths", "scaled", "segment_lengths", "shoulders_are_behind"]

MAX_PASSES = 30
STUCK_METRES = 1e-10
"""Metres by which a pass must change the largest miss: where it does not, the lengths cannot be met."""

SAME_LENGTH = 1e-9
"""Relative difference of a length below which it is left alone."""

RATIO_BOUNDS = (0.05, 20.0)
"""Ratios of a new length to the model's that are believed; beyond them the unit is wrong."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaledRobot:
    """A model with other lengths.

    Parameters
    ----------
    kinematics : Kinematics
        The new model and its points: offsets of points have moved along.
    geometry : pinocchio.GeometryModel or None
        The new geometry, where one was given.
    lengths : mapping
        The distances between mapped points at the neutral configuration, metres, by segment name.
    residual : mapping
        By how much a demanded length was missed (what it has become minus what was asked for), metres. Not zero where
        the model's structure does not allow it, or where no torso has such lengths.
    """

    kinematics: Kinematics
    geometry: pin.GeometryModel | None
    lengths: Mapping[str, float]
    residual: Mapping[str, float]


def segment_lengths(postures: Array) -> dict[str, float]:
    """Return the median length of each of the 17 segments over postures (N, 14, 3) or (N, 19, 3), metres.

    Segments that are never seen whole are left out.
    """
    lengths = {}
    for name, (a, b) in zip(SEGMENT_NAMES, SEGMENTS, strict=True):
        distance = np.linalg.norm(postures[:, a] - postures[:, b], axis=-1)
        known = distance[np.isfinite(distance)]
        if known.size:
            lengths[name] = float(np.median(known))
    return lengths


def model_lengths(kinematics: Kinematics) -> dict[str, float]:
    """Return the distances between a model's mapped joints at its neutral configuration, metres, by segment name."""
    place = dict(zip(kinematics.names, kinematics.positions(kinematics.neutral[None])[0], strict=True))
    return {
        segment_name(segment): float(np.linalg.norm(place[a] - place[b]))
        for segment in SEGMENTS
        for a, b in [(JOINTS[segment[0]], JOINTS[segment[1]])]
        if a in place and b in place
    }


def scaled(
    kinematics: Kinematics,
    lengths: Mapping[str, float],
    geometry: pin.GeometryModel | None = None,
    *,
    behind: bool | None = None,
) -> ScaledRobot:
    """Copy a model so that its mapped segments have given lengths at the neutral configuration.

    What lies between the two joints of a limb's segment is scaled by one ratio: the distance then has that ratio
    in every configuration. The spine, from pelvis to neck, is scaled likewise; what else its bodies carry is
    scaled along the spine by that ratio and across it by the shoulders'. Shoulders and hips are then set to the
    place that their distances give. Hands, feet and head keep their size; masses and inertias stay, centres of
    mass move with their body.

    Parameters
    ----------
    kinematics : Kinematics
        From `JointMap.kinematics`: its points are named after the joints.
    lengths : mapping
        Metres, by segment name ``a-b``, a before b in tree order. Segments that are not named, or whose joints the
        model has not, are not asked for.
    geometry : pinocchio.GeometryModel, optional
        Scaled with it.
    behind : bool, optional
        Whether the shoulders lie behind the line from neck to pelvis or in front, which lengths do not tell (see
        `shoulders_are_behind`); on the model's own side unless told otherwise.

    Returns
    -------
    ScaledRobot

    Raises
    ------
    InputError
        Where a segment is unknown, or a length is not positive or beyond 20 times the model's, up or down.
    """
    own = model_lengths(kinematics)
    wanted = _check(lengths, own)
    work = ModelStretching(kinematics, behind)
    turned = behind is not None and work.behind() not in (behind, None)
    if turned or any(abs(length / own[name] - 1) > SAME_LENGTH for name, length in wanted.items()):
        last = math.inf
        for _ in range(MAX_PASSES):
            work.scale(wanted)
            reached = model_lengths(work.kinematics)
            missed = max((abs(reached[name] - length) for name, length in wanted.items()), default=0.0)
            if missed < EXACT_METRES or abs(last - missed) < STUCK_METRES:
                break
            last = missed
    new_geometry = None if geometry is None else work.geometry(geometry)
    reached = model_lengths(work.kinematics)
    return ScaledRobot(
        kinematics=work.kinematics,
        geometry=new_geometry,
        lengths=MappingProxyType(reached),
        residual=MappingProxyType({name: reached[name] - length for name, length in wanted.items()}),
    )


def _check(lengths: Mapping[str, float], own: Mapping[str, float]) -> dict[str, float]:
    """Refuse unknown segments and impossible lengths; keep those that the model has."""
    wanted = {}
    for name, given in lengths.items():
        if name not in SEGMENT_NAMES:
            raise InputError(f"lengths: {name!r} is not a segment; {nearest(name, SEGMENT_NAMES)}")
        length = float(given)
        if not (math.isfinite(length) and length > 0):
            raise InputError(f"lengths: {name} is {length:g} m; expected positive and finite")
        if name not in own or own[name] <= 0:
            continue
        if not RATIO_BOUNDS[0] < length / own[name] < RATIO_BOUNDS[1]:
            raise InputError(
                f"lengths: {name} is {length:g} m, the model's is {own[name]:g}; expected {RATIO_BOUNDS[0]:g} to "
                f"{RATIO_BOUNDS[1]:g} times that; give metres"
            )
        wanted[name] = length
    return wanted
