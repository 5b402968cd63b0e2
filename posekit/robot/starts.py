"""Where inverse kinematics starts from: tables of sampled limbs and trunks, looked up by the points they place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.robot.configuration_space import ConfigurationSpace
from posekit.robot.kinematics import Kinematics

SAMPLES = 4096
"""Shapes in a table: a limb of four joints is then met to some 20 degrees."""

NEAREST = 96
"""Shapes of a table among which the starts are chosen."""

APART = 0.7
"""Radians by which two starts differ in at least one joint."""

PULL = 1e-3
"""Preference of shapes near the neutral one, m^2/rad^2: it decides between shapes that place the points alike."""

FEW = 3
"""Joints that place a limb's first point: up to so many are sampled with the trunk, where that point is needed to
tell how the trunk is turned: a clavicle's, not a hip's."""

GIRDLE = 0.5
"""Weight of such a point in the trunk's table."""


class Branch(NamedTuple):
    """Entries of v that move points as a chain does: each moves a part of what the one before moves.

    Attributes
    ----------
    dofs : int array
        Entries of v, those that move most first.
    points : int array
        What they move.
    """

    dofs: NDArray[np.intp]
    points: NDArray[np.intp]


class Table(NamedTuple):
    """Sampled shapes.

    Attributes
    ----------
    dofs : int array (D,)
        Entries of v.
    values : array (M, D)
        Their values: angles and positions, zero for a continuous joint's neutral.
    points : int array (K,)
    weights : array (K,)
    positions : array (M, K, 3)
        Where the points are, in the frame of the body that carries the shape (the world for a trunk), metres.
    penalty : array (M,)
        Added to the squared distances, m^2.
    carrier : int
        The joint whose body carries it.
    """

    dofs: NDArray[np.intp]
    values: Array
    points: NDArray[np.intp]
    weights: Array
    positions: Array
    penalty: Array
    carrier: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Starts:
    """Tables for one model, its points and its limits.

    Parameters
    ----------
    kinematics : Kinematics
    trunk : Table
        Joints that move several limbs, and the roots of the limbs; without the free-flyer.
    limbs : tuple of Table
    base : int
        Where the free-flyer at the root starts in q; -1 for a fixed base.
    rest : array (nq,)
        The neutral configuration inside the limits.
    """

    kinematics: Kinematics
    trunk: Table
    limbs: tuple[Table, ...]
    base: int
    rest: Array

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
        table, n = self.trunk, len(targets)
        seen = targets[:, table.points]
        known = np.isfinite(seen).all(axis=2)
        weights = np.where(known, table.weights, 0.0)
        seen = np.where(known[..., None], seen, 0.0)
        if self.base < 0:
            rank = choose(table, _squared_distances(table.positions, seen, weights), count)
            return np.stack([self._write(np.tile(self.rest, (n, 1)), table, chosen) for chosen in rank.T])
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
            q = self._write(np.tile(self.rest, (n, 1)), table, chosen)
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
        table = self.limbs[index]
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
        at = self.base
        q[:, at : at + 3] = np.einsum("nij,nj->ni", turn, q[:, at : at + 3]) + shift
        q[:, at + 3 : at + 7] = quaternions(turn)
        return q


def make_starts(kinematics: Kinematics, lower: Array, upper: Array) -> Starts:
    """Sample the tables: deterministic, the same for the same model, points and limits."""
    space, model = kinematics.space, kinematics.model
    rest = np.clip(pin.neutral(model), lower, upper)
    base = -1
    moved = kinematics.moved_by
    if space.free and model.parents[space.free[0]] == 0 and moved[:, space.free_v[0]].all():
        base = int(space.free_q[0])
    branches = find_branches(kinematics)
    in_branches = {int(v) for branch in branches for v in branch.dofs}
    free = {int(v) + k for v in space.free_v for k in range(6)}
    trunk_dofs = [v for v in range(space.nv) if moved[:, v].any() and v not in in_branches and v not in free]
    limb_points = {int(p) for branch in branches for p in branch.points}
    points = [p for p in range(len(moved)) if p not in limb_points]
    weights = [1.0] * len(points)
    for branch in branches:
        count = moved[:, branch.dofs].sum(axis=1)
        near = [p for p in branch.points if count[p] == count[branch.points].min()]
        roots = [int(v) for v in branch.dofs if moved[near, v].any()]
        held = _held_by(kinematics, carrier_of(model, int(branch.dofs[0])))
        if len(roots) < len(branch.dofs) and len(roots) <= FEW and len(held) < 3:
            trunk_dofs += roots
            points += [int(p) for p in near]
            weights += [GIRDLE] * len(near)
    trunk = _sample(kinematics, rest, lower, upper, np.array(trunk_dofs, dtype=np.intp), points, weights, 0)
    limbs = []
    for branch in branches:
        joint = next(
            j
            for j in range(1, model.njoints)
            if model.idx_vs[j] <= branch.dofs[0] < model.idx_vs[j] + model.nvs[j]
        )
        limbs.append(
            _sample(
                kinematics,
                rest,
                lower,
                upper,
                branch.dofs,
                list(branch.points),
                [1.0] * len(branch.points),
                int(model.parents[joint]),
            )
        )
    return Starts(kinematics=kinematics, trunk=trunk, limbs=tuple(limbs), base=base, rest=rest)


