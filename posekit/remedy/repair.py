"""The door of the room: postures, or a motion, to the nearest that pass."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.body import with_head
from posekit.body.measured import MeasuredPerson
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.remedy.given_clip import clip_given, joints_and_head
from posekit.remedy.motion import clip_points, clip_with, feet_along, repair_over_time
from posekit.remedy.postures import joint_weights, nearest_valid
from posekit.remedy.record import Repaired, left_of, spans_of
from posekit.remedy.tied import tied_postures
from posekit.skeleton import JOINTS, POINTS
from posekit.validators import Report, Validator
from posekit.validators.motion import MotionClip, judge_motion

REPAIR_ROUNDS: Final = 3
"""How often what a fresh validation still rejects is tried: its lengths may be those of the repaired postures."""


def repair(
    postures: ArrayLike | MotionClip,
    validator: Validator | None = None,
    *,
    head: ArrayLike | None = None,
    person: MeasuredPerson | None = None,
    weights: ArrayLike | None = None,
    rate: float | None = None,
    up: str = "",
) -> Repaired:
    r"""Find the nearest postures, or the nearest motion, that pass.

    Of each posture :math:`\sum_j w_j |y_j - x_j|^2` is least over its joints: all weigh the same unless told otherwise,
    the five points of the head together as much as a joint. Lengths stay as they are; those that are off are brought to
    the nearest within the tolerance. What passes is returned as it is.

    Of a motion, what checks over time reject is undone first: sides exchanged back, lengths of limbs brought back,
    jumps and frames that stand still interpolated, jitter smoothed by as little as passes, the body shifted to the
    ground, standing feet held. Then postures are sought with changes that are alike in neighbouring frames.

    Parameters
    ----------
    postures : array (N, 14, 3), (N, 19, 3) or (14, 3), or MotionClip
        Joints in tree order, with the head's points or without, metres; NaN where unknown. A posture without torso or
        hips stays as it is. Or the frames of one motion.
    validator : Validator, optional
        What they must pass; that of the stick figure with its usual settings if not given.
    head : array (N, 5, 3), optional
        Nose, eyes and ears; a clip has its own.
    person : MeasuredPerson, optional
        As `Validator.check` takes it: whose recording the postures are a part of.
    weights : array (14,) or (N, 14), optional
        Of the joints.
    rate : float, optional
        Frames a second: an array is motion where it is given.
    up : str
        Of such motion the axis that points up, as ``+z``; without it nothing is known of the ground.

    Returns
    -------
    Repaired

    Raises
    ------
    InputError
        Where a shape, the rate or the axis is wrong, or the validator judges a robot, whose configurations
        `posekit.remedy.repair_configurations` takes.

    Examples
    --------
    >>> import posekit
    >>> standing = posekit.load_figure().neutral_points[:14].copy()
    >>> posekit.repair(standing).told()
    '0 of 1 frames changed'
    >>> standing[[10, 12]] += [[0.35, 0, 0.1], [0.2, 0, 0.5]]  # a right knee bent forward
    >>> bool(posekit.repair(standing).valid.all())
    True
    """
    judge = Validator() if validator is None else validator
    if judge.robot is not None:
        raise InputError(
            "repair: the validator judges a robot, of which configurations are repaired; expected one of the stick "
            "figure; call posekit.remedy.repair_configurations(q, validator)"
        )
    clip = postures if isinstance(postures, MotionClip) else None
    if clip is not None and (rate is not None or up):
        raise InputError("repair: a clip has its own rate and its own up; expected neither; leave them out")
    if not isinstance(postures, MotionClip):
        joints, head = joints_and_head(np.asarray(postures, dtype=np.float64), head)
        judge.check(joints, head, person=person)  # refuses what is no posture
        clip = clip_given(joints, head, rate, up, judge.settings)
    if clip is None:
        points = with_head(joints)
        if head is not None:
            points[:, len(JOINTS) :] = head
        start, steps, time = points, [], None
    else:
        done = repair_over_time(clip, judge, person)
        points, start, steps, time = clip_points(clip), done.points, done.steps, done.time.copy()
    weight = np.tile(joint_weights(), (len(points), 1))
    if weights is not None:
        weight[:, : len(JOINTS)] = weights
    legal = _legal(start[:, : len(POINTS)], judge, person, weight, in_time=clip is not None)
    way = np.nan_to_num(np.linalg.norm(legal.points - start[:, : len(POINTS)], axis=-1))[:, : len(JOINTS)]
    spans = [span for name, moved in (*steps, ("turned", way)) for span in spans_of(name, moved)]
    judgements, valid = list(legal.report.judgements), legal.report.valid.copy()
    feet = None
    if clip is not None:
        out = start.copy()
        out[:, : len(POINTS)] = legal.points
        feet = feet_along(start, out)[:, len(POINTS) :].copy()
        over_time = judge_motion(
            judge.profile.checks, clip_with(replace(clip, time=done.time), out)
        ).judgements
        judgements += over_time
        for one in over_time:
            valid &= ~one.violated.any(axis=1)
    has_head = head is not None or (clip is not None and np.isfinite(clip.head).any())
    return Repaired(
        joints=legal.points[:, : len(JOINTS)].copy(),
        head=legal.points[:, len(JOINTS) :].copy() if has_head else None,
        feet=feet if feet is not None and np.isfinite(feet).any() else None,
        time=time,
        spans=tuple(sorted(spans, key=lambda span: -span.most)),
        left=left_of(judgements),
        valid=valid,
    )


class _Legal(NamedTuple):
    """Postures (N, 19, 3), and what a fresh validation says of them."""

    points: Array
    report: Report


def _legal(
    points: Array, judge: Validator, person: MeasuredPerson | None, weight: Array, *, in_time: bool
) -> _Legal:
    """Bring postures within what checks of postures demand, those of a person as they then are."""
    out = points.copy()
    for _ in range(REPAIR_ROUNDS):
        report = _judged(judge, out, person)
        bad = np.flatnonzero(report.invalid)
        if not bad.size:
            return _Legal(out, report)
        _, suite = judge.figure_and_suite(out[:, : len(JOINTS)], person=person)
        if in_time:
            out = tied_postures(points, np.union1d(bad, _moved(out, points)), suite, weight)
        else:
            out[bad] = nearest_valid(points[bad], suite, weight[bad])
    return _Legal(out, _judged(judge, out, person))


def _moved(after: Array, before: Array) -> NDArray[np.intp]:
    return np.flatnonzero((np.nan_to_num(after - before) != 0).any(axis=(1, 2)))


def _judged(judge: Validator, points: Array, person: MeasuredPerson | None) -> Report:
    head = points[:, len(JOINTS) :]
    return judge.check(points[:, : len(JOINTS)], head if np.isfinite(head).any() else None, person=person)
