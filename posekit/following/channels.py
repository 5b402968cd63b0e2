"""What of a posture is followed over time: where its joints are, and where its segments point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.skeleton import JOINTS, TREE_SEGMENTS

# The joints at both ends of each segment, in tree order.
SEGMENT_STARTS: Final = np.array([start for start, _ in TREE_SEGMENTS])
SEGMENT_ENDS: Final = np.array([end for _, end in TREE_SEGMENTS])
N_JOINTS: Final = len(JOINTS)
N_SEGMENTS: Final = len(TREE_SEGMENTS)
N_CHANNELS: Final = N_JOINTS + N_SEGMENTS


@dataclass(frozen=True, kw_only=True, eq=False)
class Channels:
    """The 14 joints and the 13 directions of segments of N postures, each a vector that moves.

    Parameters
    ----------
    value : array (27, N, 3)
        Positions of the joints, metres, then unit vectors along the segments; zero where not known.
    variance : array (27, N)
        In each coordinate: square metres, then square radians.
    known : bool array (27, N)
        Whether the posture has the joint, or both ends of the segment.
    """

    value: Array
    variance: Array
    known: NDArray[np.bool_]

    @property
    def centre(self) -> Array:
        """The mean (27, 3) of each channel where it is known."""
        return np.asarray(self.value.sum(axis=1) / np.maximum(self.known.sum(axis=1), 1)[:, None])

    def take(self, rows: NDArray[np.intp]) -> Channels:
        """Return some postures, by index."""
        return Channels(
            value=self.value.take(rows, axis=1),
            variance=self.variance.take(rows, axis=1),
            known=self.known.take(rows, axis=1),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class NextSurvivors:
    """The N survivors of a frame that paths may go on to.

    Parameters
    ----------
    channels : Channels
        Where their joints are and where their segments point.
    time : float
        When, seconds.
    cost : array (N,)
        What each costs itself; finite.
    fresh : bool array (N,)
        Those that no better path uses: a path through one of them is a fresh one.
    """

    channels: Channels
    time: float
    cost: Array
    fresh: NDArray[np.bool_]

    def __len__(self) -> int:
        """Count the survivors."""
        return len(self.cost)


def directions(joints: Array) -> tuple[Array, Array]:
    """Return the unit vectors (..., 13, 3) along the tree's segments and their lengths (..., 13); NaN if not known."""
    along = joints[..., SEGMENT_ENDS, :] - joints[..., SEGMENT_STARTS, :]
    length = np.linalg.norm(along, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = along / length[..., None]
    return np.where(np.isfinite(unit), unit, np.nan), length


def channels_of(joints: Array, deviation: Array) -> Channels:
    """Take the channels of postures (N, 14, 3) whose joints are off by `deviation` (N, 14), metres."""
    unit, length = directions(joints)
    variance = deviation**2
    with np.errstate(divide="ignore", invalid="ignore"):
        # Small errors of both ends, across the segment, turn it by their difference over its length.
        turned = (variance[:, SEGMENT_STARTS] + variance[:, SEGMENT_ENDS]) / length**2
    value = np.concatenate([joints, unit], axis=1).transpose(1, 0, 2)
    known = np.isfinite(value).all(axis=-1)
    spread = np.concatenate([variance, turned], axis=1).T
    return Channels(
        value=np.ascontiguousarray(np.where(known[..., None], value, 0.0)),
        variance=np.ascontiguousarray(np.where(known, spread, 0.0)),
        known=known,
    )
