"""Limits and collisions of a batch of configurations: verdicts at once, margins when somebody asks for them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.validators.robot.collision import SelfCollision
from posekit.validators.robot.deferred import Deferred
from posekit.validators.robot.joint_range import judge_joint_range, outside_limits
from posekit.validators.robot.subject import Subject
from posekit.validators.suite import Judgement


def judge_quickly(
    subject: Subject, collision: SelfCollision | None, q: Array, *, tolerance: float | None
) -> Deferred:
    """Judge configurations that were checked.

    Parameters
    ----------
    subject : Subject
        The model with its geometry, and what was prepared for it once.
    collision : SelfCollision, optional
        What judges collisions, where they are asked about.
    q : array (N, nq)
        Finite, rotations of unit length; not changed afterwards.
    tolerance : float, optional
        Degrees outside a limit that are no violation, where limits are asked about.

    Returns
    -------
    Deferred
        ``joint_range`` and ``collision``, in this order, as far as they were asked for.
    """
    rejected = np.zeros(len(q), dtype=np.bool_)
    makers: list[Callable[[NDArray[Any] | slice], Judgement]] = []
    if tolerance is not None:
        rejected |= outside_limits(subject, q, tolerance=tolerance)
        makers.append(lambda rows: judge_joint_range(subject, q[rows], tolerance=tolerance))
    if collision is not None:
        hit = collision.hits(q)
        rejected |= hit
        makers.append(lambda rows: collision.judgement(hit[rows]))
    return Deferred(makers, rejected)
