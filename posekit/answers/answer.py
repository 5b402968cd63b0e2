"""One answer a frame, of all the bodies that it can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.answers.cover import cover, held_by, most_held
from posekit.answers.depth_order import DepthOrder, depth_orders
from posekit.answers.listed_bodies import ListedBodies
from posekit.answers.regions import JointRegions, joint_regions
from posekit.display.pictured import Pictured
from posekit.display.stick_drawing import posture_drawing
from posekit.geometry import Array

DISTINCT_METRES: Final = 0.05
"""Metres by which some joint of distinct postures is elsewhere."""

REPRESENTED_PROBABILITY: Final = 0.95
"""Probability that representatives hold together."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer(Pictured):
    """The answer of one frame: its likeliest posture, how sure it is, and what else it can be.

    Parameters
    ----------
    bodies : ListedBodies
        What it is made of; none where nothing was recovered.
    rows : int array (K,)
        The representatives: bodies that differ by 5 cm in some joint, so few that with what is within 5 cm of them they
        hold 95 % of the probability, or all that is listed. Rows of the frame's bodies, the likeliest first.
    probability : array (K,)
        Of each representative and what it stands for; 0.95 or more together, or less where more is not listed.
    depth : DepthOrder
        Which end of each segment is nearer, and how sure that is.
    written : JointRegions, optional
        The regions, where they were read; else they are found when they are asked for.
    """

    bodies: ListedBodies
    rows: NDArray[np.intp]
    probability: Array
    depth: DepthOrder
    written: JointRegions | None = None

    def __post_init__(self) -> None:
        for values in (self.rows, self.probability):
            values.flags.writeable = False

    def __len__(self) -> int:
        """Count the representatives."""
        return len(self.rows)

    @property
    def joints(self) -> Array:
        """The representatives (K, 14, 3), camera frame, metres; NaN where a joint is not known."""
        return self.bodies.joints[self.rows]

    @property
    def posture(self) -> Array:
        """The likeliest posture (14, 3), camera frame, metres; NaN where nothing was recovered."""
        return self.joints[0] if len(self) else np.full((14, 3), np.nan)

    @property
    def sure(self) -> float:
        """The probability that the likeliest posture is right, to 5 cm in every joint; NaN where there is none."""
        return float(self.probability[0]) if len(self) else np.nan

    def __repr__(self) -> str:
        """Say how sure it is, and of how many postures."""
        return f"Answer(sure={self.sure:.3g}, representatives={len(self)}, bodies={len(self.bodies)})"

    def _drawing(self) -> str:
        return posture_drawing(self.joints, np.array([0.0, -1.0, 0.0]))

    @cached_property
    def regions(self) -> JointRegions:
        """Where each joint is with 95 %, whichever of the listed postures it is."""
        return joint_regions(self.bodies) if self.written is None else self.written


def answers_of(frames: Sequence[ListedBodies]) -> list[Answer]:
    """Make an answer of each frame.

    Parameters
    ----------
    frames : sequence of ListedBodies
        What each frame can be.
    """
    found: list[Answer] = []
    for first in range(0, len(frames), FRAMES_AT_A_TIME):
        found += _answers(frames[first : first + FRAMES_AT_A_TIME])
    return found


def _answers(frames: Sequence[ListedBodies]) -> list[Answer]:
    counts = [len(one) for one in frames]
    frame = np.repeat(np.arange(len(frames)), counts)
    joints, p, variance = (
        np.concatenate([getattr(one, name) for one in frames])
        for name in ("joints", "probability", "depth_variance")
    )
    unlisted = np.array([one.unlisted for one in frames])
    depths = depth_orders(joints[..., 2], variance, frame, p, unlisted)
    hold = np.minimum(REPRESENTED_PROBABILITY / np.maximum(1.0 - unlisted, REPRESENTED_PROBABILITY), 1.0)
    stands = cover(joints, frame, p, within=DISTINCT_METRES, hold=hold[: 1 + int(frame.max(initial=-1))])
    held = held_by(stands, p)
    starts = np.cumsum([0, *counts])
    found = []
    each = zip(frames, depths, pairwise(starts.tolist()), hold.tolist(), strict=True)
    for one, depth, (start, end), enough in each:
        rows = most_held(held[start:end], enough)
        probability = held[start + rows] * (1.0 - one.unlisted)
        found.append(Answer(bodies=one, rows=rows, probability=probability, depth=depth))
    return found


FRAMES_AT_A_TIME: Final = 256
"""Frames whose bodies are looked at together: more would not be faster."""
