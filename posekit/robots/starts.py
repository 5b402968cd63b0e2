"""Where inverse kinematics starts from: shapes looked up in tables by the points that they place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.robots.kinematics import Kinematics
from posekit.robots.start_tables import Table, Tables, write

NEAREST = 96
"""Shapes of a table among which the starts are chosen."""

APART = 0.7
"""Radians by which two starts differ in at least one joint."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Starts:
    """Starts for one model, its points and its limits.

    Parameters
    ----------
    kinematics : Kinematics
    tables : Tables
    """

    kinematics: Kinematics
    tables: Tables

    def trunks(self, targets: Array, count: int) -> Array:
        """Find configurations whose trunk lies best on the targets.

        A free-flyer is laid by the rigid motion that brings the shape's points onto the targets (Kabsch 1976);
        the shapes are compared by their points' mutual distances before.

        Parameters
        ----------
        targets : array (N, P, 3)
            NaN is unknown.
        count : int

        Returns
        -------
        array (count, N, nq)
            The best first; limbs at rest.
        """
        table, n = self.tables.trunk, len(targets)
        seen = targets[:, table.points]
        known = np.asarray(np.isfinite(seen).all(axis=2))
        weights = np.where(known, table.weights, 0.0)
        seen = np.where(known[..., None], seen, 0.0)
        if self.tables.base < 0:
            rank = choose(table, _squared_distances(table.positions, seen, weights), count)
            return np.stack(
                [self._write(np.tile(self.tables.rest, (n, 1)), table, chosen) for chosen in rank.T]
            )
        first, second = np.triu_indices(len(table.points), 1)
        shape = np.linalg.norm(table.positions[:, first] - table.positions[:, second], axis=2)
        gap = np.linalg.norm(seen[:, first] - seen[:, second], axis=2)
        share = weights[:, first] * weights[:, second] / np.maximum(weights.sum(axis=1, keepdims=True), 1e-12)
        misfit = (
            (share @ shape.T**2) - 2 * ((share * gap) @ shape.T) + (share * gap * gap).sum(axis=1)[:, None]
        )
        rank = choose(table, misfit, 2 * count)
        laid, misfits = [], []
        for chosen in rank.T:
            R, t, left = lay(table.positions[chosen], seen, weights)
            q = self._write(np.tile(self.tables.rest, (n, 1)), table, chosen)
            laid.append(self._lay_base(q, R, t))
            misfits.append(left + table.penalty[chosen])
        order = np.argsort(np.array(misfits), axis=0, kind="stable")[:count]
        return np.take_along_axis(np.array(laid), order[..., None], axis=0)

    def limb(self, index: int, q: Array, targets: Array, count: int) -> Array:
        """Find values of a limb's joints that lie best on the targets, given what carries it.

        Parameters
        ----------
        index : int
            Into `limbs`.
        q : array (N, nq)
        targets : array (N, P, 3)
        count : int

        Returns
        -------
        array (count, N, nq)
            q with the limb's joints replaced, the best first.
        """
        table = self.tables.limbs[index]
        rotation, origin = self.kinematics.joint_placements(q, table.carrier)
        seen = targets[:, table.points]
        known = np.isfinite(seen).all(axis=2)
        local = np.einsum("nji,npj->npi", rotation, np.nan_to_num(seen) - origin[:, None])
        misfit = _squared_distances(table.positions, local, np.where(known, table.weights, 0.0))
        rank = choose(table, misfit, count)
        return np.stack([self._write(q.copy(), table, chosen) for chosen in rank.T])

    def _write(self, q: Array, table: Table, chosen: NDArray[np.intp]) -> Array:
        return write(self.kinematics.space, q, table.dofs, table.values[chosen])

    def _lay_base(self, q: Array, R: Array, t: Array) -> Array:
        """Move the whole model by a rigid motion."""
        placement = self.kinematics.model.jointPlacements[self.kinematics.space.free[0]]
        turn = np.einsum("ji,njk,kl->nil", placement.rotation, R, placement.rotation)
        shift = (
            np.einsum("nij,j->ni", R, placement.translation) + t - placement.translation
        ) @ placement.rotation
        at = self.tables.base
        q[:, at : at + 3] = np.einsum("nij,nj->ni", turn, q[:, at : at + 3]) + shift
        q[:, at + 3 : at + 7] = quaternions(turn)
        return q


