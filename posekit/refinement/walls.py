r"""Soft limits of limbs that no box of four angles can say: couplings of angles, projected angles.

Whoever judges such limits is asked how far limbs are beyond them, and by differences how that changes as their segments
turn along the tangents of `posekit.refinement.limits`. Turning the part on which a limb hangs by :math:`\omega` is
turning the limb the other way: a direction u moves by :math:`-\omega \times u`, along a tangent t by
:math:`-\omega \cdot (u \times t)`.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross
from posekit.geometry.batch_last import matrix_product, step_rotation
from posekit.refinement.limits import Ball, Signs

STEP_RADIANS = 1e-6
"""Radians by which directions are turned for differences."""

MAX_SLOPE = 100.0
"""The most by which an angle follows a direction: beyond it another way to write the limb is judged."""


REACH_RADIANS = 0.3
"""Radians up to which a limit that a step ran into is watched: farther off, another way to write the limb is judged."""


class Walls(Protocol):
    """Limits of limbs that take the place of the figure's own."""

    @property
    def on_torso(self) -> bool:
        """Whether legs, too, are judged in the torso's frame."""
        ...

    @property
    def loops(self) -> tuple[Array, Array] | None:
        """What compiled loops take: ends (4, 4, 2) and numbers (4, K) of limbs; None where there are none."""
        ...

    def beyond(
        self, limb: int, upper: Array, lower: Array, beside: tuple[Array, Array] | None = None
    ) -> tuple[Array, Array]:
        """Say how far limbs are beyond their limits.

        Parameters
        ----------
        limb : int
            Of `posekit.refinement.figure_numbers.LIMB_JOINTS`.
        upper, lower : array (M, 3)
            Unit directions of the segments, in the frame of the part by which the limb is judged.
        beside : tuple of arrays (K, 3), (K, 3), optional
            Directions from which these were turned by next to nothing, M / K blocks of K: they may be written as those.

        Returns
        -------
        above, below : array (4, M)
            Radians above the upper limits and below the lower ones, about what a direction would have to turn;
            negative where they are not, minus infinity where nothing is judged.
        """
        ...

    def ball(self, part: str, turn: Array) -> tuple[Array, Array] | None:
        """Say the same of the hips under the torso (``pelvis``) or the head on it (``neck``).

        Parameters
        ----------
        part : {"pelvis", "neck"}
            Which of the two ball joints of the trunk it is.
        turn : array (M, 3, 3)
            Rotations of the part in the torso's frame.

        Returns
        -------
        above, below : array (3, M), or None
            None where the figure's own limits hold.
        """
        ...


class Beyond(NamedTuple):
    """M limbs that are beyond their walls, or watched.

    Attributes
    ----------
    limb, row : int array (M,)
        Which limb of the figure each one is, and in which posture of the batch.
    over : array (4, M)
        Radians above the upper limit (positive) or below the lower; watched limits that are not reached count too.
    side : int array (4, M)
        Of which limit: 1 the upper, -1 the lower, 0 where neither counts.
    crossed : int array (4, M)
        The same, of limits that are passed.
    local : array (2, M, 3)
        Directions of the segments in their parts' frames.
    """

    limb: NDArray[np.intp]
    row: NDArray[np.intp]
    over: Array
    side: Signs
    crossed: Signs
    local: Array

    def cost(self) -> Array:
        """Return the squares of what is beyond (M,)."""
        return np.asarray(np.where(self.crossed != 0, self.over**2, 0.0).sum(axis=0))


def beyond_walls(
    walls: Walls,
    directions: Array,
    parent: Array,
    watch: Signs | None = None,
    free: NDArray[np.bool_] | None = None,
) -> Beyond | None:
    """Judge limbs (4, 2, 3, N) on their parents (4, 3, 3, N); `watch` and `free` as for `limb_limits`.

    None where all are inside and nothing is watched.
    """
    parts = []
    for limb in range(4):
        rows = np.arange(directions.shape[3]) if free is None else np.flatnonzero(~free[limb])
        local = np.einsum("ijn,sin->snj", parent[limb][..., rows], directions[limb][..., rows])
        above, below = walls.beyond(limb, *local)
        crossed = np.where((above > 0) & (above >= below), 1, np.where(below > 0, -1, 0)).astype(np.int8)
        side = crossed
        if watch is not None:
            side = _watched(crossed, watch[:, limb, rows], above, below)
        keep = np.flatnonzero((side != 0).any(axis=0))
        if keep.size:
            side, above, below = side[:, keep], above[:, keep], below[:, keep]
            over = np.where(side > 0, above, np.where(side < 0, -below, 0.0))
            one = np.full(len(keep), limb)
            parts.append(Beyond(one, rows[keep], over, side, crossed[:, keep], local[:, keep]))
    if not parts:
        return None
    limb_, row, over, each, passed = (np.concatenate([part[k] for part in parts], axis=-1) for k in range(5))
    return Beyond(limb_, row, over, each, passed, np.concatenate([part.local for part in parts], axis=1))