def find_branches(kinematics: Kinematics) -> tuple[Branch, ...]:
    """Find the limbs: the longest runs of joints that move ever fewer of the same points."""
    moved = kinematics.moved_by
    free = {int(v) + k for v in kinematics.space.free_v for k in range(6)}
    sets = {
        v: frozenset(np.flatnonzero(moved[:, v]).tolist())
        for v in range(moved.shape[1])
        if moved[:, v].any() and v not in free
    }
    different = set(sets.values())
    chains = [s for s in different if _is_chain([t for t in different if t <= s])]
    tops = sorted((s for s in chains if not any(s < other for other in chains)), key=sorted)
    branches = []
    for top in tops:
        dofs = sorted((v for v, s in sets.items() if s <= top), key=lambda v: (-len(sets[v]), v))
        branches.append(Branch(np.array(dofs, dtype=np.intp), np.array(sorted(top), dtype=np.intp)))
    return tuple(branches)


def carrier_of(model: pin.Model, v: int) -> int:
    """Return the joint whose body carries the joint of an entry of v; 0 is the world."""
    first = list(model.idx_vs)
    joint = next(j for j in range(1, model.njoints) if first[j] <= v < first[j] + model.nvs[j])
    return int(model.parents[joint])


def _held_by(kinematics: Kinematics, joint: int) -> list[int]:
    """List the points that keep their place in a joint's body: three of them tell how it is turned."""
    space = kinematics.space
    draws = np.random.default_rng(0).uniform(-1.0, 1.0, (4, space.nv))
    q = space.integrate(np.tile(pin.neutral(kinematics.model), (4, 1)), draws)
    rotation, origin = kinematics.joint_placements(q, joint)
    local = np.einsum("nji,npj->npi", rotation, kinematics.positions(q) - origin[:, None])
    return np.flatnonzero((np.ptp(local, axis=0) < 1e-9).all(axis=1)).tolist()


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


def write(space: ConfigurationSpace, q: Array, dofs: NDArray[np.intp], values: Array) -> Array:
    """Set joints of configurations q (N, nq), in place, by their entries of v."""
    where = {int(v): int(k) for v, k in zip(space.bounded_v, space.bounded_q, strict=True)}
    turns = {int(v): int(k) for v, k in zip(space.turn_v, space.turn_q, strict=True)}
    for column, v in enumerate(dofs):
        if int(v) in where:
            q[:, where[int(v)]] = values[:, column]
        else:
            k = turns[int(v)]
            q[:, k], q[:, k + 1] = np.cos(values[:, column]), np.sin(values[:, column])
    return q


def quaternions(R: Array) -> Array:
    """Turn rotations (N, 3, 3) into unit quaternions (N, 4), order x, y, z, w, from the largest entry (Shepperd 1978)."""
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


def _is_chain(sets: list[frozenset[int]]) -> bool:
    return all(a <= b or b <= a for a in sets for b in sets)


def _squared_distances(positions: Array, seen: Array, weights: Array) -> Array:
    """Return the weighted sum of squared distances of seen points (N, K, 3) to shapes (M, K, 3): (N, M)."""
    m = len(positions)
    cross = (seen * weights[..., None]).reshape(len(seen), -1) @ positions.reshape(m, -1).T
    own = (weights * np.einsum("nki,nki->nk", seen, seen)).sum(axis=1)
    return np.asarray(own[:, None] - 2 * cross + weights @ np.einsum("mki,mki->mk", positions, positions).T)


def _sample(
    kinematics: Kinematics,
    rest: Array,
    lower: Array,
    upper: Array,
    dofs: NDArray[np.intp],
    points: list[int],
    weights: list[float],
    carrier: int,
) -> Table:
    """Sample joints within their limits by an additive recurrence of low discrepancy (Roberts 2018), rest first."""
    space = kinematics.space
    q_of = dict(zip(space.bounded_v.tolist(), space.bounded_q.tolist(), strict=True))
    middle = np.array([rest[q_of[v]] if v in q_of else 0.0 for v in dofs.tolist()])
    low = np.array([lower[q_of[v]] if v in q_of else -np.pi for v in dofs.tolist()])
    high = np.array([upper[q_of[v]] if v in q_of else np.pi for v in dofs.tolist()])
    low = np.where(np.isfinite(low), np.maximum(low, middle - 2 * np.pi), middle - np.pi)
    high = np.where(np.isfinite(high), np.minimum(high, middle + 2 * np.pi), middle + np.pi)
    count = SAMPLES if len(dofs) else 1
    root = 2.0
    for _ in range(60):  # the root of x^(d+1) = x + 1
        root = (1 + root) ** (1 / (len(dofs) + 1))
    step = root ** -np.arange(1, len(dofs) + 1)
    values = low + (high - low) * np.mod(0.5 + np.outer(np.arange(count), step), 1.0)
    values[0] = middle
    q = write(space, np.tile(rest, (count, 1)), dofs, values)
    positions = kinematics.positions(q)[:, points]
    rotation, origin = kinematics.joint_placements(q, carrier)
    return Table(
        dofs=dofs,
        values=values,
        points=np.array(points, dtype=np.intp),
        weights=np.array(weights),
        positions=np.einsum("nji,npj->npi", rotation, positions - origin[:, None]),
        penalty=PULL * ((values - middle) ** 2).sum(axis=1),
        carrier=carrier,
    )
