"""Where inverse kinematics starts from: shapes looked up in tables by the points that they place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, best_rotation, centred_covariance, quaternion_from_rotation
from posekit.robots.kinematics import Kinematics
from posekit.robots.start_tables import ShapeTable, ShapeTables, write

N_NEAREST = 96
"""Shapes of a table among which the starts are chosen."""

DISTINCT_RADIANS = 0.7
"""Radians by which two starts differ in at least one joint."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchStarts:
    """Starts for one model, its points and its limits.

    Parameters
    ----------
    kinematics : Kinematics
        The model and its points.
    tables : ShapeTables
        Sampled shapes of its parts.
    """

    kinematics: Kinematics
    tables: ShapeTables

    def trunks(self, targets: Array, count: int) -> Array:
        """Find configurations whose trunk lies best on the targets.

        A free-flyer is laid by the rigid motion that brings the shape's points onto the targets (Kabsch 1976);
        the shapes are compared by their points' mutual distances before.

        Parameters
        ----------
        targets : array (N, P, 3)
            NaN is unknown.
        count : int
            How many are wanted.

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
            Configurations whose other joints are laid.
        targets : array (N, P, 3)
            Metres; NaN is unknown.
        count : int
            How many are wanted.

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

    def _write(self, q: Array, table: ShapeTable, chosen: NDArray[np.intp]) -> Array:
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
        q[:, at + 3 : at + 7] = quaternion_from_rotation(turn, shorter=False)
        return q


def choose(table: ShapeTable, misfit: Array, count: int) -> NDArray[np.intp]:
    """Choose shapes (N, count) of small misfit (N, M) that are apart from each other, the best first."""
    total = misfit + table.penalty
    keep = min(N_NEAREST, total.shape[1])
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
            cost = cost + np.where(away == 0, 1e12, np.where(away < DISTINCT_RADIANS, 1e6, 0.0))
    return chosen


def lay(shape: Array, seen: Array, weights: Array) -> tuple[Array, Array, Array]:
    """Lay shapes (N, K, 3) on seen points (N, K, 3): rotation, translation and the squared distance left.

    Kabsch 1976, with Umeyama's (1991) sign. Where the points do not determine the rotation, the one nearest to none.
    """
    fit = centred_covariance(shape, seen, weights)
    size = np.einsum("nii->n", fit.covariance @ np.swapaxes(fit.covariance, 1, 2)) ** 0.5
    R, _ = best_rotation(fit.covariance + (1e-9 * size + 1e-15)[:, None, None] * np.eye(3))
    left = fit.y - np.einsum("nij,nkj->nki", R, fit.x)
    shift = fit.mean_y - np.einsum("nij,nj->ni", R, fit.mean_x)
    return R, shift, np.einsum("nk,nki,nki->n", weights, left, left)


def _squared_distances(positions: Array, seen: Array, weights: Array) -> Array:
    """Return the weighted sum of squared distances of seen points (N, K, 3) to shapes (M, K, 3): (N, M)."""
    m = len(positions)
    cross = (seen * weights[..., None]).reshape(len(seen), -1) @ positions.reshape(m, -1).T
    own = (weights * np.einsum("nki,nki->nk", seen, seen)).sum(axis=1)
    return np.asarray(own[:, None] - 2 * cross + weights @ np.einsum("mki,mki->mk", positions, positions).T)
