r"""What is expected of a motion: of every frame the mean of its survivors, smoothed over time.

The posture that is off least from all that it can be, each as likely as all frames together say, is their mean: of two
that are as likely it is off by half of what they differ, and whoever takes one of them is off by all of it every second
time. The survivor nearest to the mean is the one that is off least, since
:math:`\sum_j p_j |x_i - x_j|^2 = |x_i - \bar x|^2 + const`. A mean's covariance is its survivors' own and what they
differ by, so that smoothing (`posekit.following.smooth`) trusts a frame as far as it is sure.

Where points are exact, a survivor is a point of the set and what lies between two is none: such frames keep their
survivor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.following.bridging import bridge
from posekit.following.motion_model import MotionModel
from posekit.following.smoothing import smooth
from posekit.following.survivor_frame import SurvivorFrame
from posekit.geometry import Array
from posekit.skeleton import JOINTS

PASSED_OVER: Final = 0.5
"""A frame is passed over where less of the probability goes through its survivors."""

TIE_SQUARE_METRES: Final = 1e-9
"""Square metres by which two survivors may be off what is expected and count as equally near: the likelier is taken."""

SAME_POSTURE_METRES: Final = 0.05
"""Metres within which all joints of a survivor are where those of another are, for it to speak for that one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ExpectedPath:
    """What is expected of T frames.

    Parameters
    ----------
    survivor : int array (T,)
        Of each frame the survivor that is nearest to what is expected; -1 where it is likelier passed over.
    survivors : array (T, 14, 3)
        Their joints, bridged where there is none.
    joints, deviation : array (T, 14, 3), (T, 14)
        What is expected, smoothed, with the lengths of the survivors; how far off it is, metres.
    confidence : array (T,)
        The probability of the survivors that have all joints within 5 cm of the one chosen.
    interpolated : bool array (T, 14)
        Which joints are no survivor's.
    """

    survivor: NDArray[np.intp]
    survivors: Array
    joints: Array
    deviation: Array
    confidence: Array
    interpolated: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class ExpectedPosture:
    """What is expected of one frame.

    Parameters
    ----------
    survivor : int
        The survivor that is nearest to it; -1 where the frame is likelier passed over.
    joints : array (14, 3)
        Those of that survivor.
    mean, covariance : array (14, 3), (14, 3, 3)
        Of all survivors, as likely as they are; of that one where points are exact.
    confidence : float
        The probability of the survivors that have all joints within 5 cm of the one chosen.
    """

    survivor: int
    joints: Array
    mean: Array
    covariance: Array
    confidence: float

    @staticmethod
    def of(frame: SurvivorFrame, at: NDArray[np.int32], probability: Array) -> ExpectedPosture:
        """Find what is expected of a frame whose ends (S,) are at some survivors, or -1, with some probability."""
        rows = np.flatnonzero(at >= 0)
        weight, at = probability[rows], at[rows]
        if not weight.sum() > PASSED_OVER:
            nothing = np.full((len(JOINTS), 3), np.nan)
            none = np.zeros((len(JOINTS), 3, 3))
            return ExpectedPosture(survivor=-1, joints=nothing, mean=nothing, covariance=none, confidence=0.0)
        joints = frame.joints[at]
        mean, covariance = _mean(joints, frame.covariance[at], weight)
        off = np.nansum((joints - mean) ** 2, axis=(1, 2))
        one = int(np.argmax(np.where(off <= off.min() + TIE_SQUARE_METRES, weight, -1.0)))
        away = np.fmax.reduce(np.linalg.norm(joints - joints[one], axis=2), axis=1, initial=0.0)
        exact = not frame.deviation[at[one]].any()
        return ExpectedPosture(
            survivor=int(at[one]),
            joints=joints[one],
            mean=joints[one] if exact else mean,
            covariance=np.zeros_like(covariance) if exact else covariance,
            confidence=min(float(weight[away <= SAME_POSTURE_METRES].sum()), 1.0),
        )


def expected_path(
    frames: Sequence[SurvivorFrame],
    survivors: Sequence[NDArray[np.int32]],
    probability: Sequence[Array],
    model: MotionModel,
) -> ExpectedPath:
    """Find what is expected of frames whose ends (S,) are at some survivors with some probability."""
    found = [ExpectedPosture.of(*each) for each in zip(frames, survivors, probability, strict=True)]
    time = np.array([frame.time for frame in frames])
    seen = np.stack([each.joints for each in found])
    interpolated = np.isnan(seen[..., 0])
    bridged = bridge(time, seen)
    joints, spread = bridged, np.where(interpolated, np.inf, 0.0)
    covariance = np.stack([each.covariance for each in found])
    if covariance.any():
        covariance[interpolated] = np.inf
        mean = np.stack([each.mean for each in found])
        expected = np.where(np.isnan(mean), bridged, mean)
        joints, spread = smooth(
            time, expected, covariance, acceleration=model.acceleration, lengths_of=bridged
        )
        spread = np.where(np.isfinite(spread) & ~interpolated, spread, np.inf)
    return ExpectedPath(
        survivor=np.array([each.survivor for each in found], dtype=np.intp),
        survivors=bridged,
        joints=joints,
        deviation=spread,
        confidence=np.array([each.confidence for each in found]),
        interpolated=interpolated,
    )


def _mean(joints: Array, covariance: Array, weight: Array) -> tuple[Array, Array]:
    """Return the mean (14, 3) of postures (N, 14, 3) as far as they are known, and its covariance (14, 3, 3)."""
    known = np.asarray(np.isfinite(joints).all(axis=2))
    share = weight[:, None] * known
    total = share.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        share /= total
    mean = np.einsum("nj,njc->jc", share, np.where(known[..., None], joints, 0.0))
    off = np.where(known[..., None], joints - mean, 0.0)
    spread = np.einsum("nj,njcd->jcd", share, covariance) + np.einsum("nj,njc,njd->jcd", share, off, off)
    return mean, np.where(total[:, None, None] > 0, spread, 0.0)
