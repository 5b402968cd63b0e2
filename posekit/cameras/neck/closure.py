"""How far the rigid parts are from closing, with the neck at a given distance: over all branches, or for one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras.neck.body import NeckRays
from posekit.geometry import Array
from posekit.skeleton import JOINT

N_BRANCHES = 32
"""Near or far of both shoulders, the pelvis and both hips: the bits of a branch, the right shoulder's the highest."""

TANGENT_ROUNDING = 1e-12
"""Rounding of a distance, relative to it, at which a tangent ray still touches."""

JOINTS_LIFTED = ("right_shoulder", "left_shoulder", "pelvis", "right_hip", "left_hip")
R, L, P, A, B = (JOINT[name] for name in JOINTS_LIFTED)
N = JOINT["neck"]

Rows = NDArray[np.intp]


class _Segment(NamedTuple):
    """A segment of F frames: cosine and sine between its rays, its length, and the farthest of its end."""

    cosine: Array
    sine: Array
    length: float
    farthest: Array
    tangent: Array
    seen: NDArray[np.bool_]

    def ends(self, rows: Rows, start: Array) -> tuple[Array, Array]:
        """Return the nearer and the farther end for starts (n, ...) of some frames; NaN where there is none."""
        shape = rows.shape + (1,) * (start.ndim - rows.ndim)
        cosine, sine = self.cosine[rows].reshape(shape), self.sine[rows].reshape(shape)
        seen, farthest, tangent = (
            values[rows].reshape(shape) for values in (self.seen, self.farthest, self.tangent)
        )
        height = start * sine
        foot = start * cosine
        half = np.sqrt(np.maximum((self.length - height) * (self.length + height), 0.0))
        reach = height <= self.length + tangent + TANGENT_ROUNDING * start
        both = []
        for end in (foot - half, foot + half):
            possible = reach & (end > 0) & (end <= farthest * (1 + TANGENT_ROUNDING))
            both.append(np.where(possible, end, np.nan))
        # A joint that was not seen excludes nothing: it has one end, at the start, and no distance reads it.
        return np.where(seen, both[0], start), np.where(seen, both[1], np.nan)


class _Distance(NamedTuple):
    """A rigid distance of F frames: half the angle's sine, squared, and the length."""

    half_sine: Array
    length: float
    seen: NDArray[np.bool_]

    def misfit(self, rows: Rows, a: Array, b: Array) -> Array:
        """Return by how much two points at distances a and b along their rays are too far apart, metres."""
        shape = rows.shape + (1,) * (max(a.ndim, b.ndim) - rows.ndim)
        half_sine = self.half_sine[rows].reshape(shape)
        apart = np.sqrt((a - b) ** 2 + 4 * a * b * half_sine)
        unseen = np.where(np.isnan(a + b), np.nan, 0.0)  # an end that is excluded stays so
        return np.where(self.seen[rows].reshape(shape), apart - self.length, unseen)


