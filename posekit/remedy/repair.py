"""The door of the room: postures, a motion or a robot's configurations to the nearest that pass."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.body import with_head
from posekit.errors import InputError
from posekit.remedy.postures import joint_weights, nearest_valid
from posekit.remedy.record import Repaired, left_of, spans_of
from posekit.skeleton import JOINTS
from posekit.validators import Validator

REPAIR_ROUNDS: Final = 3
"""How often what a fresh validation still rejects is tried: its lengths may be those of the repaired postures."""


def repair(
    postures: ArrayLike,
    validator: Validator | None = None,
    *,
    head: ArrayLike | None = None,
    lengths: Mapping[str, float] | None = None,
    behind: bool | None = None,
    weights: ArrayLike | None = None,
) -> Repaired:
    r"""Find the nearest postures that pass.

    Of each posture :math:`\sum_j w_j |y_j - x_j|^2` is least over its joints: all weigh the same unless told otherwise,
    the five points of the head together as much as a joint. Lengths stay as they are; those that are off are brought to
    the nearest within the tolerance. What passes is returned as it is.

    Parameters
    ----------
    postures : array (N, 14, 3) or (14, 3)
        Joints in tree order, metres; NaN where unknown. A posture without torso or hips stays as it is.
    validator : Validator, optional
        What they must pass; that of the stick figure with its usual settings if not given.
    head : array (N, 5, 3), optional
        Nose, eyes and ears.
    lengths, behind
        As `Validator.check` takes them: those of a whole file that is repaired in parts.
    weights : array (14,) or (N, 14), optional
        Of the joints.

    Returns
    -------
    Repaired

    Raises
    ------
    InputError
        Where a shape is wrong, or the validator judges a robot, whose configurations
        `posekit.remedy.repair_configurations` takes.

    Examples
    --------
    >>> import posekit
    >>> standing = posekit.load_figure().neutral_points[:14].copy()
    >>> repaired = posekit.repair(standing)
    >>> repaired.told()
    '0 of 1 frames changed'
    >>> standing[10:14:2] += [[0.35, 0, 0.1], [0.2, 0, 0.5]]  # a right knee bent forward
    >>> repaired = posekit.repair(standing)
    >>> bool(repaired.valid.all())
    True
    """
    judge = Validator() if validator is None else validator
    if judge.robot is not None:
        raise InputError(
            "repair: the validator judges a robot, of which configurations are repaired; expected one of the stick "
            "figure; call posekit.remedy.repair_configurations(q, validator)"
        )
    given = np.asarray(postures, dtype=np.float64)
    joints = given[None] if given.ndim == 2 else given
    before = judge.check(joints, head, lengths=lengths, behind=behind)
    points = with_head(joints)
    if head is not None:
        points[:, len(JOINTS) :] = head
    weight = np.tile(joint_weights(), (len(points), 1))
    if weights is not None:
        weight[:, : len(JOINTS)] = weights
    bad = np.flatnonzero(before.invalid)
    out, report = points.copy(), before
    for _ in range(REPAIR_ROUNDS):
        if not bad.size:
            break
        own = out[:, : len(JOINTS)] if report is not before else joints
        _, suite = judge.figure_and_suite(own, lengths=lengths, behind=behind)
        out[bad] = nearest_valid(points[bad], suite, weight[bad])
        report = judge.check(
            out[:, : len(JOINTS)],
            None if head is None else out[:, len(JOINTS) :],
            lengths=lengths,
            behind=behind,
        )
        bad = np.flatnonzero(report.invalid)
    moved = np.nan_to_num(np.linalg.norm(out - points, axis=-1))[:, : len(JOINTS)]
    return Repaired(
        joints=out[:, : len(JOINTS)],
        head=None if head is None else out[:, len(JOINTS) :],
        spans=tuple(sorted(spans_of("turned", moved), key=lambda span: -span.most)),
        left=left_of(report.judgements),
        valid=report.valid,
    )
