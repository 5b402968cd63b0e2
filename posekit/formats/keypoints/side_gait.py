r"""Left and right exchanged in all pictures of somebody who walks.

In one picture nothing tells: turn left and right round and let what was near be far, and the same lines are those of
another body, as whole as the first (a mirror image in depth; exactly so under parallel projection). What tells is which
way the person goes. Somebody who walks towards the camera has their right side at the picture's left; somebody who
walks to the picture's right has their right side nearer. Forward is known from

- the size: who grows comes towards the camera,
- the feet: a foot is swung forward faster than it stays behind (the stance takes some 60 % of the cycle, Perry 1992,
  *Gait analysis*), so the third moment of its speed against the hip points forward: in the picture, down is towards a
  camera that stands above the feet,
- the knees, which stand before the line from hip to ankle, and the elbows, which stand behind that from shoulder to
  wrist: seen from the side, left or right,

and the nearer side from its size: its arm and leg are longer, and their ends lower, in the picture. Who walks backward
is taken for the opposite, and a camera near the ground sees no floor.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.keypoints.side_body import (
    ARM_JOINTS,
    LEG_JOINTS,
    length,
    limb,
    mean,
    of,
    pair,
    size,
    trunk,
    upright,
)
from posekit.geometry import Array
from posekit.skeleton import SIDES

MIN_PICTURES_OF_WALK: Final = 4
"""Pictures of somebody who walks."""
MIN_PICTURES_OF_MOMENT: Final = 13
"""Pictures with which the third moment of the feet's speed says something."""
UPRIGHT_SHARE: Final = 0.5
"""Share of the pictures in which somebody who walks is upright."""
OPPOSED_CORRELATION: Final = -0.3
"""Correlation of the right foot's way with the left's: who walks moves them against each other."""
OPPOSED_CORRELATION_IN_DEPTH: Final = -0.2
"""The same for somebody whose size changes besides: from the front hardly more is seen of the steps."""
STRIDE_LEG_LENGTHS: Final = 0.1
"""How far the feet go, leg lengths, root mean square."""
SPEEDS_SMOOTHED: Final = 3
"""Speeds over which the mean is taken, against the detector's noise."""
LIFT_MOMENT: Final = 0.1
"""What lifting the foot adds to the third moment of its speed down the picture."""
SIDEWAYS_LEG_LENGTHS: Final = 0.04
"""How far knees and elbows must be beside the limb, leg lengths, to tell where forward is."""
GROWTH_SHARE: Final = 0.05
"""How much the size must change, as a fraction."""
ARROW_UNIT: Final = 0.05
GROWTH_UNIT: Final = 0.02
NEARER_UNIT: Final = 0.006
"""What counts 1, of the three products: about a third of their median over views of walkers that are as labelled."""
MAX_EVIDENCE: Final = 3.0
"""What one kind of evidence can say."""


def gait_evidence(landmarks: Array, frame: NDArray[np.intp]) -> dict[str, float]:
    """Weigh whether one person's left and right are as labelled.

    Parameters
    ----------
    landmarks : array (F, 21, 2)
        In the order of the pictures; NaN where missing.
    frame : int array (F,)
        The pictures' numbers.

    Returns
    -------
    dict
        By kind, -`MAX_EVIDENCE` to `MAX_EVIDENCE`: positive where left and right are as labelled, negative where
        they are exchanged; empty where nobody walks.
    """
    unit = size(landmarks)
    seen = ~np.isnan(unit) & ~np.isnan(pair(landmarks, "ankle") + pair(landmarks, "hip")).any(axis=1)
    landmarks, unit, frame = landmarks[seen], unit[seen], frame[seen]
    if len(unit) < MIN_PICTURES_OF_WALK or not upright(landmarks).mean() > UPRIGHT_SHARE:
        return {}
    ways = [
        _against_line((of(landmarks, f"{side}_ankle") - of(landmarks, f"{side}_hip")) / unit[:, None], frame)
        for side in SIDES
    ]
    spread = np.sqrt((ways[0] ** 2).sum() * (ways[1] ** 2).sum())
    opposed = float((ways[0] * ways[1]).sum() / spread) if spread > 0 else 0.0
    stride = float(np.sqrt(np.mean([(way**2).sum(axis=1) for way in ways])))
    if not opposed < OPPOSED_CORRELATION_IN_DEPTH:
        return {}
    width = _width(landmarks, unit)
    told = {"growth": -width * _grows(landmarks, frame) / GROWTH_UNIT}
    if opposed < OPPOSED_CORRELATION and stride > STRIDE_LEG_LENGTHS:
        told |= _of_strides(landmarks, unit, frame, ways, width)
    return {
        name: float(np.clip(worth, -MAX_EVIDENCE, MAX_EVIDENCE))
        for name, worth in told.items()
        if np.isfinite(worth)
    }


