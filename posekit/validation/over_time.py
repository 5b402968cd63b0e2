"""Clips of what is given, and what checks over time say of each of its frames."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.body.measured import noise_by_limb, usual_noise
from posekit.formats.held_postures import HeldPostures
from posekit.formats.motion import UP_DIRECTIONS
from posekit.formats.own.report_frames import ClipName, ReportFrames
from posekit.settings import ValidateSettings
from posekit.validation.robot_motion import moves_of
from posekit.validators import Judgement
from posekit.validators.motion import MotionCheck, MotionClip, judge_motion


class ClipRows(NamedTuple):
    """A clip, and which of the given postures are its frames."""

    rows: NDArray[np.intp]
    clip: MotionClip


@dataclass(frozen=True, kw_only=True, eq=False)
class OverTime:
    """What checks over time say of N postures.

    Parameters
    ----------
    judgements : sequence of Judgement
        A row a posture; NaN in clips that a check does not apply to.
    not_asked : mapping
        By check and reason, of how many clips it was not asked.
    """

    judgements: Sequence[Judgement] = ()
    not_asked: Mapping[str, Mapping[str, int]] = field(default_factory=dict)


def judged_over_time(
    held: HeldPostures,
    checks: Sequence[MotionCheck],
    settings: ValidateSettings,
    *,
    model: pin.Model | None = None,
) -> OverTime:
    """Ask checks over time about all clips of a file.

    Parameters
    ----------
    held : HeldPostures
        What the file holds.
    checks : sequence of MotionCheck
        With their thresholds.
    settings : ValidateSettings
        What else was asked: which way is up, where the ground is.
    model : pinocchio.Model, optional
        Of a robot whose configurations they are.
    """
    parts: dict[str, list[tuple[NDArray[np.intp], Judgement]]] = {}
    reasons: dict[str, Counter[str]] = {}
    for rows, clip in clips_of(held, settings, model):
        verdict = judge_motion(checks, clip)
        for judgement in verdict.judgements:
            parts.setdefault(judgement.check, []).append((rows, judgement))
        for name, reason in verdict.not_asked.items():
            reasons.setdefault(name, Counter())[reason] += 1
    return OverTime(
        judgements=[_together(found, len(held)) for found in parts.values()],
        not_asked={name: dict(counts) for name, counts in reasons.items()},
    )


def clips_of(
    held: HeldPostures, settings: ValidateSettings, model: pin.Model | None = None
) -> Iterator[ClipRows]:
    """Go through the clips of a file."""
    # Where each frame has its own origin there is no ground, and nothing goes anywhere.
    up = UP_DIRECTIONS[held.up] if held.up and held.in_world else None
    names = () if model is None else tuple(model.names)[1:]
    for index in range(int(held.clip.max(initial=-1)) + 1):
        rows = np.flatnonzero(held.clip == index)
        head = held.postures.head
        yield ClipRows(
            rows,
            MotionClip(
                joints=held.postures.joints[rows],
                head=np.empty(0) if head is None else head[rows],
                time=held.time[rows],
                rate=rate_of(held.time[rows]),
                up=up,
                ground=settings.ground,
                noise=_noise_of(held.postures.joints[rows], settings),
                **moves_of(model, held.q[rows] if held.q.size else held.q, held.time[rows], names),
            ),
        )


def frames_of(held: HeldPostures, file: str) -> ReportFrames | None:
    """Say which frame of which clip each posture is; None where the file knows no frames."""
    if len(held) > 1 and not held.frame.any():
        return None
    used, clip = np.unique(held.clip, return_inverse=True)
    named = len(held.clips) > int(used.max(initial=0))
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


def _noise_of(joints: NDArray[np.float64], settings: ValidateSettings) -> float:
    """Return the measuring noise of a clip, metres; 0 where none is known."""
    if settings.noise is not None or settings.strict:
        return settings.noise or 0.0
    return float(np.nan_to_num(usual_noise(noise_by_limb(joints))))


def rate_of(time: NDArray[np.float64]) -> float:
    """Return the frames a second of times (T,): by their median step; NaN where they say none."""
    steps = np.diff(time)
    known = steps[np.isfinite(steps) & (steps > 0)]
    return float(1.0 / np.median(known)) if len(known) else np.nan


def _together(found: Sequence[tuple[NDArray[np.intp], Judgement]], count: int) -> Judgement:
    """Lay what a check says of each clip over all postures; places are matched by their names."""
    places = list(dict.fromkeys(where for _, one in found for where in one.where))
    numbers = {name: np.full((count, len(places)), np.nan) for name in ("value", "lower", "upper", "margin")}
    violated = np.zeros((count, len(places)), dtype=np.bool_)
    for rows, one in found:
        at = rows[:, None], np.array([places.index(where) for where in one.where], dtype=np.intp)
        for name, array in numbers.items():
            array[at] = getattr(one, name)
        violated[at] = one.violated
    first = found[0][1]
    return Judgement(
        check=first.check,
        where=tuple(places),
        unit=(first.unit[0],) * len(places),
        value=numbers["value"],
        lower=numbers["lower"],
        upper=numbers["upper"],
        margin=numbers["margin"],
        violated=violated,
        over_time=True,
    )
