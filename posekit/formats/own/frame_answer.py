"""What a result says of a frame first: few postures that stand for all, near and far, and where each joint is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.column import column, columns_in
from posekit.formats.own.digits import Precision
from posekit.geometry import Array
from posekit.safe_io.refusal import refusal
from posekit.skeleton import JOINTS

N_ANSWER_SEGMENTS: Final = 11
"""Eight segments of limbs and three of the trunk, as `posekit.answers.ANSWER_SEGMENTS` has them."""

ANSWER_PRECISION: Final = Precision(decimals=6)
"""Of answers of frames whose noise is not known: how sure a posture is has no more digits."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FrameAnswer:
    """The answer of one frame, as `posekit.answers.Answer` makes it.

    Parameters
    ----------
    representatives : int array (K,)
        Rows of the frame's postures that stand for all, the likeliest first.
    probability : array (K,)
        Of each and what it stands for.
    near, far : array (11,)
        The probability that the end of each segment is nearer than its start, or farther; NaN where it is not known.
    region_mean : array (M, 14, 3)
        The modes of each joint's places, camera frame, metres, the likeliest first; NaN where a joint has fewer.
    region_covariance : array (M, 14, 3, 3)
        Theirs, square metres.
    region_probability : array (M, 14)
        Of each mode; 0 where a joint has fewer.
    region_level : array (14,)
        Logarithm of the density, per cubic metre, that the points of the 95 % region have at least; NaN where a joint
        is not known.
    """

    schema_title: ClassVar = (
        "ResultAnswer",
        "The answer: few postures that stand for all, and where each joint is.",
    )

    representatives: NDArray[np.intp] = column(
        "Numbers of the postures that stand for all, from 0, the likeliest first: they hold 95 % of the probability "
        "with what is within 5 cm of them, or all that is listed.",
        kind="int",
    )
    probability: Array = column("Of each of these and what it stands for.", digits=4)
    near: Array = column(
        "The probability that the end of a segment is nearer than its start by 5 cm: upper arm and forearm right, then "
        "left, thigh and shank right, then left; right shoulder against left, right hip against left, neck against "
        "pelvis.",
        digits=4,
        null="number",
    )
    far: Array = column("The same for farther.", digits=4, null="number")
    region_mean: Array = column(
        "Modes of the places of each joint, the likeliest first, in `unit`; null where a joint has fewer.",
        shape=(len(JOINTS), 3),
        length_power=1,
        decimals=0,
        null="row",
    )
    region_covariance: Array = column(
        "Of each mode: xx, xy, xz, yy, yz, zz, in the square of `unit`.",
        shape=(len(JOINTS), 6),
        length_power=2,
        symmetric=True,
        null="row",
    )
    region_probability: Array = column(
        "Of each mode; 0 where a joint has fewer.", shape=(len(JOINTS),), digits=4
    )
    region_level: Array = column(
        "Of each joint, the logarithm of the density, per cubic metre, that its 95 % region has at least.",
        digits=4,
        null="number",
    )

    def __post_init__(self) -> None:
        counts = {"representatives": len(self.representatives), "probability": len(self.representatives)}
        counts |= {"near": N_ANSWER_SEGMENTS, "far": N_ANSWER_SEGMENTS, "region_level": len(JOINTS)}
        for name, each in columns_in(FrameAnswer).items():
            count = counts.get(name, len(self.region_mean))
            values: Any = each.checked(getattr(self, name), count, "answer.")
            object.__setattr__(self, name, values)

    def check_against(self, postures: int) -> None:
        """Refuse an answer of another frame than one with so many postures."""
        if (self.representatives >= postures).any():
            got, expected = f"{int(self.representatives.max())}", f"numbers of {postures} postures, from 0"
            raise refusal("result", "answer.representatives", got, expected, "recover the view again")


def likeliest_order(probability: Array, answer: FrameAnswer | None) -> NDArray[np.intp]:
    """Order a frame's postures: the one that its answer begins with, then the others by probability.

    The answer's is the one that holds most with what is within 5 cm of it, which need not be the most probable itself.

    Parameters
    ----------
    probability : array (N,)
        Of each posture; NaN where it is not known.
    answer : FrameAnswer, optional
        The frame's.
    """
    order = np.argsort(-np.nan_to_num(probability, nan=-1.0), kind="stable")
    if answer is None or not len(answer.representatives):
        return order
    first = answer.representatives[:1]
    return np.concatenate([first, order[order != first]])