def choose(table: Table, misfit: Array, count: int) -> NDArray[np.intp]:
    """Choose shapes (N, count) of small misfit (N, M) that are apart from each other, the best first."""
    total = misfit + table.penalty
    keep = min(NEAREST, total.shape[1])
    nearest = np.argpartition(total, keep - 1, axis=1)[:, :keep]
    cost = np.take_along_axis(total, nearest, axis=1)
    order = np.argsort(cost, axis=1, kind="stable")
    nearest, cost = np.take_along_axis(nearest, order, axis=1), np.take_along_axis(cost, order, axis=1)
    rows = np.arange(len(total))
    chosen = np.empty((len(total), count), dtype=np.intp)
    for k in range(count):
        best = np.argmin(cost, axis=1)
        chosen[:, k] = nearest[rows, best]
        if k + 1 < count and table.values.shape[1]:
            # Those near a chosen one come after all others, the chosen one itself after these.
            away = np.abs(table.values[nearest] - table.values[chosen[:, k]][:, None]).max(axis=2)
            cost = cost + np.where(away == 0, 1e12, np.where(away < APART, 1e6, 0.0))
    return chosen


def lay(shape: Array, seen: Array, weights: Array) -> tuple[Array, Array, Array]:
    """Lay shapes (N, K, 3) on seen points (N, K, 3): rotation, translation and the squared distance left.

    Kabsch 1976, with Umeyama's (1991) sign. Where the points do not determine the rotation, the one nearest to none.
    """
    total = np.maximum(weights.sum(axis=1), 1e-12)[:, None]
    a = np.einsum("nk,nki->ni", weights, shape) / total
    b = np.einsum("nk,nki->ni", weights, seen) / total
    x, y = shape - a[:, None], seen - b[:, None]
    covariance = np.einsum("nk,nki,nkj->nij", weights, y, x)
    size = np.einsum("nii->n", covariance @ np.swapaxes(covariance, 1, 2)) ** 0.5
    U, _, Vt = np.linalg.svd(covariance + (1e-9 * size + 1e-15)[:, None, None] * np.eye(3))
    U[:, :, 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
    R = U @ Vt
    left = y - np.einsum("nij,nkj->nki", R, x)
    return R, b - np.einsum("nij,nj->ni", R, a), np.einsum("nk,nki,nki->n", weights, left, left)


def quaternions(R: Array) -> Array:
    """Turn rotations (N, 3, 3) into unit quaternions (N, 4), x, y, z, w, by the largest entry (Shepperd 1978)."""
    xx, yy, zz = R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]
    a, b, c = R[:, 1, 0] + R[:, 0, 1], R[:, 0, 2] + R[:, 2, 0], R[:, 2, 1] + R[:, 1, 2]
    u, v, w = R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]
    candidates = np.array(
        [
            [1 + xx - yy - zz, a, b, u],
            [a, 1 - xx + yy - zz, c, v],
            [b, c, 1 - xx - yy + zz, w],
            [u, v, w, 1 + xx + yy + zz],
        ]
    )
    largest = np.argmax(np.einsum("iin->in", candidates), axis=0)
    q = candidates[largest, :, np.arange(len(R))]
    return np.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))


def _squared_distances(positions: Array, seen: Array, weights: Array) -> Array:
    """Return the weighted sum of squared distances of seen points (N, K, 3) to shapes (M, K, 3): (N, M)."""
    m = len(positions)
    cross = (seen * weights[..., None]).reshape(len(seen), -1) @ positions.reshape(m, -1).T
    own = (weights * np.einsum("nki,nki->nk", seen, seen)).sum(axis=1)
    return np.asarray(own[:, None] - 2 * cross + weights @ np.einsum("mki,mki->mk", positions, positions).T)
