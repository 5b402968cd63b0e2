"""Remedies for what checks reject: each is kept where it lessens what checks over time reject."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.ndimage import binary_dilation

from posekit.body.pieces import placed, vectors_of
from posekit.geometry import Array, Ints, runs
from posekit.motion.repair.clip import Clip, RobotClip, rejected
from posekit.skeleton import JOINTS, LIMB_SEGMENTS, NAMES, SIDES, other_side, segment_name
from posekit.validators.motion.sides import SIDE_PAIRS
from posekit.validators.report import Report, rank_of

#: Times that all remedies are tried in turn.
ROUNDS: Final = 3
#: Findings of other checks that one of a cause is worth.
CAUSE_WEIGHT: Final = 3
#: Strengths of smoothing, least first.
STRENGTHS: Final = (1.0, 10.0, 100.0, 1000.0)
#: Frames before and after those that tremble or are too fast that are smoothed with them.
AROUND_FRAMES: Final = (0, 3, 10)
#: Share of the largest displacement that remains of a step that lasts.
LASTING_SHARE: Final = 0.5
#: Share of the largest displacement below which a body that stepped aside and back is where it was.
SAME_PLACE_SHARE: Final = 0.15
#: Frames before and after a span over which a length may have drifted there.
RAMP_FRAMES: Final = 6
#: Share of a length below which it has not drifted.
SEEN_SHARE: Final = 2e-3
#: Largest shift, metres: a body that is farther from the ground is not meant to stand on it.
MOST_SHIFT_METRES: Final = 0.5
#: Distance inside its bound to which a body is lifted or lowered.
CLEARANCE_METRES: Final = 2e-6
FEET_AND_HEAD: Final = ("toe", "heel", "eye", "ear")
#: Points that are exchanged with a pair of joints.
PARTS_OF_PAIRS: Final = {"ankle": ("ankle", "toe", "heel"), "shoulder": ("shoulder", "eye", "ear")}
#: Points by which each foot is held, the best first.
FOOT_POINTS: Final = tuple((NAMES.index(f"{side}_toe"), NAMES.index(f"{side}_ankle")) for side in SIDES)

#: From a clip and what is rejected of it to clips that may be better.
Remedy = Callable[[Clip, Report], Iterator[Clip]]


def mended(clip: Clip, *, filled: bool = False) -> Clip:
    """Undo what checks reject.

    Remedies of labels and single frames are tried first, then postures are made legal, then all remedies are tried:
    wrong postures tremble, and their feet slide. If `filled`, the rejected frames are interpolated before.
    """
    if not clip.motion.in_time or not clip.checks(over_time=True):
        return clip.legal()
    if filled:
        clip = clip.interpolated(binary_dilation(~clip.validator.check(clip.as_motion()).ok))
    for remedies in (REMEDIES[:N_CAUSES], REMEDIES):
        clip = _mended_over_time(clip, remedies).legal()
    return clip


def _mended_over_time(clip: Clip, remedies: Sequence[tuple[str, Remedy]]) -> Clip:
    report = clip.report(over_time=True)
    for _ in range(ROUNDS):
        before = _count(report)
        for name, remedy in remedies:
            tried = [(one, one.report(over_time=True)) for one in remedy(clip, report)]
            best, found = min(tried, key=lambda pair: _count(pair[1]), default=(clip, report))
            if _count(found) < _count(report):
                clip, report = replace(best, done=(*clip.done, name)), found
        if _count(report) in (0, before):
            break
    return clip


def _count(report: Report) -> int:
    """Count rejected frames check by check; one of a cause, which hides others, as several."""
    pairs = np.unique(np.stack([report.findings["check"], report.findings["row"]]), axis=1)
    return sum(1 if rank_of(report.checks[k]) else CAUSE_WEIGHT for k in pairs[0])


def _numbers(report: Report, check: str, place: str, column: str = "value") -> Array:
    """Return a number of the findings of a check at a place (T,); 0 in frames without any."""
    found, out = report.findings, np.zeros(len(report))
    if check in report.checks and place in report.places:
        mine = (found["check"] == report.checks.index(check)) & (found["place"] == report.places.index(place))
        out[found["row"][mine]] = found[column][mine]
    return out


def _reorder(clip: Clip, report: Report) -> Iterator[Clip]:
    """Put frames in the order of their times or, where these are in order, of the motion; fill gaps in time."""
    if not rejected(report, "timing").any():
        return
    if (np.diff(clip.time) < 0).any():
        order = np.argsort(clip.time, kind="stable")
        yield clip.taken(order, clip.time[order])
        return
    place, gaps = (_numbers(report, "timing", name) for name in ("order", "missing"))
    for sign in (-1.0, 1.0):
        yield clip.taken(np.argsort(np.arange(len(clip)) + sign * place, kind="stable"), clip.time)
    if (gaps > 0).any():
        yield clip.with_gaps(np.maximum(np.round(gaps), 0).astype(np.intp))


def _exchange(clip: Clip, report: Report) -> Iterator[Clip]:
    """Exchange right and left: the pairs that are named, in their frames, or everything in all frames."""
    pairs = rejected(report, "swap", places=SIDE_PAIRS)
    if not pairs.any():
        return
    out = clip.state.copy()
    for k, pair in enumerate(SIDE_PAIRS):
        order = _exchanged_order(PARTS_OF_PAIRS.get(pair, (pair,)))
        out[pairs[:, k]] = out[pairs[:, k]][:, order]
    yield replace(clip, state=out, mirrored=bool(pairs.all()) != clip.mirrored)
    every = clip.state[:, _exchanged_order((*SIDE_PAIRS, *FEET_AND_HEAD))]
    yield replace(clip, state=every, mirrored=not clip.mirrored)


def _exchanged_order(parts: Sequence[str]) -> Ints:
    names = [other_side(name) if any(part in name for part in parts) else name for name in NAMES]
    return np.array([NAMES.index(name) for name in names])


def _lengthen(clip: Clip, report: Report) -> Iterator[Clip]:
    """Give drifting segments of limbs the lengths that they have elsewhere; the joints behind them move along."""
    bad = rejected(report, "drift", places=[segment_name(one) for one in LIMB_SEGMENTS])
    if not bad.any() or isinstance(clip, RobotClip):
        return
    vectors = vectors_of(clip.state)
    for (_, end), drifting in zip(LIMB_SEGMENTS, bad.T, strict=True):
        length = np.linalg.norm(vectors[:, end], axis=1)
        usual = np.nanmedian(length[~drifting])
        off = binary_dilation(drifting, iterations=RAMP_FRAMES) & (abs(length - usual) > SEEN_SHARE * usual)
        vectors[off, end] *= (usual / length[off])[:, None]
    changed = np.nan_to_num(vectors != vectors_of(clip.state)).any(axis=(1, 2))
    yield clip.with_rows(np.flatnonzero(changed), placed(vectors[changed]))


def _step_back(clip: Clip, report: Report) -> Iterator[Clip]:
    """Undo lasting displacements of the whole body: no frames lie between to interpolate.

    The body goes on where it went before, and as many frames as possible stay.
    """
    bad = _numbers(report, "teleport", "body") != 0
    if not bad.any():
        return
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
    far = np.linalg.norm(aside, axis=1)
    aside[far < SAME_PLACE_SHARE * far.max()] = 0.0
    yield clip.shifted(_most_stay(aside))


def _most_stay(aside: Array) -> Array:
    """Return the shift (T, 3) that undoes displacements, such that as many frames as possible stay."""
    _, where, count = np.unique(aside.round(6), axis=0, return_index=True, return_counts=True)
    return np.asarray(aside[where[np.argmax(count)]] - aside)


def _interpolate(clip: Clip, report: Report) -> Iterator[Clip]:
    """Interpolate frames that stand still, jumps of joints, and jumps of the body."""
    still, jumps = rejected(report, "frozen", "repeated"), rejected(report, "teleport", places=JOINTS)
    if still.any():
        yield clip.interpolated(still)
    for bad in (jumps & ~np.roll(jumps, 1, axis=0), jumps & np.roll(jumps, -1, axis=0), jumps):
        if bad.any():
            whole = clip.interpolated(np.asarray(bad.any(axis=1)))
            yield whole
            if not isinstance(clip, RobotClip):
                own = np.pad(bad, ((0, 0), (0, len(NAMES) - len(JOINTS))))
                yield replace(clip, state=np.where(own[..., None], whole.state, clip.state))


def _smooth(clip: Clip, report: Report) -> Iterator[Clip]:
    """Smooth trembling, and motion that is too fast, by as little as helps most; more if it comes again."""
    checks = ["jitter", "speed", "acceleration", "jerk", "joint-velocity"]
    if rejected(report, "teleport").sum() > 1:  # several jumps near each other are trembling
        checks.append("teleport")
    loose = rejected(report, *checks, places=clip.entries)
    strengths = STRENGTHS[min(clip.done.count("smoothed"), len(STRENGTHS) - 1) :]
    for frames in AROUND_FRAMES if loose.any() else ():
        around = np.ones((2 * frames + 1, 1), dtype=np.bool_)
        yield from (clip.smoothed(binary_dilation(loose, around), strength) for strength in strengths)


def _shift(clip: Clip, report: Report) -> Iterator[Clip]:
    """Lift and lower the body by what it is below or above the ground, evenly or frame by frame."""
    up = clip.motion.up_vector
    low, high = (_numbers(report, check, "lowest") for check in ("penetration", "floating"))
    beyond = [_numbers(report, check, "lowest", "margin") for check in ("penetration", "floating")]
    height = np.where(low != 0, low, high)
    if up is None or not height.any():
        return
    excess = np.where(low != 0, beyond[0], -beyond[1])
    ways = np.zeros((3, len(clip)))
    for start, stop in runs(height != 0):
        span = height[start:stop]
        if np.abs(np.median(span)) <= MOST_SHIFT_METRES:
            even = np.full(len(span), span[np.argmax(np.abs(span))])
            over = excess[start:stop] + CLEARANCE_METRES * np.sign(excess[start:stop])
            ways[:, start:stop] = -np.stack([even, span, over])
    whole = -height[np.argmax(np.abs(height))]
    if abs(whole) <= MOST_SHIFT_METRES:
        ways = np.vstack([ways, np.full(len(clip), whole)])
    yield from (clip.shifted(way[:, None] * up) for way in ways)


def _hold(clip: Clip, report: Report) -> Iterator[Clip]:
    """Move the body along the ground against the slide of standing feet, evenly or frame by frame.

    The frames after the slide go on from where it then ends, or those before it lead to where it begins.
    """
    up = clip.motion.up_vector
    bad = rejected(report, "sliding", "skating", places=[f"{side}_foot" for side in SIDES])
    if not bad.any() or up is None:
        return
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
