"""One answer a frame, of all the bodies that it can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.answers.cover import cover
from posekit.answers.depth_order import DepthOrder, depth_orders
from posekit.answers.regions import JointRegions, joint_regions
from posekit.errors import InputError
from posekit.geometry import Array

DISTINCT_METRES: Final = 0.05
"""Metres by which some joint of distinct postures is elsewhere."""

REPRESENTED_PROBABILITY: Final = 0.95
"""Probability that representatives hold together."""

FLOOR_METRES: Final = 1e-3
"""Metres, added to every covariance: what is given, as a neck is, is not known better."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """The answer of one frame: its likeliest posture, how sure it is, and what else it can be.

    Parameters
    ----------
    bodies : int
        How many bodies it is made of: all that the frame lists, none where nothing was recovered.
    rows : int array (K,)
        The representatives: bodies that differ by 5 cm in some joint, so few that with what is within 5 cm of them they
        hold 95 % of the probability. Rows of the frame's bodies, the likeliest first.
    joints : array (K, 14, 3)
        Theirs, camera frame, metres; NaN where a joint is not known.
    probability : array (K,)
        Of each representative and what it stands for; 0.95 or more together.
    depth : DepthOrder
        Which end of each segment is nearer, and how sure that is.
    regions : JointRegions
        Where each joint is with 95 %, whichever of the postures it is.
    """

    bodies: int
    rows: NDArray[np.intp]
    joints: Array
    probability: Array
    depth: DepthOrder
    regions: JointRegions

    def __post_init__(self) -> None:
        for values in (self.rows, self.joints, self.probability):
            values.flags.writeable = False

    def __len__(self) -> int:
        """Count the representatives."""
        return len(self.rows)

    @property
    def posture(self) -> Array:
        """The likeliest posture (14, 3), camera frame, metres; NaN where nothing was recovered."""
        return self.joints[0] if len(self) else np.full(self.joints.shape[1:], np.nan)

    @property
    def sure(self) -> float:
        """The probability that the likeliest posture is right, to 5 cm in every joint; NaN where there is none."""
        return float(self.probability[0]) if len(self) else np.nan


def answers_of(
    joints: Sequence[ArrayLike],
    probability: Sequence[ArrayLike],
    covariance: Sequence[ArrayLike | None],
    deviation: ArrayLike = 0.0,
) -> list[Answer]:
    """Make an answer of each of F frames.

    Parameters
    ----------
    joints : sequence of F arrays (N, 14, 3)
        The bodies of each frame, camera frame, metres; NaN where a joint is not known.
    probability : sequence of F arrays (N,)
        Over a frame they sum to one.
    covariance : sequence of F arrays (N, 14, 3, 3) or None
        Of every joint, square metres, NaN where it is not known; None where bodies were not refined.
    deviation : float or array (F,)
        Metres that joints of such bodies are off, in each direction.

    Raises
    ------
    InputError
        Where a frame has not as many probabilities, or covariances, as bodies.
    """
    counts = [len(np.asarray(one)) for one in joints]
    off = np.broadcast_to(np.asarray(deviation, dtype=np.float64), (len(counts),))
    for name, given in (("probabilities", probability), ("covariances", covariance)):
        if len(given) != len(counts):
            raise InputError(f"{name} of {len(given)} frames, bodies of {len(counts)}; expected as many")
        for k, (one, count) in enumerate(zip(given, counts, strict=True)):
            if one is not None and len(np.asarray(one)) != count:
                raise InputError(
                    f"frame {k} has {count} bodies and {len(np.asarray(one))} {name}; expected one a body"
                )
    frame = np.repeat(np.arange(len(counts)), counts)
    x = _joined(joints, (14, 3))
    p = _joined(probability, ())
    S = _joined(
        [
            np.broadcast_to(np.eye(3) * d**2, (n, 14, 3, 3)) if one is None else one
            for one, n, d in zip(covariance, counts, off, strict=True)
        ],
        (14, 3, 3),
    )
    S = S + np.eye(3) * FLOOR_METRES**2
    depths = depth_orders(x, S, frame, p, len(counts))
    regions = joint_regions(x, S, frame, p, len(counts))
    stands = cover(x, frame, p, within=DISTINCT_METRES, hold=REPRESENTED_PROBABILITY)
    held = np.asarray(
        np.bincount(np.maximum(stands, 0), p * (stands >= 0), minlength=len(x)), dtype=np.float64
    )
    starts = np.cumsum([0, *counts])
    answers = []
    for k, (start, end) in enumerate(pairwise(starts.tolist())):
        rows = _few(held[start:end])
        answers.append(
            Answer(
                bodies=counts[k],
                rows=rows,
                joints=x[start + rows],
                probability=held[start + rows],
                depth=depths[k],
                regions=regions[k],
            )
        )
    return answers


def _few(held: Array) -> NDArray[np.intp]:
    """Return the rows that hold most, as many as hold enough together."""
    rows = np.argsort(-held, kind="stable")
    before = np.cumsum(held[rows]) - held[rows]
    return rows[(before < REPRESENTED_PROBABILITY - SUM_ROUNDING) & (held[rows] > 0)]


SUM_ROUNDING: Final = 1e-9
"""Of sums of probabilities."""


def _joined(arrays: Sequence[ArrayLike | None], shape: tuple[int, ...]) -> Array:
    """Put the arrays of frames one behind the other."""
    parts = [np.asarray(one, dtype=np.float64).reshape(-1, *shape) for one in arrays]
    return np.concatenate([np.empty((0, *shape)), *parts])
