"""What is known of a person once a picture was seen."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from posekit.answers import Answer
from posekit.display.short_repr import ShortRepr
from posekit.following.follower import LiveEstimate
from posekit.following.survivor_frame import SurvivorFrame
from posekit.geometry import Array
from posekit.recovery.recovery import FrameRecovery
from posekit.skeleton import JOINTS


def unknown_joints() -> Array:
    """Return joints (14, 3) of which nothing is known."""
    return np.full((len(JOINTS), 3), np.nan)


def unknown_deviation() -> Array:
    """Return their deviations (14,)."""
    return np.full(len(JOINTS), np.nan)


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackedPosture(ShortRepr):
    """The likeliest posture in one picture, how sure it is, and the path as it is known by now.

    Parameters
    ----------
    frame : int
        The number of the picture, from 0.
    time : float
        Seconds.
    joints : array (14, 3)
        The likeliest posture of this picture by itself, camera frame, metres; NaN where nothing is known.
    probability : float
        That it is right, to 5 cm in every joint; 0 where none survives.
    deviation : array (14,)
        How far each joint is off, metres: the root of the expected squared distance, what noise leaves and what the
        other survivors are, weighed by their probabilities.
    survivors : int
        How many postures survive.
    reason : str
        Why nothing is known of this picture; empty where something is.
    answer : Answer, optional
        What else it can be: representatives, regions, and which end of each segment is nearer.
    path : LiveEstimate, optional
        The picture `lag` before this one on the likeliest path through all so far; None for the first ones.
    recovery : FrameRecovery, optional
        Every survivor, and what the others were lost to; None where nothing was grown.
    """

    frame: int
    time: float
    joints: Array = field(default_factory=unknown_joints)
    probability: float = 0.0
    deviation: Array = field(default_factory=unknown_deviation)
    survivors: int = 0
    reason: str = ""
    answer: Answer | None = field(default=None, repr=False)
    path: LiveEstimate | None = None
    recovery: FrameRecovery | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for array in (self.joints, self.deviation):
            array.flags.writeable = False


def deviation_from(posture: Array, probability: Array, survivors: SurvivorFrame) -> Array:
    r"""Return how far joints of a posture (14, 3) are off (14,), metres, where N survivors have these probabilities.

    The square is :math:`\sum_i p_i (|x_i - x|^2 + \sigma_i^2)`, over the survivors that have the joint.
    """
    away = ((survivors.joints - posture) ** 2).sum(axis=2) + survivors.deviation**2
    known = np.isfinite(away)
    weight = np.where(known, probability[:, None], 0.0)
    total = weight.sum(axis=0)
    square = (weight * np.where(known, away, 0.0)).sum(axis=0)
    mean = np.divide(square, total, out=np.full(len(total), np.nan), where=total > 0)
    return np.asarray(np.sqrt(mean))