class RigidClosure:
    """The misfit of the four distances that lift nothing, as a function of the neck's distance.

    Parameters
    ----------
    sight : NeckRays
        The rays of F frames.

    Attributes
    ----------
    known : int array (F,)
        How many of the four distances are seen.
    nearest, unit : float
        The least distance of the neck, and the length of neck-pelvis, metres.
    """

    def __init__(self, sight: NeckRays) -> None:
        seen = np.isfinite(sight.rays[..., 0])
        self._lifts = {}
        for parent, child in ((N, R), (N, L), (N, P), (P, A), (P, B)):
            cosine, sine = sight.angle(parent, child)
            known = seen[:, parent] & seen[:, child]
            self._lifts[child] = _Segment(
                cosine,
                sine,
                sight.length(parent, child),
                np.where(np.isnan(sight.farthest[:, child]), np.inf, sight.farthest[:, child]),
                sight.tangent,
                known,
            )
        self._distances = {}
        for a, b in ((R, L), (R, P), (L, P), (A, B)):
            gap = np.linalg.norm(sight.rays[:, a] - sight.rays[:, b], axis=-1) / 2
            known = self._lifts[a].seen & self._lifts[b].seen
            if a == A:
                known = known & self._lifts[P].seen
            self._distances[a, b] = _Distance(gap**2, sight.length(a, b), known)
        self.known = np.sum([distance.seen for distance in self._distances.values()], axis=0)
        self.nearest = sight.nearest
        self.unit = sight.lengths["neck-pelvis"]

    def breaks(self, rows: Rows) -> Array:
        """Return the distances of the neck at which a branch may begin or end (n, 19); NaN where none does.

        Between two of them that lie close together a branch may live that no grid would meet.
        """
        turns = [_turns(self._lifts[joint], rows, None) for joint in (R, L, P)]
        pelvis = [_turns(self._lifts[joint], rows, None) for joint in (A, B)]
        turns += [_turns(self._lifts[P], rows, at)[:, :2] for ends in pelvis for at in ends.T]
        return np.concatenate(turns, axis=1)

    def all(self, rows: Rows, neck: Array) -> Array:
        """Return the misfit of every branch.

        Parameters
        ----------
        rows : int array (n,)
            Frames.
        neck : array (n, G)
            Distances of the neck, metres.

        Returns
        -------
        array (n, G, 32)
            The largest of the four misfits, metres; infinite where a branch has no solution.
        """
        right, left, p = (np.stack(self._lifts[joint].ends(rows, neck), axis=-1) for joint in (R, L, P))
        a, b = (np.stack(self._lifts[joint].ends(rows, p), axis=-1) for joint in (A, B))
        d = self._distances
        girdle = np.abs(d[R, L].misfit(rows, right[..., :, None], left[..., None, :]))
        to_right = np.abs(d[R, P].misfit(rows, right[..., :, None], p[..., None, :]))
        to_left = np.abs(d[L, P].misfit(rows, left[..., :, None], p[..., None, :]))
        hips = np.abs(d[A, B].misfit(rows, a[..., :, None], b[..., None, :])).reshape(*neck.shape, 2, 4)
        torso = np.maximum(
            girdle[..., :, :, None], np.maximum(to_right[..., :, None, :], to_left[..., None, :, :])
        )
        total = np.maximum(torso[..., None], hips[..., None, None, :, :]).reshape(*neck.shape, N_BRANCHES)
        return np.where(np.isnan(total) | (neck < self.nearest)[..., None], np.inf, total)

    def least(self, rows: Rows, neck: Array) -> Array:
        """Return the least misfit over all branches (n,) for one distance (n,) each."""
        least: Array = self.all(rows, neck[:, None])[:, 0].min(axis=-1)
        return least

    def one(self, rows: Rows, branch: NDArray[np.intp], neck: Array) -> Array:
        """Return the misfit (n,) of one branch each, at one distance each; infinite without a solution."""

        def lift(joint: int, start: Array, bit: int) -> Array:
            near, far = self._lifts[joint].ends(rows, start)
            return np.where(branch >> bit & 1, far, near)

        right, left, p = lift(R, neck, 4), lift(L, neck, 3), lift(P, neck, 2)
        a, b = lift(A, p, 1), lift(B, p, 0)
        d = self._distances
        total = np.abs(d[R, L].misfit(rows, right, left))
        for pair, start, end in (((R, P), right, p), ((L, P), left, p), ((A, B), a, b)):
            total = np.maximum(total, np.abs(d[pair].misfit(rows, start, end)))
        return np.where(np.isnan(total) | (neck < self.nearest), np.inf, total)


def _turns(segment: _Segment, rows: Rows, end: Array | None) -> Array:
    """Return the starts (n, 3) from which a segment's end is as far as told, or farthest, and its tangent."""
    cosine, sine = segment.cosine[rows], segment.sine[rows]
    at = segment.farthest[rows] if end is None else end
    with np.errstate(all="ignore"):
        half = np.sqrt((segment.length - at * sine) * (segment.length + at * sine))
        turns = np.stack([at * cosine - half, at * cosine + half, segment.length / sine], axis=-1)
    return np.where(segment.seen[rows, None] & np.isfinite(turns), turns, np.nan)
