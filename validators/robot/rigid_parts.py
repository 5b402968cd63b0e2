"""Rigid parts of any robot: distances between points of one body must be the model's."""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array
from posekit.robots.kinematics import Kinematics
from posekit.skeleton import SEGMENT_NAMES
from posekit.validators.robot.reach import rigid_pairs
from posekit.validators.suite import Judgement


def rigid_segments(kinematics: Kinematics) -> tuple[str, ...]:
    """List the skeleton's segments whose length is the same in every configuration of a model."""
    names = kinematics.names
    rigid = {frozenset((names[a], names[b])) for a, b in rigid_pairs(kinematics)}
    return tuple(name for name in SEGMENT_NAMES if frozenset(name.split("-")) in rigid)


def judge_rigid_parts(kinematics: Kinematics, targets: Array, *, tolerance: float) -> Judgement:
    """Compare the distances seen with those of the model, where no configuration of it changes them.

    Of the skeleton's 17 segments those that are rigid in this model: a spine that bends has no length from neck
    to pelvis.

    Parameters
    ----------
    kinematics : Kinematics
        The robot's kinematics, which place its bodies.
    targets : array (N, P, 3)
        Metres; NaN is unknown.
    tolerance : float
        Metres by which a distance may be off.
    """
    names = rigid_segments(kinematics)
    column = {name: k for k, name in enumerate(kinematics.names)}
    a, b = ([column[name.split("-")[end]] for name in names] for end in (0, 1))
    own = kinematics.positions(kinematics.neutral[None])[0]
    value = np.linalg.norm(targets[:, a] - targets[:, b], axis=2)
    length = np.linalg.norm(own[a] - own[b], axis=1)
    lower = np.broadcast_to(length - tolerance, value.shape)
    upper = np.broadcast_to(length + tolerance, value.shape)
    margin = np.minimum(value - lower, upper - value)
    return Judgement(
        check="rigid_parts",
        where=names,
        unit=("m",) * len(names),
        value=value,
        lower=lower,
        upper=upper,
        margin=margin,
        violated=margin < 0,
    )
