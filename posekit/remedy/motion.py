"""A motion: remedies for what checks over time reject, then the nearest legal postures, tied over time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.body.measured import MeasuredPerson, measured_person
from posekit.display.short_repr import ShortRepr
from posekit.geometry import Array, runs
from posekit.remedy.between import interpolated, smoothed
from posekit.remedy.exchange import CLIP_MARKS, exchanged
from posekit.remedy.ground import grounded, held_feet
from posekit.remedy.lengths import with_lengths
from posekit.remedy.record import SHIFTED_BACK
from posekit.skeleton import FEET_POINTS, JOINT, JOINTS, POINTS, SEGMENT_NAMES
from posekit.validators import Judgement, Validator
from posekit.validators.motion import MotionClip, judge_motion
from posekit.validators.motion.displaced_body import middle

Bools = NDArray[np.bool_]

MOTION_ROUNDS: Final = 3
"""How often all remedies are tried in turn."""

SMOOTHING_STRENGTHS: Final = (1.0, 10.0, 100.0, 1000.0)
"""Of smoothing, least first."""

LASTING_SHARE: Final = 0.5
"""Of the most by which a body goes aside, what is left of it after a step that lasts."""

NEAR_END_FRAMES: Final = 4
"""Frames from an end of a clip within which it is not told by its neighbours which of them is off."""

USUAL_RATE: Final = 30.0
"""Frames a second of motion whose rate is not known."""

FEET_OF_SIDES: Final = tuple(
    tuple(CLIP_MARKS.index(name) for name in (f"{side}_toe", f"{side}_ankle")) for side in ("right", "left")
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Rejected:
    """What checks over time reject of a clip.

    Parameters
    ----------
    judgements : mapping
        By the name of the check.
    count : int
        Frames that some of them rejects, each check's counted.
    """

    judgements: Mapping[str, Judgement]
    count: int

    def frames(self, *checks: str) -> Bools | None:
        """Return which frames some of these checks reject (T,); None where none does."""
        found = [self.judgements[name].violated.any(axis=1) for name in checks if name in self.judgements]
        every = np.logical_or.reduce(found) if found else None
        return every if every is not None and every.any() else None

    def places(self, names: Sequence[str], *checks: str) -> Bools | None:
        """Return which frames and places of these names they reject (T, K); all where a place has another name."""
        frames = self.frames(*checks)
        if frames is None:
            return None
        out = np.zeros((len(frames), len(names)), dtype=np.bool_)
        for check in checks:
            if check not in self.judgements:
                continue
            one = self.judgements[check]
            for k, where in enumerate(one.where):
                columns = [names.index(where)] if where in names else list(range(len(names)))
                out[:, columns] |= one.violated[:, k, None]
        return out


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionRepair(ShortRepr):
    """A motion as far as it is repaired.

    Parameters
    ----------
    points : array (T, 23, 3)
        In the order of `posekit.remedy.exchange.CLIP_MARKS`.
    time : array (T,)
        Seconds, in the order of the frames.
    steps : list of (str, array (T, 14))
        What was done, and how far each joint moved, metres.
    """

    points: Array
    time: Array
    steps: list[tuple[str, Array]]


def clip_points(clip: MotionClip) -> Array:
    """Return all points of a clip (T, 23, 3)."""
    return np.concatenate([clip.joints, clip.head, clip.feet], axis=1)


def clip_with(clip: MotionClip, points: Array) -> MotionClip:
    """Return a clip with other points."""
    joints, head, feet = np.split(points, [len(JOINTS), len(POINTS)], axis=1)
    return replace(clip, joints=joints, head=head, feet=feet)


def repair_over_time(clip: MotionClip, validator: Validator, person: MeasuredPerson | None) -> MotionRepair:
    """Undo what checks over time reject, as far as that lessens what they reject."""
    points, steps = clip_points(clip), _Steps([])
    found = _rejected(validator, clip)
    for tried in _in_order(clip, found):
        there = _rejected(validator, tried)
        if there.count < found.count:
            new = clip_points(tried)
            steps.add("reordered", points, new)
            clip, points, found = tried, new, there
            break
    for _ in range(MOTION_ROUNDS):
        before = found.count
        for name, remedy in MOTION_REMEDIES:
            if not found.count:
                break
            whose = person or measured_person(points[:, : len(JOINTS)])
            for new in remedy(clip_with(clip, points), points, found, whose):
                there = _rejected(validator, clip_with(clip, new))
                if there.count < found.count:
                    steps.add(name, points, new)
                    points, found = new, there
                    break
        if found.count >= before or not found.count:
            break
    return MotionRepair(points=points, time=clip.time, steps=steps.taken)


class _Steps(NamedTuple):
    """What was done, and how far each joint moved (T, 14), metres."""

    taken: list[tuple[str, Array]]

    def add(self, name: str, before: Array, after: Array) -> None:
        way = np.nan_to_num(np.linalg.norm(after - before, axis=-1))
        self.taken.append((name, way[:, : len(JOINTS)]))


def _in_order(clip: MotionClip, found: Rejected) -> Iterator[MotionClip]:
    """Put frames in the order of their times or, where these are in order, of the motion."""
    if found.frames("timing") is None:
        return
    if (np.diff(clip.time) < 0).any():
        order = np.argsort(clip.time, kind="stable")
        yield replace(clip_with(clip, clip_points(clip)[order]), time=clip.time[order])
        return
    one = found.judgements["timing"]
    if "order" not in one.where:
        return
    away = np.nan_to_num(one.value[:, one.where.index("order")])
    for sign in (-1.0, 1.0):
        order = np.argsort(np.arange(len(clip)) + sign * away, kind="stable")
        yield clip_with(clip, clip_points(clip)[order])


def _rejected(validator: Validator, clip: MotionClip) -> Rejected:
    judged = judge_motion(validator.profile.checks, clip).judgements
    names = {one.check.replace("_", "-"): one for one in judged}
    return Rejected(judgements=names, count=sum(int(one.violated.any(axis=1).sum()) for one in judged))


Remedy = Callable[[MotionClip, Array, Rejected, MeasuredPerson], Sequence[Array]]
"""From a clip, its points, what is rejected and whose body it is to points that may be better, the best first."""


def _exchange(clip: MotionClip, points: Array, found: Rejected, person: MeasuredPerson) -> Sequence[Array]:
    del clip, person
    bad = found.frames("swap")
    return [] if bad is None else [exchanged(points, bad)]


def _interpolate(clip: MotionClip, points: Array, found: Rejected, person: MeasuredPerson) -> Sequence[Array]:
    """Interpolate jumps of joints, jumps of the body, and frames that stand still."""
    del clip, person
    tried = []
    still = found.frames("frozen", "repeated")
    if still is not None:
        tried.append(_whole(points, still))
    jumps = found.places(JOINTS, "teleport")
    if jumps is not None:
        for bad in (jumps, jumps & np.roll(jumps, -1, axis=0), jumps & ~np.roll(jumps, 1, axis=0)):
            whole = _whole(points, np.asarray(bad.any(axis=1)))
            some, own = points.copy(), np.concatenate([bad, np.zeros((len(bad), 9), dtype=bool)], axis=1)
            some[own] = whole[own]
            tried += [some, whole]
    return tried


def _whole(points: Array, bad: Bools) -> Array:
    out = points.copy()
    out[:, : len(POINTS)] = interpolated(points[:, : len(POINTS)], bad)
    return feet_along(points, out)


def _step_back(clip: MotionClip, points: Array, found: Rejected, person: MeasuredPerson) -> Sequence[Array]:
    """Take out steps of the whole body that last: between their frames there is nothing to interpolate."""
    del clip, person
    if found.frames("teleport") is None:
        return []
    one = found.judgements["teleport"]
    body = [k for k, where in enumerate(one.where) if where not in JOINTS]
    bad = np.asarray(one.violated[:, body].any(axis=1))
    out = _stepped_back(points, bad)
    return [] if out is points else [out]


def _stepped_back(points: Array, bad: Bools) -> Array:
    """Move a body that goes aside for good so that it goes on where it went before; as many frames as may be stay.

    At an end of the clip, where it is not known how the body went on one of the sides, the other side says it.
    """
    way = np.zeros((len(points), 3))
    way[1:] = np.nan_to_num(middle(np.diff(points[:, : len(JOINTS)], axis=0)))
    aside = np.zeros_like(way)
    for found in runs(bad):
        start, stop = _jumped(way, *found)
        known = [way[k] for k in (start - 1, stop) if 1 <= k < len(points)]
        if not known:
            continue
        off = np.cumsum(way[start:stop] - np.mean(known, axis=0), axis=0)
        if np.linalg.norm(off[-1]) < LASTING_SHARE * np.linalg.norm(off, axis=1).max():
            continue
        aside[start:stop] += off
        aside[stop:] += off[-1]
    if not aside.any():
        return points
    _, where, count = np.unique(aside.round(6), axis=0, return_index=True, return_counts=True)
    return np.asarray(points - (aside - aside[where[np.argmax(count)]])[:, None])


def _jumped(way: Array, start: int, stop: int) -> tuple[int, int]:
    """Return the frames in which a body jumped: near an end of the clip its neighbours do not tell, its ways do."""
    first = 1 if start <= NEAR_END_FRAMES else start
    after = len(way) if stop >= len(way) - NEAR_END_FRAMES else max(stop, first + 1)
    if (first, after) == (start, stop):
        return start, stop
    around = way[max(first - NEAR_END_FRAMES, 1) : after + NEAR_END_FRAMES]
    frame = first + int(np.argmax(np.linalg.norm(way[first:after] - np.median(around, axis=0), axis=1)))
    return frame, frame + 1


def _lengthen(clip: MotionClip, points: Array, found: Rejected, person: MeasuredPerson) -> Sequence[Array]:
    del clip
    bad = found.places(SEGMENT_NAMES, "drift")
    return [] if bad is None else [with_lengths(points, bad, person.lengths)]


def _smooth(clip: MotionClip, points: Array, found: Rejected, person: MeasuredPerson) -> Sequence[Array]:
    del clip, person
    bad = found.places(JOINTS, "jitter", "acceleration", "jerk")
    if bad is None:
        return []
    loose = np.concatenate([bad, np.repeat(np.asarray(bad.any(axis=1))[:, None], 9, axis=1)], axis=1)
    if not bad.all(axis=1).any():
        loose[:, len(JOINTS) :] = False
    tried = []
    for strength in SMOOTHING_STRENGTHS:
        out = points.copy()
        for mark in np.flatnonzero(loose.any(axis=0)).tolist():
            if np.isfinite(out[:, mark]).all():
                out[:, mark] = smoothed(out[:, mark], loose[:, mark], strength)
        tried.append(out)
    return tried


def _shift(clip: MotionClip, points: Array, found: Rejected, person: MeasuredPerson) -> Sequence[Array]:
    del person
    if clip.up is None:
        return []
    height = np.zeros(len(points))
    for check in ("floating", "penetration"):
        if check in found.judgements:
            one = found.judgements[check]
            height = np.where(one.violated[:, 0], one.value[:, 0], height)
    if not height.any():
        return []
    return [
        grounded(points, height, height != 0, clip.up, clip.rate if np.isfinite(clip.rate) else USUAL_RATE)
    ]


def _hold(clip: MotionClip, points: Array, found: Rejected, person: MeasuredPerson) -> Sequence[Array]:
    del person
    sides = ("right", "left")
    frames = found.frames("sliding", "skating")
    if frames is None or clip.up is None:
        return []
    bad = np.zeros((len(points), 2), dtype=np.bool_)
    for check in ("sliding", "skating"):
        if check not in found.judgements:
            continue
        one = found.judgements[check]
        for k, where in enumerate(one.where):
            for side, name in enumerate(sides):
                if name in where or not any(other in where for other in sides):
                    bad[:, side] |= one.violated[:, k]
    return [held_feet(points, FEET_OF_SIDES, bad, clip.up)]


def feet_along(before: Array, after: Array) -> Array:
    """Move toes and heels (T, 23, 3) as their ankles were moved: `after` is changed and returned."""
    for k, name in enumerate(FEET_POINTS):
        ankle = JOINT[f"{name.split('_')[0]}_ankle"]
        after[:, len(POINTS) + k] += after[:, ankle] - before[:, ankle]
    return after


MOTION_REMEDIES: Final[Sequence[tuple[str, Remedy]]] = (
    ("exchanged", _exchange),
    ("lengthened", _lengthen),
    (SHIFTED_BACK, _step_back),
    ("interpolated", _interpolate),
    ("smoothed", _smooth),
    ("shifted", _shift),
    ("held", _hold),
)
"""In the order in which they are tried: labels first, then single frames, then spans."""
