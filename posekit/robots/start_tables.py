"""Tables of sampled limbs and trunks: shapes, and where they place the points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.robots.configuration_space import ConfigurationSpace
from posekit.robots.kinematics import Kinematics

N_SAMPLES = 4096
"""Shapes in a table: a limb of four joints is then met to some 20 degrees."""

NEUTRAL_PULL = 1e-3
"""Preference of shapes near the neutral one, m^2/rad^2: it decides between shapes that place the points alike."""

MAX_GIRDLE_JOINTS = 3
"""Joints that place a limb's first point: up to so many are sampled with the trunk, where that point is needed to
tell how the trunk is turned: a clavicle's, not a hip's."""

GIRDLE_WEIGHT = 0.5
"""Weight of such a point in the trunk's table."""

HELD_METRES = 1e-9
"""Metres within which a point keeps its place in a body."""


class CarriedBranch(NamedTuple):
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


class ShapeTable(NamedTuple):
    """Sampled shapes.

    Attributes
    ----------
    dofs : int array (D,)
        Entries of v.
    values : array (M, D)
        Their values: angles and positions, zero for a continuous joint's neutral.
    points : int array (K,)
        Which points the shape places.
    weights : array (K,)
        Of the points' squared distances.
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


class ShapeTables(NamedTuple):
    """All tables of a model.

    Attributes
    ----------
    trunk : Table
        Joints that move several limbs, and the roots of limbs; without the free-flyer.
    limbs : tuple of Table
        One for each limb.
    base : int
        Where the free-flyer at the root starts in q; -1 for a fixed base.
    rest : array (nq,)
        The neutral configuration inside the limits.
    """

    trunk: ShapeTable
    limbs: tuple[ShapeTable, ...]
    base: int
    rest: Array


def make_tables(kinematics: Kinematics, lower: Array, upper: Array) -> ShapeTables:
    """Sample the tables: deterministic, the same for the same model, points and limits (nq,)."""
    space, model = kinematics.space, kinematics.model
    rest = np.clip(kinematics.neutral, lower, upper)
    moved = kinematics.moved_by
    base = -1
    if space.free and model.parents[space.free[0]] == 0 and moved[:, space.free_v[0]].all():
        base = int(space.free_q[0])
    branches = find_branches(kinematics)
    in_branches = {int(v) for branch in branches for v in branch.dofs} | _free(space)
    trunk_dofs = [v for v in range(space.nv) if moved[:, v].any() and v not in in_branches]
    limb_points = {int(p) for branch in branches for p in branch.points}
    points = [p for p in range(len(moved)) if p not in limb_points]
    weights = [1.0] * len(points)
    limbs = []
    for branch in branches:
        carrier = carrier_of(model, int(branch.dofs[0]))
        count = moved[:, branch.dofs].sum(axis=1)
        near = [int(p) for p in branch.points if count[p] == count[branch.points].min()]
        roots = [int(v) for v in branch.dofs if moved[near, v].any()]
        few = len(roots) < len(branch.dofs) and len(roots) <= MAX_GIRDLE_JOINTS
        if few and len(_held_by(kinematics, carrier)) < 3:
            trunk_dofs += [v for v in roots if v not in trunk_dofs]
            new = [p for p in near if p not in points]
            points += new
            weights += [GIRDLE_WEIGHT] * len(new)
        own = branch.points.tolist()
        limbs.append(_sample(kinematics, (lower, upper), rest, branch.dofs, own, [1.0] * len(own), carrier))
    if base >= 0 and len(points) < 3:
        # As of a hand of which the fingertips are known: they alone tell how it is turned.
        trunk_dofs += [int(v) for branch in branches for v in branch.dofs if v not in trunk_dofs]
        points, weights = list(range(len(moved))), [1.0] * len(moved)
    dofs = np.array(trunk_dofs, dtype=np.intp)
    trunk = _sample(kinematics, (lower, upper), rest, dofs, points, weights, 0)
    return ShapeTables(trunk, tuple(limbs), base, rest)


def find_branches(kinematics: Kinematics) -> tuple[CarriedBranch, ...]:
    """Find the limbs: the longest runs of joints that move ever fewer of the same points."""
    moved = kinematics.moved_by
    free = _free(kinematics.space)
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
        branches.append(CarriedBranch(np.array(dofs, dtype=np.intp), np.array(sorted(top), dtype=np.intp)))
    return tuple(branches)


def carrier_of(model: pin.Model, v: int) -> int:
    """Return the joint whose body carries the joint of an entry of v; 0 is the world."""
    first = list(model.idx_vs)
    joint = next(j for j in range(1, model.njoints) if first[j] <= v < first[j] + model.nvs[j])
    return int(model.parents[joint])


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


def _held_by(kinematics: Kinematics, joint: int) -> list[int]:
    """List the points that keep their place in a joint's body: three of them tell how it is turned."""
    rotation, origin = kinematics.joint_placements(kinematics.generic, joint)
    local = np.einsum("nji,npj->npi", rotation, kinematics.positions(kinematics.generic) - origin[:, None])
    return [int(point) for point in np.flatnonzero((np.ptp(local, axis=0) < HELD_METRES).all(axis=1))]


def _is_chain(sets: list[frozenset[int]]) -> bool:
    return all(a <= b or b <= a for a in sets for b in sets)


def _free(space: ConfigurationSpace) -> set[int]:
    """Return the entries of v of free-flyers."""
    return {int(v) + k for v in space.free_v for k in range(6)}


def _sample(
    kinematics: Kinematics,
    limits: tuple[Array, Array],
    rest: Array,
    dofs: NDArray[np.intp],
    points: list[int],
    weights: list[float],
    carrier: int,
) -> ShapeTable:
    """Sample joints within their limits by an additive recurrence of low discrepancy (Roberts 2018), rest first."""
    space = kinematics.space
    lower, upper = limits
    q_of = dict(zip(space.bounded_v.tolist(), space.bounded_q.tolist(), strict=True))
    middle = np.array([rest[q_of[v]] if v in q_of else 0.0 for v in dofs.tolist()])
    low = np.array([lower[q_of[v]] if v in q_of else -np.pi for v in dofs.tolist()])
    high = np.array([upper[q_of[v]] if v in q_of else np.pi for v in dofs.tolist()])
    low = np.where(np.isfinite(low), np.maximum(low, middle - 2 * np.pi), middle - np.pi)
    high = np.where(np.isfinite(high), np.minimum(high, middle + 2 * np.pi), middle + np.pi)
    count = N_SAMPLES if len(dofs) else 1
    root = 2.0
    for _ in range(60):  # the root of x^(d+1) = x + 1
        root = (1 + root) ** (1 / (len(dofs) + 1))
    step = root ** -np.arange(1, len(dofs) + 1)
    values = low + (high - low) * np.mod(0.5 + np.outer(np.arange(count), step), 1.0)
    values[0] = middle
    q = write(space, np.tile(rest, (count, 1)), dofs, values)
    positions = kinematics.positions(q)[:, points]
    rotation, origin = kinematics.joint_placements(q, carrier)
    return ShapeTable(
        dofs=dofs,
        values=values,
        points=np.array(points, dtype=np.intp),
        weights=np.array(weights),
        positions=np.einsum("nji,npj->npi", rotation, positions - origin[:, None]),
        penalty=NEUTRAL_PULL * ((values - middle) ** 2).sum(axis=1),
        carrier=carrier,
    )
