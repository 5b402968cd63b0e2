r"""What steps and turns cost at least, whichever survivor they go to: what noise alone makes of them.

They cost :math:`\sum_c a \log (G_c / H_c) + \tfrac12 \log H_c` (`posekit.following.pairwise_student`), the first
part never negative. Of the second, with :math:`H = 1 + w (B_r + B_c)`, the logarithm being concave,

.. math:: \tfrac12 \log H \ge \tfrac14 \log (1 + 2 w B_r) + \tfrac14 \log (1 + 2 w B_c)

which is a number of the end of a path plus a number of the survivor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.following.channels import N_JOINTS, NextSurvivors
from posekit.following.motion_model import MotionModel
from posekit.following.states import Heading, States
from posekit.geometry import Array


class Arrivals(NamedTuple):
    """Paths that go on to a survivor, one for each pair of a last survivor and a new one.

    Attributes
    ----------
    came : int array (A,)
        The end that each continues.
    went : int array (A,)
        The new survivor.
    cost : array (A,)
        Of the path with that survivor.
    dropped : float
        No more than the cheapest of those that were left out; infinite if none were.
    """

    came: NDArray[np.intp]
    went: NDArray[np.intp]
    cost: Array
    dropped: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Floors:
    """What no path from the S ends to the N survivors of a frame can cost less than.

    Parameters
    ----------
    moving : bool
        Whether any end has a velocity: whether turns are asked.
    alike : bool
        Whether all ends in one last survivor make the same steps to come.
    ends : array (S,)
        The end's part: of its path so far, its step and its turn.
    turns : array (S,)
        Of that, its turn's.
    heading : Heading
        Where the ends are heading.
    to : array (N,)
        The survivor's part: its own cost, its step's and its turn's.
    to_turns : array (N,)
        Of that, its turn's.
    """

    moving: bool
    alike: bool
    ends: Array
    turns: Array
    heading: Heading
    to: Array
    to_turns: Array

    @staticmethod
    def of(states: States, survivors: NextSurvivors, model: MotionModel) -> Floors:
        """Compute the floors of going from the ends of paths to the survivors of a frame."""
        channels, time = survivors.channels, survivors.time
        moving = bool(np.isfinite(states.interval).any())
        heading = states.heading(time)
        ends, to = np.zeros(len(states)), np.zeros(len(survivors))
        turns, to_turns = np.zeros(len(states)), np.zeros(len(survivors))
        if channels.variance.any() or states.variance.any():
            since = time - states.time
            known = np.asarray(np.isfinite(since))
            pace = np.where(known, since, 1.0) ** -2.0
            told = np.asarray(known.all(axis=1) & channels.known.all(axis=1))
            for scale in (model.usual, model.at_rest):
                pick = told & np.isfinite(scale)
                weight = pace[pick] / scale[pick, None] ** 2
                part, its = _parts(weight, states.variance[pick], channels.variance[pick])
                ends += part
                to += its
            scale = np.asarray(model.acceleration)
            pick = np.asarray(told[:N_JOINTS] & heading.known.all(axis=1) & np.isfinite(scale))
            weight = heading.weight[pick] / scale[pick, None] ** 2
            turns, to_turns = _parts(weight, heading.variance[pick], channels.variance[:N_JOINTS][pick])
        return Floors(
            moving=moving,
            alike=_are_alike(states),
            ends=states.cost + ends + turns,
            turns=turns,
            heading=heading,
            to=survivors.cost + to + to_turns,
            to_turns=to_turns,
        )


def _parts(weight: Array, ends: Array, to: Array) -> tuple[Array, Array]:
    """Share out floors between ends (S,) and survivors (N,), of weights and variances (C, S) and variances (C, N)."""
    if not len(weight):
        return np.zeros(ends.shape[1]), np.zeros(to.shape[1])
    least = weight.min(axis=1, keepdims=True)
    return np.log1p(2 * weight * ends).sum(axis=0) / 4, np.log1p(2 * least * to).sum(axis=0) / 4


def _are_alike(states: States) -> bool:
    """Tell whether all states in one last survivor make the same steps to come: whether it knew all that they know."""
    latest = np.fmax.reduce(states.time, axis=0)
    never = np.isnan(states.time).all(axis=1, keepdims=True)
    return bool(((states.time == latest) | never | np.isnan(latest)).all())
