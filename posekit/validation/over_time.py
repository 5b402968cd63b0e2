"""Clips of what is given, and what checks over time say of each of its frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.formats.held_postures import HeldPostures
from posekit.formats.motion import UP_DIRECTIONS
from posekit.formats.motion.motion_table import recorded_rate
from posekit.formats.own.report_frames import ClipName, ReportFrames
from posekit.validation.people import Recording
from posekit.validation.robot_motion import moves_of
from posekit.validators import Judgement, Validator
from posekit.validators import Report as Verdicts
from posekit.validators.measured import recorded_noise
from posekit.validators.motion import MotionClip, judge_motion
from posekit.validators.motion.walking_phases import RULES_OVER_STRIDES, WalkingPhases


def clip_of(held: HeldPostures, rows: NDArray[np.intp], validator: Validator) -> MotionClip:
    """Make a clip of some postures of a file, as checks over time see it.

    Parameters
    ----------
    held : HeldPostures
        What the file holds.
    rows : int array (T,)
        Which of its postures are the clip's frames, in their order.
    validator : Validator
        What else was asked: where the ground is, how large the noise; and the robot of configurations.
    """
    settings = validator.settings
    joints, head, time = held.postures.joints[rows], held.postures.head, held.time[rows]
    model = None if validator.robot is None or not held.q.size else validator.robot.model
    names = () if model is None else tuple(model.names)[1:]
    moves = moves_of(model, held.q[rows] if held.q.size else held.q, time, names)
    return MotionClip(
        joints=joints,
        head=np.empty(0) if head is None else head[rows],
        feet=held.feet[rows] if held.feet.size else held.feet,
        time=time,
        rate=recorded_rate(time),
        # Where each frame has its own origin there is no ground, and nothing goes anywhere.
        up=UP_DIRECTIONS[held.up] if held.up and held.in_world else None,
        ground=settings.ground,
        noise=recorded_noise(joints, settings),
        **moves,
    )


def judged_over_time(
    held: HeldPostures, recordings: Sequence[Recording], validator: Validator
) -> tuple[list[list[Judgement]], list[tuple[str, str]]]:
    """Ask the checks over time about the clips of a file.

    Parameters
    ----------
    held : HeldPostures
        What the file holds.
    recordings : sequence of Recording
        Which of its postures are whose.
    validator : Validator
        Whose profile asks.

    Returns
    -------
    judgements : list of lists of Judgement
        Of each recording, a row a posture of it.
    not_asked : list of (str, str)
        Of each clip, checks that do not apply and why.
    """
    judgements: list[list[Judgement]] = []
    not_asked: list[tuple[str, str]] = []
    for rows, _ in recordings:
        clip, found = held.clip[rows], []
        for which in np.unique(clip).tolist():
            at = np.flatnonzero(clip == which)
            verdict = judge_motion(validator.profile.checks, clip_of(held, rows[at], validator))
            found += [_spread(one, at, len(rows)) for one in verdict.judgements]
            not_asked += list(verdict.not_asked.items())
        judgements.append(found)
    return judgements, not_asked


def left_to_strides(verdicts: Verdicts, over_time: Sequence[Judgement]) -> Verdicts:
    """Leave rules of walking that speak of motion to `WalkingPhases`, in the clips that it was asked about.

    Parameters
    ----------
    verdicts : Report
        What the checks of postures say, each frame by itself.
    over_time : sequence of Judgement
        What checks over time say of the same postures.
    """
    name = WalkingPhases.name.replace("-", "_")
    asked = next(
        (np.asarray(~np.isnan(one.upper).any(axis=1)) for one in over_time if one.check == name), None
    )
    if asked is None or not asked.any():
        return verdicts
    rules = tuple(f"rule{rule}." for rule in RULES_OVER_STRIDES)
    left = [
        replace(
            one.without(asked[:, None] & np.array([where.startswith(rules) for where in one.where])),
            over_time=bool(asked.all()),
        )
        if one.check == "walking"
        else one
        for one in verdicts.judgements
    ]
    return replace(verdicts, judgements=left)


def _spread(judgement: Judgement, at: NDArray[np.intp], count: int) -> Judgement:
    """Lay what is said of some postures over all; of others nothing is said."""
    if len(at) == count:
        return judgement
    numbers: dict[str, Any] = {
        name: np.full((count, len(judgement.where)), np.nan) for name in ("value", "lower", "upper", "margin")
    }
    violated = np.zeros((count, len(judgement.where)), dtype=np.bool_)
    for name, array in numbers.items():
        array[at] = getattr(judgement, name)
    violated[at] = judgement.violated
    return replace(judgement, violated=violated, **numbers)


def frames_of(held: HeldPostures, file: str) -> ReportFrames | None:
    """Say which frame of which clip each posture is; None where the file knows no frames."""
    if len(held) > 1 and not held.frame.any():
        return None
    used, clip = np.unique(held.clip, return_inverse=True)
    # A reader that finds no names counts; of one clip alone that says nothing.
    named = len(held.clips) > int(used.max(initial=0)) and held.clips != ("0",)
    frames = ReportFrames(
        clips=[
            ClipName(file, held.clips[k] if named else str(k) if len(used) > 1 else "") for k in used.tolist()
        ],
        clip=clip.astype(np.intp),
        frame=held.frame.copy(),
        time=held.time,
        in_time=held.in_time,
    )
    for k in range(len(used) if len(used) > 1 else 0):  # a file of several clips counts their frames through
        rows = frames.rows(k)
        frames.frame[rows] = np.arange(len(rows))
    return frames
