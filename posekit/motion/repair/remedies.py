"""Remedies for defects of motion; a remedy's result is kept only if it reduces the findings of checks of motion."""

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

#: Number of times that all remedies are tried in turn.
ROUNDS: Final = 3
#: Weight of a finding that explains findings of other checks, such as a jump; other findings have weight one.
CAUSE_WEIGHT: Final = 3
#: Strengths of smoothing (dimensionless), smallest first.
STRENGTHS: Final = (1.0, 10.0, 100.0, 1000.0)
#: Numbers of frames before and after a rejected span that are smoothed with it.
AROUND_FRAMES: Final = (0, 3, 10)
#: Minimum ratio of final to largest displacement of a step of the whole body that lasts.
LASTING_SHARE: Final = 0.5
#: Displacements below this share of the largest displacement are treated as zero: the body has stepped back.
SAME_PLACE_SHARE: Final = 0.15
#: Number of frames before and after a rejected span in which lengths are corrected, too.
RAMP_FRAMES: Final = 6
#: Relative deviation of a length below which it is not corrected.
SEEN_SHARE: Final = 2e-3
#: Largest shift to the ground, metres: a body that is farther away is treated as not standing on it.
MOST_SHIFT_METRES: Final = 0.5
#: Distance inside its bound to which a body is lifted or lowered, metres.
CLEARANCE_METRES: Final = 2e-6
FEET_AND_HEAD: Final = ("toe", "heel", "eye", "ear")
#: Parts of names of the points that are exchanged together with a pair of joints.
PARTS_OF_PAIRS: Final = {"ankle": ("ankle", "toe", "heel"), "shoulder": ("shoulder", "eye", "ear")}
#: Points that are tried for measuring the slide of each foot, in this order.
FOOT_POINTS: Final = tuple((NAMES.index(f"{side}_toe"), NAMES.index(f"{side}_ankle")) for side in SIDES)

#: Function of a clip and its report; it yields candidates for a better clip.
Remedy = Callable[[Clip, Report], Iterator[Clip]]


def mended(clip: Clip, *, filled: bool = False) -> Clip:
    """Return a clip with fewer findings.

    First, remedies for frame order, exchanged labels and jumps are tried, and rejected postures are replaced. Wrong
    postures also cause trembling and sliding, so all remedies are tried only then. Finally, rejected postures are
    replaced again. If `filled`, rejected frames and unknown points are interpolated before these steps.
    """
    if not clip.motion.in_time or not clip.checks(over_time=True):
        return clip.legal()
    if filled:
        report = clip.validator.check(clip.as_motion())
        clip = clip.interpolated(binary_dilation(report.invalid))
        whole = clip.interpolated(~report.ok)
        clip = replace(whole, state=np.where(np.isfinite(clip.state), clip.state, whole.state))
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
    """Return the weighted number of rejected frames, summed over checks; see `CAUSE_WEIGHT`."""
    pairs = np.unique(np.stack([report.findings["check"], report.findings["row"]]), axis=1)
    return sum(1 if rank_of(report.checks[k]) else CAUSE_WEIGHT for k in pairs[0])


def _numbers(report: Report, check: str, place: str, column: str = "value") -> Array:
    """Return a column of the findings of one check at one place, by frame (T,); 0 in frames without a finding."""
    found, out = report.findings, np.zeros(len(report))
    if check in report.checks and place in report.places:
        mine = (found["check"] == report.checks.index(check)) & (found["place"] == report.places.index(place))
        out[found["row"][mine]] = found[column][mine]
    return out


def _reorder(clip: Clip, report: Report) -> Iterator[Clip]:
    """Sort frames by their times; if they are sorted, try other orders, or fill missing frames."""
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
    """Exchange the labels right and left of pairs of joints in rejected frames, or of all points in all frames."""
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
    """Give segments of drifting length their median length in the other frames, and move the joints beyond them."""
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
    """Undo sudden permanent displacements of the whole body, which interpolation cannot remove.

    The frames before or after the displacement are shifted, such that as many frames as possible are unchanged.
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
    """Return the shift (T, 3) that undoes displacements `aside` (T, 3) and is zero in as many frames as possible."""
    _, where, count = np.unique(aside.round(6), axis=0, return_index=True, return_counts=True)
    return np.asarray(aside[where[np.argmax(count)]] - aside)


def _interpolate(clip: Clip, report: Report) -> Iterator[Clip]:
    """Interpolate frozen frames, and frames or single joints that jump."""
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
    """Smooth points that jitter or are too fast, more strongly in clips that were smoothed before."""
    checks = ["jitter", "speed", "acceleration", "jerk", "joint-velocity"]
    if rejected(report, "teleport").sum() > 1:  # several jumps near each other are jitter
        checks.append("teleport")
    loose = rejected(report, *checks, places=clip.entries)
    strengths = STRENGTHS[min(clip.done.count("smoothed"), len(STRENGTHS) - 1) :]
    for frames in AROUND_FRAMES if loose.any() else ():
        around = np.ones((2 * frames + 1, 1), dtype=np.bool_)
        yield from (clip.smoothed(binary_dilation(loose, around), strength) for strength in strengths)


def _shift(clip: Clip, report: Report) -> Iterator[Clip]:
    """Lift a body from below the ground, or lower a floating body: by one shift for a whole span, or frame by frame."""
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
    """Move the body along the ground so that a standing foot does not slide.

    The frames after the slide are shifted by its length; if there are fewer frames before the slide, these are shifted.
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


#: Remedies in the order in which they are tried: order and labels first, then single frames, then spans.
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
#: Number of the remedies that are tried before rejected postures are replaced.
N_CAUSES: Final = 5
