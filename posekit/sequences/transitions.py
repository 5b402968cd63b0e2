"""What it costs to go from the ends of paths to the survivors of the next frame: all pairs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.sequences.channels import N_JOINTS, Channels
from posekit.sequences.motion_model import MotionModel
from posekit.sequences.states import States
from posekit.sequences.student import columns, rows, unlikelihood

RESTING_NU: Final = 1.0
"""Degrees of freedom of the speed of what mostly rests: when it does not, it may be any."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """The survivors of a frame, laid out to be gone to.

    Parameters
    ----------
    channels : Channels
    time : float
        Seconds.
    centre : array (27, 3)
        Taken off all values, so that no digits are lost far from the origin.
    columns : array (27, 7, N)
    """

    channels: Channels
    time: float
    centre: Array
    columns: Array

    @staticmethod
    def of(channels: Channels, time: float) -> Target:
        """Lay out the survivors of a frame."""
        known = channels.known[..., None]
        centre = channels.value.sum(axis=1) / np.maximum(known.sum(axis=1), 1)
        value = np.where(known, channels.value - centre[:, None], 0.0)
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
    pick = np.flatnonzero(np.isfinite(model.sudden))
    if not len(pick):
        return np.zeros((len(states), target.columns.shape[2]))
    before = states.interval[pick]
    known = np.isfinite(before)
    before = np.where(known, before, 1.0)
    after = np.where(known, target.time - states.time[pick], 1.0)
    weight = (2 / (after * (before + after)) / model.sudden[pick, None]) ** 2
    ratio = after / before
    variance, earlier = states.variance[pick], states.earlier_variance[pick]
    place = states.position[pick] + states.velocity[pick] * after[..., None] - target.centre[pick][:, None]
    return unlikelihood(
        rows(
            place,
            weight / model.nu,
            weight * ((1 + ratio) ** 2 * variance + ratio**2 * earlier),
            weight,
            known,
        ),
        target.columns[pick],
        model.nu,
        noisy=bool(target.channels.variance.any() or variance.any() or earlier.any()),
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
    reach = np.concatenate(
        [
            np.asarray(model.max_speed)[:, None] * since[:N_JOINTS],
            2 * np.sin(np.minimum(np.asarray(model.max_swing)[:, None] * since[N_JOINTS:], np.pi) / 2),
        ]
    )  # metres, and the chord of the angle
    reach[~known] = np.inf
    # Directions that may turn by any angle, and joints that may be anywhere, need not be looked at.
    bound = np.where(np.arange(len(reach)) < N_JOINTS, np.inf, 2.0)
    pick = np.flatnonzero((reach < bound[:, None]).any(axis=1))
    squared = _squared(place[pick], target.columns[pick])
    limit = reach[pick][:, :, None]
    if noisy:
        limit = limit + model.spread * (
            np.sqrt(variance[pick])[:, :, None] + np.sqrt(target.channels.variance[pick])[:, None]
        )
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
