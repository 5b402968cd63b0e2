"""Remedies for what checks over time reject: each is kept where it lessens what they reject."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, median_filter, uniform_filter1d

from posekit.geometry import Array, runs
from posekit.motion.motion import NAMES
from posekit.motion.repair.clip import Clip, RobotClip, rejected
from posekit.motion.repair.pieces import PIECE_PARENTS
from posekit.skeleton import JOINTS, LIMB_SEGMENTS, SIDES, other_side, segment_name
from posekit.validators.check import Judgement
from posekit.validators.motion.sides import SIDE_PAIRS
from posekit.validators.report import CAUSES

Bools = NDArray[np.bool_]

#: Times that all remedies are tried in turn.
MOTION_ROUNDS: Final = 3
#: Findings of other checks that one of a cause is worth.
CAUSE_WEIGHT: Final = 3
#: Strengths of smoothing, least first.
STRENGTHS: Final = (1.0, 10.0, 100.0, 1000.0)
#: Frames around several jumps that are smoothed together.
TREMBLING_FRAMES: Final = 10
#: Frames around joints that are too fast that are smoothed.
WIDER_FRAMES: Final = (3, 10)
#: Share of the largest displacement that remains of a step that lasts.
LASTING_SHARE: Final = 0.5
#: Share of the largest displacement below which a body that stepped aside and back is where it was.
SAME_PLACE_SHARE: Final = 0.15
#: Frames a second of motion whose rate is not known.
USUAL_RATE: Final = 30.0
#: Frames before and after a span over which a length may have drifted there.
RAMP_FRAMES: Final = 6
#: Share of a length below which it has not drifted.
SEEN_SHARE: Final = 2e-3
#: Seconds over which the height by which a body is shifted changes.
SMOOTH_SECONDS: Final = 0.3
#: Largest shift, metres: a body that is farther from the ground is not meant to stand on it.
MOST_SHIFT_METRES: Final = 0.5
#: Distance inside its bound to which a body is lifted or lowered.
CLEARANCE_METRES: Final = 2e-6
FEET_AND_HEAD: Final = ("toe", "heel", "eye", "ear")
#: Points that are exchanged with a pair of joints.
PARTS_OF_PAIRS: Final = {"ankle": ("ankle", "toe", "heel"), "shoulder": ("shoulder", "eye", "ear")}
#: Points by which each foot is held, the best first.
FOOT_POINTS: Final = tuple((NAMES.index(f"{side}_toe"), NAMES.index(f"{side}_ankle")) for side in SIDES)


@dataclass(frozen=True, kw_only=True, eq=False)
class Rejected:
    """What checks over time reject in a clip: judgements by check, and their rejected frames, counted.

    Frames that a cause explains are left out of what other checks judge, so a cause counts as several findings.
    """

    judgements: Mapping[str, Judgement]
    count: int

    @classmethod
    def of(cls, clip: Clip) -> Rejected:
        """Judge a clip."""
        found = {name: one for name, (_, one) in clip.judged(over_time=True).items()}
        count = {name: int(one.violated.any(axis=1).sum()) for name, one in found.items()}
        weighed = sum(number * (CAUSE_WEIGHT if name in CAUSES else 1) for name, number in count.items())
        return cls(judgements=found, count=weighed)

    def frames(self, *checks: str) -> Bools | None:
        """Return the frames that some of these checks reject (T,); None if there are none."""
        found = [self.judgements[name] for name in checks if name in self.judgements]
        every = rejected(found) if found else np.zeros(1, dtype=np.bool_)
        return every if every.any() else None

    def places(self, names: Sequence[str], *checks: str) -> Bools | None:
        """Return the frames and places of these names (T, K); all places where a finding has another name."""
        frames = self.frames(*checks)
        if frames is None:
            return None
        out = np.zeros((len(frames), len(names)), dtype=np.bool_)
        for one in (self.judgements[check] for check in checks if check in self.judgements):
            for k, place in enumerate(one.places):
                columns = [names.index(place)] if place in names else list(range(len(names)))
                out[:, columns] |= one.violated[:, k, None]
        return out


#: From a clip and what is rejected of it to clips that may be better.
Remedy = Callable[[Clip, Rejected], Iterator[Clip]]


def mended(clip: Clip, *, causes: bool = False) -> tuple[Clip, list[str]]:
    """Undo what checks over time reject, as far as that lessens what they reject.

    Parameters
    ----------
    clip : Clip
    causes : bool
        Try remedies of labels and single frames alone: wrong postures tremble, and their feet slide.

    Returns
    -------
    clip : Clip
    done : list of str
        Names of the remedies that helped.
    """
    found, done = Rejected.of(clip), []
    for _ in range(MOTION_ROUNDS):
        before = found.count
        for name, remedy in REMEDIES[: N_CAUSES if causes else None]:
            if not found.count:
                break
            better = [(Rejected.of(tried), tried) for tried in remedy(clip, found)]
            best = min(better, key=lambda pair: pair[0].count, default=None)
            if best is not None and best[0].count < found.count:
                found, clip = best
                done.append(name)
        if found.count >= before or not found.count:
            break
    return clip, done


def _reorder(clip: Clip, found: Rejected) -> Iterator[Clip]:
    """Put frames in the order of their times or, where these are in order, of the motion; fill gaps in time."""
    if found.frames("timing") is None:
        return
    one, step = found.judgements["timing"], np.diff(clip.time)
    if (step < 0).any():
        order = np.argsort(clip.time, kind="stable")
        yield clip.taken(order, clip.time[order])
        return
    place = np.nan_to_num(one.value[:, one.places.index("order")])
    if place.any():
        for sign in (-1.0, 1.0):
            yield clip.taken(np.argsort(np.arange(len(clip)) + sign * place, kind="stable"), clip.time)
    gaps = np.round(np.nan_to_num(one.value[:, one.places.index("missing")])).astype(np.intp)
    if (gaps > 0).any():
        yield clip.with_gaps(np.maximum(gaps, 0))


def _exchange(clip: Clip, found: Rejected) -> Iterator[Clip]:
    """Exchange right and left: the pairs that are named, in their frames, or everything in all frames."""
    if found.frames("swap") is None or isinstance(clip, RobotClip):
        return
    pairs = found.judgements["swap"].violated
    out = clip.state.copy()
    for k, pair in enumerate(SIDE_PAIRS):
        order = _exchanged_order(PARTS_OF_PAIRS.get(pair, (pair,)))
        out[pairs[:, k]] = out[pairs[:, k]][:, order]
    yield replace(clip, state=out, mirrored=bool(pairs.all()) != clip.mirrored)
    every = clip.state[:, _exchanged_order((*SIDE_PAIRS, *FEET_AND_HEAD))]
    yield replace(clip, state=every, mirrored=not clip.mirrored)


def _exchanged_order(parts: Sequence[str]) -> NDArray[np.intp]:
    names = [other_side(name) if any(part in name for part in parts) else name for name in NAMES]
    return np.array([NAMES.index(name) for name in names])


def _lengthen(clip: Clip, found: Rejected) -> Iterator[Clip]:
    """Give drifting segments of limbs their lengths; the joints behind them move along."""
    names = tuple(map(segment_name, LIMB_SEGMENTS))
    bad = found.places(names, "drift")
    if bad is None or isinstance(clip, RobotClip):
        return
    lengths, out = clip.body().person.lengths, clip.state.copy()
    for k, (start, end) in enumerate(LIMB_SEGMENTS):
        spans = np.zeros(len(clip), dtype=np.bool_)
        for first, stop in runs(bad[:, k]):
            spans[max(first - RAMP_FRAMES, 0) : stop + RAMP_FRAMES] = True
        usual = lengths.get(names[k], np.nan)
        vector = out[:, end] - out[:, start]
        length = np.linalg.norm(vector, axis=-1)
        off = spans & (np.abs(length - usual) > SEEN_SHARE * usual)
        way = vector[off] * (usual / length[off] - 1)[:, None]
        behind = {end}  # parents come before their points
        for point in range(len(NAMES)):
            if point == end or PIECE_PARENTS[point] in behind:
                behind.add(point)
                out[off, point] += way
    yield replace(clip, state=out)


def _step_back(clip: Clip, found: Rejected) -> Iterator[Clip]:
    """Take out steps of the whole body that last: between their frames there is nothing to interpolate.

    The body goes on where it went before, and as many frames as possible stay.
    """
    if found.frames("teleport") is None:
        return
    one = found.judgements["teleport"]
    bad = np.asarray(one.violated[:, one.places.index("body")])
    way, aside = np.zeros((len(clip), 3)), np.zeros((len(clip), 3))
    way[1:] = np.nan_to_num(np.nanmedian(np.diff(clip.points()[:, : len(JOINTS)], axis=0), axis=1))
    for start, stop in runs(bad):
        known = [way[k] for k in (start - 1, stop) if 1 <= k < len(clip)]
        if not known:
            continue
        off = np.cumsum(way[start:stop] - np.mean(known, axis=0), axis=0)
        if np.linalg.norm(off[-1]) >= LASTING_SHARE * np.linalg.norm(off, axis=1).max():
            aside[start:stop] += off
            aside[stop:] += off[-1]
    if aside.any():
        far = np.linalg.norm(aside, axis=1)
        aside[far < SAME_PLACE_SHARE * far.max()] = 0.0
        yield clip.shifted(_most_stay(aside))


def _most_stay(aside: Array) -> Array:
    """Return the shift (T, 3) that undoes displacements, such that as many frames as possible stay."""
    _, where, count = np.unique(aside.round(6), axis=0, return_index=True, return_counts=True)
    return np.asarray(aside[where[np.argmax(count)]] - aside)


def _interpolate(clip: Clip, found: Rejected) -> Iterator[Clip]:
    """Interpolate frames that stand still, jumps of joints, and jumps of the body."""
    still = found.frames("frozen", "repeated")
    if still is not None:
        yield clip.interpolated(still)
    jumps = found.places(JOINTS, "teleport")
    if jumps is None:
        return
    for bad in (jumps & ~np.roll(jumps, 1, axis=0), jumps & np.roll(jumps, -1, axis=0), jumps):
        rows = np.asarray(bad.any(axis=1))
        if rows.any():
            whole = clip.interpolated(rows)
            yield whole
            if not isinstance(clip, RobotClip):
                some = clip.state.copy()
                own = np.concatenate([bad, np.zeros((len(bad), len(NAMES) - len(JOINTS)), bool)], axis=1)
                some[own] = whole.state[own]
                yield replace(clip, state=some)


def _smooth(clip: Clip, found: Rejected) -> Iterator[Clip]:
    """Smooth trembling, and motion that is too fast, by as little as helps most."""
    loose: list[tuple[Bools | None, Sequence[str]]] = []
    loose.append((found.places(JOINTS, "jitter", "speed", "acceleration", "jerk"), JOINTS))
    jumps = found.frames("teleport")
    if jumps is not None and jumps.sum() > 1:  # several jumps near each other are trembling
        loose.append((_wider(jumps, TREMBLING_FRAMES, len(JOINTS)), JOINTS))
    names = clip.robot.configuration_names if isinstance(clip, RobotClip) else ()
    bad = found.places(names, "joint-velocity") if names else None
    if bad is not None:
        fast = [name for name, one in zip(names, bad.T, strict=True) if one.any()]
        some = np.asarray(bad.any(axis=1))
        loose += [(_wider(some, half, len(fast)), fast) for half in WIDER_FRAMES]
    for where, places in loose:
        if where is not None:
            yield from (clip.smoothed(where, places, strength) for strength in STRENGTHS)


def _wider(frames: Bools, half: int, count: int) -> Bools:
    """Return frames (T,) and those up to `half` from them, for `count` places (T, K)."""
    return np.repeat(binary_dilation(frames, iterations=half)[:, None], count, axis=1)


def _shift(clip: Clip, found: Rejected) -> Iterator[Clip]:
    """Lift and lower the body by what it is below or above the ground, evenly over time or frame by frame."""
    up = clip.body().up
    if up is None:
        return
    height, excess = np.zeros(len(clip)), np.zeros(len(clip))
    for check in ("floating", "penetration"):
        if check in found.judgements:
            one = found.judgements[check]
            bad = np.asarray(one.violated[:, 0])
            height = np.where(bad, one.value[:, 0], height)
            sign = np.where(one.value[:, 0] < 0, -1.0, 1.0)
            excess = np.where(bad, sign * (CLEARANCE_METRES - one.margin[:, 0]), excess)
    if not height.any():
        return
    rate = clip.motion.rate or USUAL_RATE
    width = max(int(SMOOTH_SECONDS * rate) | 1, 1)
    ways = np.zeros((4, len(clip)))
    for start, stop in runs(height != 0):
        span = height[start:stop]
        if np.abs(np.median(span)) <= MOST_SHIFT_METRES:
            smooth = uniform_filter1d(median_filter(span, width, mode="nearest"), width, mode="nearest")
            even = np.full(len(span), span[np.argmax(np.abs(span))])
            ways[:, start:stop] = -np.stack([smooth, even, span, excess[start:stop]])
    yield from (clip.shifted(one[:, None] * up) for one in ways)
    whole = -height[np.argmax(np.abs(height))]
    if abs(whole) <= MOST_SHIFT_METRES:
        yield clip.shifted(np.full((len(clip), 1), whole) * up)


def _hold(clip: Clip, found: Rejected) -> Iterator[Clip]:
    """Move the body along the ground against the slide of standing feet, evenly or frame by frame.

    The frames after the slide go on from where it then ends, or those before it lead to where it begins.
    """
    up = clip.body().up
    if found.frames("sliding", "skating") is None or up is None:
        return
    bad = np.zeros((len(clip), 2), dtype=np.bool_)
    for one in (found.judgements[check] for check in ("sliding", "skating") if check in found.judgements):
        for k, place in enumerate(one.places):
            for side, name in enumerate(SIDES):
                if name in place or not any(other in place for other in SIDES):
                    bad[:, side] |= one.violated[:, k]
    points = clip.points()
    slip = np.full((len(clip), 2, 3), np.nan)
    for side, candidates in enumerate(FOOT_POINTS):
        known = [k for k in candidates if np.isfinite(points[:, k]).all()]
        if known:
            way = np.diff(points[:, known[0]], axis=0, prepend=points[:1, known[0]])
            slip[:, side] = way - (way @ up)[:, None] * up
    slip[~bad] = np.nan
    length = np.nan_to_num(np.linalg.norm(slip, axis=-1), nan=np.inf)
    stands = np.argmin(length, axis=1)  # of two feet that slide, the slower one stands
    slow = np.nan_to_num(slip[np.arange(len(clip)), stands])
    even = np.zeros_like(slow)
    for start, stop in runs(np.asarray(bad.any(axis=1))):
        even[start:stop] = np.median(slow[start:stop], axis=0)
    yield from (clip.shifted(_most_stay(np.cumsum(step, axis=0))) for step in (even, slow))


#: In the order in which they are tried: order and labels first, then single frames, then spans.
REMEDIES: Final[Sequence[tuple[str, Remedy]]] = (
    ("reordered", _reorder),
    ("exchanged", _exchange),
    ("lengthened", _lengthen),
    ("stepped back", _step_back),
    ("interpolated", _interpolate),
    ("smoothed", _smooth),
    ("shifted", _shift),
    ("held", _hold),
)
#: Number of the first remedies, of what breaks single frames.
N_CAUSES: Final = 5