def _of_strides(
    landmarks: Array, unit: Array, frame: NDArray[np.intp], ways: list[Array], width: float
) -> dict[str, float]:
    """Weigh what strides that are seen well say."""
    arrow = np.mean([_arrow(way, frame) for way in ways], axis=0)
    return {
        "feet": -width * (float(arrow[1]) - LIFT_MOMENT) / ARROW_UNIT,
        "nearer side": _sideways(landmarks, unit, float(arrow[0])) * _nearer(landmarks, unit) / NEARER_UNIT,
    }


def _against_line(way: Array, frame: NDArray[np.intp]) -> Array:
    """Take the straight line out of a way (F, 2)."""
    time = np.stack([np.ones(len(frame)), frame - frame.mean()], axis=1)
    return np.asarray(way - time @ np.linalg.lstsq(time, way, rcond=None)[0])


def _width(landmarks: Array, unit: Array) -> float:
    """Return how far the right side is right of the left in the picture, leg lengths: shoulders and hips."""
    widths = [(pair(landmarks, part) / unit[:, None])[:, 0] for part in ("shoulder", "hip")]
    known = [float(np.median(width[~np.isnan(width)])) for width in widths if not np.isnan(width).all()]
    return float(np.mean(known)) if known else 0.0


def _grows(landmarks: Array, frame: NDArray[np.intp]) -> float:
    """Return how much larger the trunk is in the last picture than in the first, as a logarithm; 0 where it is not."""
    long = trunk(landmarks)
    known = long > 0
    if known.sum() < MIN_PICTURES_OF_WALK:
        return 0.0
    line = np.polyfit(frame[known] - frame[known].mean(), np.log(long[known]), 1)
    growth = float(line[0] * np.ptp(frame[known]))
    return growth if abs(growth) > GROWTH_SHARE else 0.0


def _arrow(way: Array, frame: NDArray[np.intp]) -> Array:
    """Return the third moment of a foot's speed (2,), in units of its spread: it points to where the foot is swung."""
    step = np.diff(frame)
    speed = np.diff(way, axis=0)[step == np.median(step)]
    if len(speed) < MIN_PICTURES_OF_MOMENT - 1:
        return np.array([np.nan, np.nan])
    kernel = np.ones(SPEEDS_SMOOTHED) / SPEEDS_SMOOTHED
    smooth = np.stack([np.convolve(axis, kernel, "valid") for axis in speed.T], axis=1)
    spread = np.sqrt((smooth**2).mean(axis=0))
    return np.asarray((smooth**3).mean(axis=0) / np.maximum(spread, 1e-9) ** 3)


def _sideways(landmarks: Array, unit: Array, arrow: float) -> float:
    """Return how far forward is to the picture's right: by knees and elbows; 0 where they and the feet disagree."""
    beside = 0.0
    for parts, sign in ((LEG_JOINTS, 1.0), (ARM_JOINTS, -1.0)):
        bends = [_beside(landmarks, side, parts, unit) for side in SIDES]
        known = [bend for bend in bends if not np.isnan(bend)]
        beside += sign * float(np.mean(known)) if known else 0.0
    if abs(beside) < SIDEWAYS_LEG_LENGTHS or arrow * beside < 0:
        return 0.0
    return beside


def _beside(landmarks: Array, side: str, parts: tuple[str, str, str], unit: Array) -> float:
    """Return how far the middle joint of a limb is right of the line between its ends, leg lengths, on average."""
    a, b, c = (of(landmarks, f"{side}_{part}") for part in parts)
    line, bend = c - a, b - a
    across = bend[:, 0] * line[:, 1] - bend[:, 1] * line[:, 0]
    return mean(across / np.maximum(length(line), 0.2 * unit) / unit)


def _nearer(landmarks: Array, unit: Array) -> float:
    """Return how much nearer the right side looks than the left: its arm and leg longer, and its leg lower."""
    looks = 0.0
    for parts in (ARM_JOINTS, LEG_JOINTS):
        right, left = (limb(landmarks, side, parts) for side in SIDES)
        both = ~np.isnan(right + left)
        if both.any() and left[both].sum() > 0 and right[both].sum() > 0:
            looks += float(np.log(right[both].sum() / left[both].sum()))
    lower = [mean(pair(landmarks, part)[:, 1] / unit) for part in LEG_JOINTS]
    known = [value for value in lower if not np.isnan(value)]
    return looks + (float(np.mean(known)) if known else 0.0)
