"""What it costs to go from the ends of paths to the survivors of the next frame: all pairs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.following.channels import Channels
from posekit.following.motion_model import MotionModel
from posekit.following.pairwise_student import columns, rows, unlikelihood
from posekit.following.states import States
from posekit.geometry import Array

RESTING_NU: Final = 1.0
"""Degrees of freedom of the speed of what mostly rests: when it does not, it may be any."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """The survivors of a frame, laid out to be gone to.

    Parameters
    ----------
    channels : Channels
        The N survivors.
    time : float
        Seconds.
    centre : array (27, 3)
        Taken off all values, so that no digits are lost far from the origin.
    columns : array (27, 7, N)
        The channels as `posekit.following.pairwise_student.columns` lays them out.
    """

    channels: Channels
    time: float
    centre: Array
    columns: Array

    @staticmethod
    def of(channels: Channels, time: float) -> Target:
        """Lay out the survivors of a frame."""
        centre = channels.centre
        value = np.where(channels.known[..., None], channels.value - centre[:, None], 0.0)
        return Target(
            channels=channels,
            time=time,
            centre=centre,
            columns=columns(value, channels.variance, channels.known),
        )

    def take(self, rows: NDArray[np.intp]) -> Target:
        """Return some survivors, by index."""
        return replace(self, channels=self.channels.take(rows), columns=self.columns[..., rows])


def step_costs(states: States, target: Target, model: MotionModel) -> Array:
    """Return what each step costs (S, N): its velocities; infinite beyond the walls."""
    since = target.time - states.time
    known = np.isfinite(since)
    since = np.where(known, since, 1.0)
    place = states.position - target.centre[:, None]
    noisy = bool(target.channels.variance.any() or states.variance.any())
    total = np.where(_possible(place, since, known, states.variance, target, model, noisy=noisy), 0.0, np.inf)
    for scale, nu in ((model.usual, model.nu), (model.at_rest, RESTING_NU)):
        pick = np.flatnonzero(np.isfinite(scale))
        if len(pick):
            weight = 1 / (scale[pick, None] * since[pick]) ** 2
            total += unlikelihood(
                rows(place[pick], weight / nu, weight * states.variance[pick], weight, known[pick]),
                target.columns[pick],
                nu,
                noisy=noisy,
            )
    return total


def turn_costs(states: States, target: Target, model: MotionModel) -> Array:
    """Return what each change of velocity costs (S, N), from that of arrival to that of departure."""
    scale = np.asarray(model.acceleration)
    pick = np.flatnonzero(np.isfinite(scale))
    if not len(pick):
        return np.zeros((len(states), target.columns.shape[2]))
    heading = states.heading(target.time)
    known, variance = heading.known[pick], heading.variance[pick]
    weight = heading.weight[pick] / scale[pick, None] ** 2
    place = heading.place[pick] - target.centre[pick][:, None]
    return unlikelihood(
        rows(place, weight / model.nu, weight * variance, weight, known),
        target.columns[pick],
        model.nu,
        noisy=bool(target.channels.variance.any() or variance.any()),
    )


def _possible(
    place: Array,
    since: Array,
    known: NDArray[np.bool_],
    variance: Array,
    target: Target,
    model: MotionModel,
    *,
    noisy: bool,
) -> NDArray[np.bool_]:
    """Tell which steps (S, N) are within the walls."""
    reach = model.reach(np.where(known, since, np.inf))
    pick = np.flatnonzero((reach < np.inf).any(axis=1))
    squared = _squared(place[pick], target.columns[pick])
    limit = reach[pick][:, :, None]
    if noisy:
        limit = limit + model.spread * (
            np.sqrt(variance[pick])[:, :, None] + np.sqrt(target.channels.variance[pick])[:, None]
        )
    # The squares come from differences of large numbers: at the wall itself rounding must not decide.
    inside = squared <= limit * limit * (1 + 1e-12) + 1e-12
    inside |= ~target.channels.known[pick][:, None]
    return np.asarray(inside.all(axis=0))


def _squared(place: Array, laid: Array) -> Array:
    """Return the squared distances (C, S, N) of rows (C, S, 3) and columns."""
    own = np.empty((*place.shape[:2], 5))
    own[..., :3] = -2 * place
    own[..., 3] = (place**2).sum(axis=-1)
    own[..., 4] = 1.0
    return np.asarray(own @ laid[:, :5])
