r"""Stretches of frames that are lifted or lowered as a whole against the frames around them.

A body on its feet never moves up or down by a step: from one frame to the next all its points would go the same way,
which they do not a frame earlier and a frame later. The step at a frame is the median over points of
:math:`d_t - \mathrm{median}(d_{t-2}, d_{t-1}, d_{t+1}, d_{t+2})`, d the vertical way from frame to frame, if nine
tenths of the points agree on its sign. A foot rests on both sides of the step: in the air many things are possible. A
step and the next one back make a stretch.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array

#: Least step, metres: clean recordings have steps of up to 0.7 cm where a foot is at rest, at 30 Hz.
LEAST_STEP_METRES: Final = 0.012

#: Step from which no foot need be at rest, metres, at this rate (Hz) or more: clean recordings have up to 13 cm, in a
#: backflip.
SURE_STEP_METRES, SURE_RATE = 0.15, 16.0

#: Difference between a step and the step back, at most, as a share of the larger.
SAME_SHARE: Final = 0.35

#: Frames of the shortest stretch: shorter ones are jumps of the body.
SHORTEST_FRAMES: Final = 3

#: Vertical way of a resting foot in the frames before and after a step, at most, metres.
REST_METRES: Final = 0.01


def lifted_by(height: Array, feet: slice, rate: float, noise: float = 0.0) -> Array:
    """Return the height by which frames are lifted against those around them.

    Parameters
    ----------
    height : array (S, P)
        Heights of points of the body along up, metres; NaN where a point is not known.
    feet : slice
        Points of the feet: one of them rests where a step is a defect.
    rate : float
        Frames a second; NaN where it is not known.
    noise : float
        Standard deviation of measured coordinates, metres.

    Returns
    -------
    array (S,)
        Metres, negative where frames are lowered, 0 in most.
    """
    lifted = np.zeros(len(height))
    if len(height) < 2 * SHORTEST_FRAMES:
        return lifted
    steps = steps_of(height)
    way = np.abs(np.diff(height[:, feet], axis=0, prepend=np.nan, append=np.nan))
    # The way to the frame before, and the way on from the frame that the step leads to.
    beside = np.maximum(way[:-2], way[2:])
    rests = np.zeros(len(height), dtype=np.bool_)
    rests[1:] = (beside < REST_METRES + 3 * noise).any(axis=1)
    start = -1
    # A falling body moves farther between frames the longer these last.
    longer = SURE_RATE / rate if rate < SURE_RATE else 1.0
    large = np.abs(steps) >= SURE_STEP_METRES * longer**2
    for frame in np.flatnonzero(large | (rests & (np.abs(steps) >= max(LEAST_STEP_METRES, 4 * noise)))):
        size = steps[frame]
        if start >= 0 and size * steps[start] < 0:
            larger = max(abs(size), abs(steps[start]))
            if abs(size + steps[start]) <= SAME_SHARE * larger:
                if frame - start >= SHORTEST_FRAMES:
                    lifted[start:frame] = (steps[start] - size) / 2
                start = -1
                continue
        start = int(frame)
    return lifted


def steps_of(height: Array) -> Array:
    """Return the step that most points make at each frame (S,), metres; 0 where they do not agree."""
    way = np.diff(height, axis=0)
    padded = np.pad(way, ((2, 2), (0, 0)), mode="edge")
    around = np.stack([padded[k : k + len(way)] for k in (0, 1, 3, 4)])
    around.sort(axis=0)
    beyond = np.sort(way - (around[1] + around[2]) / 2, axis=1)
    known = np.isfinite(beyond).sum(axis=1)
    rows, last = np.arange(len(way)), np.maximum(known - 1, 0)
    low = beyond[rows, (0.1 * last).astype(np.intp)]
    high = beyond[rows, np.ceil(0.9 * last).astype(np.intp)]
    median = beyond[rows, last // 2]
    agreed = (known >= 6) & ((low > 0) | (high < 0))
    return np.concatenate([[0.0], np.where(agreed, median, 0.0)])
