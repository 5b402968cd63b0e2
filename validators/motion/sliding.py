r"""Speeds of feet that stand.

A foot that stands flat neither rises nor turns: its ankle and its toes have one velocity, which is 0. In recordings it
is not: skin and markers move, feet roll, and joints lie above the sole; so the speed of the slowest point alone, by
which skating is often measured, calls every other step of a real walk sliding. Real feet never go on evenly: a foot
slides if its points have for a time one velocity, the same from frame to frame, and along the ground.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from posekit.geometry import Array, Flags, norm, perpendicular, runs
from posekit.skeleton import SIDES, both
from posekit.validators.body import Body
from posekit.validators.check import Judgement, check
from posekit.validators.motion.frames import needs_rate
from posekit.validators.motion.ground import LEG_SHARE, ground_of, soles, stature_of, up_of
from posekit.validators.motion.timeline import median_of_five, timeline_of

#: Height above the highest level of the ground up to which a foot is down, metres: a swinging foot's toes clear 1 to 6
#: cm, and are faster.
DOWN_METRES: Final = 0.04

#: Height up to which any joint may carry the body, metres: hands and knees of crawling bodies do.
LOW_METRES: Final = 0.1

#: Toe, heel and ankle of the right foot and of the left one among `posekit.validators.motion.ground.soles`.
FOOT_POINTS: Final = ([0, 2, 4], [1, 3, 5])

#: Unevenness of a slide of several points, at most, as a share of its speed.
EVEN_SHARE: Final = 0.3

#: Speed above which a foot swings, metres a second, if noise hides how uneven a swing is.
SWINGING_SPEED: Final = 1.0

#: Height of the hips above a foot that stands, as a share of the legs' length: crawling bodies drag their feet.
UPRIGHT_SHARE: Final = 0.6

VIDEO_RATE: Final = 29.0
#: Factor of the least duration at fewer frames per second: medians of five frames hide a foot's roll.
SLOW_FACTOR: Final = 2.0

#: Frames per second from which resting feet are visible.
SLIDING_RATE: Final = 15.0


#: Speeds of a drift of the whole body that are looked for, metres a second; real walks have up to 0.04 for a second.
LEAST_DRIFT, LONGEST_DRIFT = 0.05, 1.0

#: Least duration of a drift, and the windows whose median velocity is a candidate for its velocity, seconds.
DRIFT_SECONDS, CANDIDATE_SECONDS = 0.8, 0.4

#: Least share of the slots of a drift in which a foot is down.
KNOWN_SHARE: Final = 0.6

#: Mean distance of velocities from a drift's, as a share of its speed, at most.
DRIFT_FIT: Final = 0.55

#: Share of its speed by which a drift must explain the velocity of each frame better than rest does.
DRIFT_PENALTY: Final = 0.25


@check("sliding", unit="m/s", reads=("joints", "up", "time", "ground"), over_time=True)
def sliding(
    body: Body, *, fastest: float = 0.04, lasting: float = 0.4, uneven: float = 0.02, rising: float = 0.05
) -> Judgement:
    """Feet that stand on the ground slide, or the whole body drifts along it.

    Parameters
    ----------
    fastest : float
        Metres a second that a standing foot may go.
    lasting : float
        Seconds for which it goes on.
    uneven : float
        Metres a second by which velocities of one slide differ at most, between points of the foot and over time.
    rising : float
        Metres a second that a foot on the ground goes up or down at most.
    """
    needs_rate(body, SLIDING_RATE)
    line, up, (feet, height), ground = timeline_of(body), up_of(body), soles(body), ground_of(body)
    hips = body.height[:, both("hip")].min(axis=1)[:, None]
    crawls = hips - feet @ up < UPRIGHT_SHARE * LEG_SHARE * stature_of(body)
    highest = (ground.low + ground.high + ground.lifted)[:, None]
    bearing = line.spread(np.concatenate([feet, body.joints], axis=1))
    over = line.spread(np.concatenate([height, body.height], axis=1) - highest)
    placed = bearing[:, : feet.shape[1]]
    down = line.spread(np.where(crawls, np.nan, height - highest)) < DOWN_METRES
    count = max(3, round(lasting * (SLOW_FACTOR if body.rate < VIDEO_RATE else 1.0) / body.dt))
    noise = 3 * np.sqrt(2) * body.noise / body.dt
    bounds = fastest, uneven, rising, noise
    value = np.zeros((len(placed), len(SIDES)))
    for side, foot in enumerate(FOOT_POINTS):
        points = placed[:, foot]
        for start, stop in runs(_slides(body, points, down[:, foot], count, bounds)):
            known = points[:, np.isfinite(points[start:stop]).all(axis=(0, 2))]
            along = perpendicular((known[stop - 1] - known[start]).mean(axis=0), up)
            speed = float(norm(along)) / ((stop - 1 - start) * body.dt)
            way = (known @ along / norm(along)).mean(axis=1)
            first, last = _ends(np.diff(way) - speed * body.dt / 2, start, stop - 1, count)
            value[first + 1 : last + 1, side] = speed
    drift = _drift(_stance_way(bearing, over < LOW_METRES, up) / body.dt, body.dt)
    if drift is not None and drift[2] > fastest + noise:
        start, stop, speed = drift
        for first, last in runs(np.asarray(value.any(axis=1))):
            if first < stop and last > start:
                value[first:last] = 0.0  # one defect is named once
        value[start:stop] = speed
    return Judgement([f"{side}_foot" for side in SIDES], line.of_frames(value), upper=fastest)


def _slides(
    body: Body, points: Array, down: Flags, count: int, bounds: tuple[float, float, float, float]
) -> Flags:
    """Return the slots (S,) in which a foot (S, 3, 3) slides evenly for at least `count` slots.

    The bounds are those of `sliding` for speed, unevenness and rise, and the noise of a speed, metres a second.
    """
    fastest, uneven, rising, noise = bounds
    up = up_of(body)
    known = np.isfinite(points).all(axis=(0, 2))
    slides = np.zeros(len(points), dtype=np.bool_)
    if not known.any() or len(points) <= max(count, 5):
        return slides
    velocity = median_of_five(np.diff(points[:, known], axis=0) / body.dt)
    level = perpendicular(velocity, up)
    mean = level.mean(axis=1)
    flat = (np.abs(velocity @ up).max(axis=1) < rising + noise) & down[1:, known].any(axis=1)
    flat &= norm(level - mean[:, None]).max(axis=1) < uneven + noise
    windows = sliding_window_view(mean, count, axis=0)
    even = windows.mean(axis=-1)
    differs = norm(np.moveaxis(windows - even[..., None], 1, -1)).max(axis=1)
    share = EVEN_SHARE if known.sum() > 1 else 0.0
    steady = differs < np.maximum(uneven, share * norm(even)) + noise
    steady &= sliding_window_view(flat, count).all(axis=1)
    # Where noise lets feet differ by more than they slide, evenness is not evidence.
    steady &= norm(even) > max(fastest, noise / EVEN_SHARE)
    if noise > uneven:
        steady &= norm(even) < SWINGING_SPEED
    for window in np.flatnonzero(steady):
        slides[window : window + count + 1] = True
    return slides


def _stance_way(points: Array, low: Flags, up: Array) -> Array:
    """Return the way along the ground, since the slot before, of the slowest low point of the body (S, 3), metres.

    Something that carries a body stands still, so that the way is near zero in every slot; NaN in slots without a low
    point.

    Parameters
    ----------
    points : array (S, P, 3)
        Points that may carry the body.
    low : bool array (S, P)
        Whether each point is near the ground.
    up : array (3,)
        Unit vector against gravity.
    """
    ways = perpendicular(np.diff(points, axis=0, prepend=np.nan), up)
    lengths = np.where(low, np.nan_to_num(norm(ways), nan=np.inf), np.inf)
    slowest = np.take_along_axis(ways, lengths.argmin(axis=1)[:, None, None], axis=1)[:, 0]
    return np.where(np.isfinite(lengths.min(axis=1))[:, None], slowest, np.nan)


def _drift(velocity: Array, step: float) -> tuple[int, int, float] | None:
    """Find the stretch of slots in which feet stand with one common velocity: start, stop, and its speed.

    The stretch maximizes the sum over frames of how much better the velocity explains them than rest does (the maximum
    sum of consecutive numbers: Bentley 1984, Commun. ACM 27:865).
    """
    known = np.isfinite(velocity[:, 0])
    count = max(round(CANDIDATE_SECONDS / step), 3)
    at_rest, best, most = norm(velocity), None, 0.0
    for first in range(0, len(velocity) - count, max(count // 2, 1)):
        seen = velocity[first : first + count][known[first : first + count]]
        if len(seen) < KNOWN_SHARE * count:
            continue
        common = np.median(seen, axis=0)
        for _ in range(2):
            speed = float(np.linalg.norm(common))
            if not LEAST_DRIFT < speed < LONGEST_DRIFT:
                break
            gain = np.minimum(at_rest, speed) - np.minimum(norm(velocity - common), speed)
            total = np.concatenate([[0.0], np.cumsum(np.where(known, gain - DRIFT_PENALTY * speed, 0.0))])
            stop = int(np.argmax(total - np.minimum.accumulate(total)))
            start = int(np.argmin(total[: stop + 1]))
            inside = velocity[start:stop][known[start:stop]]
            if len(inside) < max(3, KNOWN_SHARE * (stop - start)):
                break
            common = np.median(inside, axis=0)
            speed = float(np.linalg.norm(common))
            fits = np.minimum(norm(inside - common), speed).mean() < DRIFT_FIT * speed
            worth = float(total[stop] - total[start])
            if fits and (stop - start) * step >= DRIFT_SECONDS and worth > most and speed > LEAST_DRIFT:
                best, most = (start, stop, speed), worth
    return best


def _ends(gained: Array, start: int, stop: int, most: int) -> tuple[int, int]:
    """Move the ends of a slide, outward by at most `most` slots, to where its summed gain (S - 1,) is largest."""
    middle = (start + stop) // 2
    before = np.cumsum(gained[max(start - most, 0) : middle][::-1])
    after = np.cumsum(gained[middle : stop + most])
    return middle - int(np.nanargmax(before)) - 1, middle + int(np.nanargmax(after)) + 1
