r"""Foot slide: standing feet that move with a uniform velocity along the ground.

The points of a standing foot should not move. In recordings they do: skin and markers move, feet roll, and joints lie
above the sole. Published measures of foot skating use the speed of the slowest point, and reject every second step of a
real walk. But the points of a real foot seldom have the same velocity. Here a foot slides if all its points have the
same velocity along the ground for some time. The whole body drifts if all points that carry it have the same velocity.
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

#: Largest height of a standing foot above the highest level of the ground, metres. Toes of a swinging foot are 1 to 6
#: cm above the ground, but are faster.
DOWN_METRES: Final = 0.04

#: Largest height above the ground of joints that may carry the body, metres; they include hands and knees.
LOW_METRES: Final = 0.1

#: Indices of toe, heel and ankle of the right and the left foot in `posekit.validators.motion.ground.soles`.
FOOT_POINTS: Final = ([0, 2, 4], [1, 3, 5])

#: Largest difference between velocities in a slide of several points, as a share of its speed.
EVEN_SHARE: Final = 0.3

#: Largest speed of a slide, metres per second, if noise hides the differing velocities in swinging feet.
SWINGING_SPEED: Final = 1.0

#: Minimum height of the hips above a standing foot, as a share of the legs' length; crawling people drag their feet.
UPRIGHT_SHARE: Final = 0.6

#: Frame rate below which `SLOW_FACTOR` applies, frames per second.
VIDEO_RATE: Final = 29.0

#: Factor of the minimum duration at lower rates, where medians of five frames hide the roll of a foot.
SLOW_FACTOR: Final = 2.0

#: Minimum frame rate of `sliding`, frames per second; lower rates do not show resting feet.
SLIDING_RATE: Final = 15.0


#: Range of speeds of a drift of the whole body, metres per second; real walks drift by up to 0.04 m/s for a second.
LEAST_DRIFT, LONGEST_DRIFT = 0.05, 1.0

#: Minimum duration of a drift, seconds; and duration of the windows whose median velocities are candidates for its
#: velocity, seconds.
DRIFT_SECONDS, CANDIDATE_SECONDS = 0.8, 0.4

#: Minimum share of the time slots of a drift in which a point is near the ground.
KNOWN_SHARE: Final = 0.6

#: Largest mean deviation of velocities from the velocity of a drift, as a share of its speed.
DRIFT_FIT: Final = 0.55

#: Minimum amount by which a velocity is nearer to the drift's velocity than to zero, as a share of the drift's speed.
DRIFT_PENALTY: Final = 0.25


@check("sliding", unit="m/s", reads=("joints", "up", "time", "ground"), over_time=True)
def sliding(
    body: Body, *, fastest: float = 0.04, lasting: float = 0.4, uneven: float = 0.02, rising: float = 0.05
) -> Judgement:
    """Feet that stand on the ground slide, or the whole body drifts along it.

    Parameters
    ----------
    fastest : float
        Largest allowed speed of a standing foot, metres per second.
    lasting : float
        Minimum duration of a slide, seconds.
    uneven : float
        Largest difference between velocities in a slide, over points of the foot and over time, metres per second.
    rising : float
        Largest vertical speed of a foot on the ground, metres per second.
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
                value[first:last] = 0.0  # report the drift only
        value[start:stop] = speed
    return Judgement([f"{side}_foot" for side in SIDES], line.of_frames(value), upper=fastest)


def _slides(
    body: Body, points: Array, down: Flags, count: int, bounds: tuple[float, float, float, float]
) -> Flags:
    """Return whether a foot (S, 3, 3) slides in each slot (S,); shorter slides than `count` slots are ignored.

    `bounds` are `fastest`, `uneven` and `rising` of `sliding`, and the noise of a speed, metres per second.
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
    # Equal velocities are no evidence if noise changes velocities by more than the speed of the slide.
    steady &= norm(even) > max(fastest, noise / EVEN_SHARE)
    if noise > uneven:
        steady &= norm(even) < SWINGING_SPEED
    for window in np.flatnonzero(steady):
        slides[window : window + count + 1] = True
    return slides


def _stance_way(points: Array, low: Flags, up: Array) -> Array:
    """Return the horizontal displacement since the previous slot (S, 3) of the slowest point near the ground, metres.

    A part that carries the body does not move, so that the displacement is near zero in clean motion. It is NaN in
    slots without a point near the ground.

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
    """Find an interval of slots in which standing points have a common velocity.

    Returns start, stop and speed of the interval, or None without such an interval. The interval maximizes a sum over
    its slots: the distance of the velocity (S, 3) from zero, minus its distance from the common velocity, minus a
    penalty. The algorithm is that for the maximum sum of consecutive numbers (Bentley 1984, Commun. ACM 27:865).
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
    """Return start and stop of a slide, extended by at most `most` slots to maximize the sum of `gained` (S - 1,)."""
    middle = (start + stop) // 2
    before = np.cumsum(gained[max(start - most, 0) : middle][::-1])
    after = np.cumsum(gained[middle : stop + most])
    return middle - int(np.nanargmax(before)) - 1, middle + int(np.nanargmax(after)) + 1