def ball_walls(
    walls: Walls, part: str, parent: Array, child: Array, watch: Signs | None = None
) -> Ball | None:
    """Judge a part (3, 3, N) on its parent (3, 3, N) as `ball_limits` does; None where no wall is known."""
    turn = np.einsum("ikn,ijn->nkj", parent, child)
    asked = walls.ball(part, turn)
    if asked is None:
        return None
    above, below = asked
    crossed = np.where((above > 0) & (above >= below), 1, np.where(below > 0, -1, 0)).astype(np.int8)
    side = crossed
    if watch is not None:
        side = _watched(crossed, watch, above, below)
    over = np.where(side > 0, above, np.where(side < 0, -below, 0.0))
    felt = np.flatnonzero((side != 0).any(axis=0))
    if not felt.size:
        return Ball(over, None, crossed)
    slope = np.zeros((3, 3, len(felt)))
    # A turn about an axis of the camera is one about that axis as the parent sees it.
    for axis in range(3):
        spin = np.zeros((3, len(felt)))
        spin[axis] = STEP_RADIANS
        moved = matrix_product(step_rotation(spin), child[..., felt])
        higher, lower = walls.ball(part, np.einsum("ikn,ijn->nkj", parent[..., felt], moved)) or asked
        now = np.where(side[:, felt] > 0, higher, -lower)
        slope[:, axis] = (now - over[:, felt]) / STEP_RADIANS
    slope[~(np.abs(slope) < MAX_SLOPE)] = 0.0
    jacobian = np.zeros((3, 3, over.shape[1]))
    jacobian[..., felt] = np.where(side[:, None, felt] != 0, slope, 0.0)
    return Ball(over, jacobian, crossed)


def wall_rows(walls: Walls, found: Beyond, parent: Array, directions: Array, tangents: Array) -> Array:
    """Differentiate what is judged (4, 7, M): along the four `tangents`, and the parent's rotation vector."""
    k, m = found.limb, found.row
    along = tangents[k, :, :, :, m]  # (M, 2, 2, 3)
    rows = np.zeros((4, 7, len(k)))
    # All four at once: a call of a judge costs more than the limbs in it.
    moved = np.repeat(found.local[:, None], 4, axis=1)  # (2, 4, M, 3)
    for segment in range(2):
        turned = moved[segment, 2 * segment : 2 * segment + 2]
        turned += STEP_RADIANS * np.einsum("mij,mti->tmj", parent[k, :, :, m], along[:, segment])
        turned /= np.sqrt(np.einsum("tmi,tmi->tm", turned, turned))[..., None]
    asked = _asked(walls, found, moved)
    for segment in range(2):
        outward = directions[k, segment, :, m]
        for tangent in range(2):
            slope = (asked[:, 2 * segment + tangent] - found.over) / STEP_RADIANS
            slope = np.where((found.side != 0) & (np.abs(slope) < MAX_SLOPE), slope, 0.0)
            rows[:, 2 * segment + tangent] = slope
            rows[:, 4:] -= slope[:, None] * cross(outward.T, along[:, segment, tangent].T, axis=-2)
    return rows


def _watched(crossed: Signs, watch: Signs, above: Array, below: Array) -> Signs:
    """Return which limits count: those that are passed, else those that are watched, where they are near."""
    near = np.where(watch > 0, above, below) > -REACH_RADIANS
    return np.where((crossed == 0) & near, watch, crossed)


def _asked(walls: Walls, found: Beyond, local: Array) -> Array:
    """Ask about the same limits of the same limbs, their segments (2, T, M, 3) turned in T ways (4, T, M)."""
    ways = local.shape[1]
    out = np.zeros((len(found.over), ways, len(found.limb)))
    for limb in range(4):
        own = np.flatnonzero(found.limb == limb)
        if own.size:
            upper, lower = local[:, :, own].reshape(2, -1, 3)
            above, below = walls.beyond(limb, upper, lower, (found.local[0, own], found.local[1, own]))
            past = np.tile(found.side[:, own] > 0, ways)
            out[:, :, own] = np.where(past, above, -below).reshape(-1, ways, len(own))
    return out
