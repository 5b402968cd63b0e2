"""Rigid parts of any robot: distances between points of one body must be the model's."""

from __future__ import annotations

import numpy as np

from posekit.cameras import Array
from posekit.robot.kinematics import Kinematics
from posekit.skeleton import JOINT, SEGMENTS, segment_name
from posekit.validators.robot.reach import rigid_pairs
from posekit.validators.suite import Judgement


def judge_rigid_parts(kinematics: Kinematics, targets: Array, *, tolerance: float) -> Judgement:
    """Compare the distances seen with those of the model, where no configuration of it changes them.

    Of the skeleton's 17 segments those that are rigid in this model: a spine that bends has no length from neck
    to pelvis.

    Parameters
    ----------
    kinematics : Kinematics
    targets : array (N, P, 3)
        Metres; NaN is unknown.
    tolerance : float
        Metres by which a distance may be off.
    """
    names = kinematics.names
    segments = {frozenset(segment) for segment in SEGMENTS}
    pairs = [
        (int(a), int(b))
        for a, b in rigid_pairs(kinematics)
        if frozenset((JOINT.get(names[a], -1), JOINT.get(names[b], -2))) in segments
    ]
    own = kinematics.positions(kinematics.neutral[None])[0]
    a, b = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    value = np.linalg.norm(targets[:, a] - targets[:, b], axis=2)
    length = np.linalg.norm(own[a] - own[b], axis=1)
    lower = np.broadcast_to(length - tolerance, value.shape)
    upper = np.broadcast_to(length + tolerance, value.shape)
    margin = np.minimum(value - lower, upper - value)
    return Judgement(
        check="rigid_parts",
        where=tuple(segment_name((JOINT[names[i]], JOINT[names[j]])) for i, j in pairs),
        unit=("m",) * len(pairs),
        value=value,
        lower=lower,
        upper=upper,
        margin=margin,
        violated=margin < 0,
    )
