"""What is known of a person once a picture was seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from posekit.following.follower import LiveEstimate
from posekit.following.survivor_frame import SurvivorFrame
from posekit.geometry import Array
from posekit.recovery.recovery import FrameRecovery
from posekit.skeleton import JOINTS, TREE_SEGMENTS, segment_name


def unknown_joints() -> Array:
    """Return joints (14, 3) of which nothing is known."""
    return np.full((len(JOINTS), 3), np.nan)


def unknown_deviation() -> Array:
    """Return their deviations (14,)."""
    return np.full(len(JOINTS), np.nan)


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackedPosture:
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
        That of this posture among all that survive; 0 where none does.
    deviation : array (14,)
        How far each joint is off, metres: the root of the expected squared distance, what noise leaves and what the
        other survivors are, weighed by their probabilities.
    nearer : mapping of str to float
        Of each lifted segment ``a-b`` the probability that b is nearer to the camera than a.
    survivors : int
        How many postures survive.
    reason : str
        Why nothing is known of this picture; empty where something is.
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
    nearer: Mapping[str, float] = field(default_factory=dict)
    survivors: int = 0
    reason: str = ""
    path: LiveEstimate | None = None
    recovery: FrameRecovery | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for array in (self.joints, self.deviation):
            array.flags.writeable = False


def likeliest(probability: Array, survivors: SurvivorFrame) -> tuple[int, Array]:
    r"""Return which of N survivors is the likeliest, one at least, and how far its joints are off (14,), metres.

    The square of the latter is :math:`\sum_i p_i (|x_i - x|^2 + \sigma_i^2)`, over the survivors that have the joint.
    """
    best = int(np.argmax(probability))
    away = ((survivors.joints - survivors.joints[best]) ** 2).sum(axis=2) + survivors.deviation**2
    known = np.isfinite(away)
    weight = np.where(known, probability[:, None], 0.0)
    total = weight.sum(axis=0)
    square = (weight * np.where(known, away, 0.0)).sum(axis=0)
    return best, np.sqrt(np.divide(square, total, out=np.full(len(total), np.nan), where=total > 0))


def nearer_ends(probability: Array, joints: Array) -> dict[str, float]:
    """Return for each lifted segment how probable it is that its end is nearer to the camera than its start.

    Segments that no survivor of `joints` (N, 14, 3) places are left out.
    """
    depth = joints[..., 2]
    found = {}
    for start, end in TREE_SEGMENTS:
        known = np.isfinite(depth[:, start]) & np.isfinite(depth[:, end])
        total = float(probability[known].sum())
        if total > 0:
            nearer = depth[:, end] < depth[:, start]
            found[segment_name((start, end))] = float(probability[known & nearer].sum()) / total
    return found
