"""Searches as compiled loops: the numbers of a problem laid out for `posekit.compiled.posture_kernels`.

They do what `posekit.refinement.descent` and `limb_descent` do with arrays, to rounding. Where Numba is not installed,
or limits are judged by what no loop knows, there are none.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from posekit.compiled import posture_kernels
from posekit.compiled.compiling import compiled, is_installed
from posekit.compiled.posture_numbers import LIMB_WEIGHTS, SHAPE_WEIGHTS
from posekit.geometry import Array
from posekit.least_squares import Damping
from posekit.refinement.figure_numbers import Bounds, FigureNumbers
from posekit.refinement.limits import LIMB_BRANCHES, possible_branches
from posekit.refinement.problem import RefinementProblem
from posekit.refinement.state import PostureState
from posekit.refinement.trunk_terms import TRUNK_APART

if TYPE_CHECKING:
    from posekit.refinement.limb_terms import Chains

NO_WALLS = np.zeros((4, 4, 2)), np.zeros((4, 0))
"""Ends and numbers of limits that are boxes."""


def looped_descent(
    problem: RefinementProblem, start: PostureState, settings: Array
) -> tuple[PostureState, Array, NDArray[np.int64], NDArray[np.bool_]] | None:
    """Search from postures by a compiled loop; None where there is none.

    Parameters
    ----------
    problem : RefinementProblem
        Of N postures.
    start : PostureState
        Where the searches begin.
    settings : array (10,)
        As `posekit.compiled.block_kernels.FIRST_DAMPING` and what follows it says.

    Returns
    -------
    state : PostureState
    chi2 : array (N,)
    counts : int array (N, 4)
        Steps, whether each is settled, folds, and limits that are felt.
    asked : bool array (N,)
        Those of which this says nothing: at singular places of their limits.
    """
    walls = _walls(problem)
    if walls is None:
        return None
    states, count = _rows(start), start.root.shape[1]
    chi2, counts, asked = (
        np.full(count, np.inf),
        np.zeros((count, 4), dtype=np.int64),
        np.zeros(count, dtype=np.bool_),
    )
    compiled(posture_kernels).descend_postures(
        states, _data(problem), _figure(problem), TRUNK_APART, *walls, settings, chi2, counts, asked
    )
    return _state(states, start), chi2, counts, asked


def looped_limbs(
    problem: RefinementProblem, chains: Chains, chi2: Array, used: NDArray[np.bool_], settings: Array
) -> NDArray[np.bool_] | None:
    """Fit limbs (4, M) that are used by themselves, in place; return which (4, M) this says nothing of, or None."""
    walls = _walls(problem)
    if walls is None:
        return None
    state = _as_state(chains)
    states, values = _rows(state), np.ascontiguousarray(chi2.T)
    asked = np.zeros(values.shape, dtype=np.bool_)
    compiled(posture_kernels).fit_limbs(
        states,
        _data(problem),
        _figure(problem),
        np.ascontiguousarray(chains.start.transpose(2, 0, 1)),
        np.ascontiguousarray(used.T),
        *walls,
        settings,
        values,
        asked,
    )
    found = _state(states, state)
    chains.directions[...], chains.lengths[...], chi2[...] = found.directions, found.limbs, values.T
    return asked.T


def looped_chi2(problem: RefinementProblem, state: PostureState) -> Array | None:
    """Return chi2 of postures (N,), NaN where it is not told; None where there is no loop."""
    walls = _walls(problem)
    if walls is None:
        return None
    chi2 = np.empty(state.root.shape[1])
    compiled(posture_kernels).value_postures(
        _rows(state), _data(problem), _figure(problem), TRUNK_APART, *walls, chi2
    )
    return chi2


def looped_limb_chi2(problem: RefinementProblem, chains: Chains) -> Array | None:
    """Return chi2 of limbs (4, M), NaN where it is not told; None where there is no loop."""
    walls = _walls(problem)
    if walls is None:
        return None
    states, starts = _rows(_as_state(chains)), np.ascontiguousarray(chains.start.transpose(2, 0, 1))
    chi2 = np.empty((len(states), 4))
    compiled(posture_kernels).value_limbs(states, _data(problem), _figure(problem), starts, *walls, chi2)
    return chi2.T


def looped_trunk_tables(
    problem: RefinementProblem, state: PostureState, floor: float
) -> tuple[Array, Array, Array] | None:
    """Return matrices (N, C, C) and gradients (N, C) of trunks alone, and how heads follow (N, 3, 7), or None.

    None where there is no loop; without a head nothing follows (N, 0, 7).
    """
    if _walls(problem) is None:
        return None
    count, width = state.root.shape[1], problem.trunk_width
    matrix, gradient = np.empty((count, width, width)), np.empty((count, width))
    head = np.empty((count, 0 if problem.head_image is None else 3, 7))
    compiled(posture_kernels).tabulate_trunks(
        _rows(state), _data(problem), _figure(problem), TRUNK_APART, floor, matrix, gradient, head
    )
    return matrix, gradient, head


def looped_limb_tables(
    problem: RefinementProblem, trunks: PostureState, chains: Chains, floor: float
) -> tuple[Array, Array, Array, Array, Array, NDArray[np.int64]] | None:
    """Return what `posekit.refinement.joint_step.LimbTables` has, in its order; None where no loop tells it.

    Folds and limits are the last (4, M, 2); tangents are (4, M, 4, 3).
    """
    walls = _walls(problem)
    if walls is None:
        return None
    count, width, reach = chains.start.shape[2], problem.trunk_width, problem.limb_width
    matrix, gradient = np.empty((4, count, width, width)), np.empty((4, count, width))
    step, slope = np.empty((4, count, reach)), np.empty((4, count, reach, width))
    tangents, counts = np.empty((4, count, 4, 3)), np.empty((4, count, 2), dtype=np.int64)
    states = _rows(trunks._replace(directions=chains.directions, limbs=chains.lengths))
    compiled(posture_kernels).tabulate_limbs(
        states,
        _data(problem),
        _figure(problem),
        *walls,
        floor,
        matrix,
        gradient,
        step,
        slope,
        tangents,
        counts,
    )
    return None if (counts[..., 0] < 0).any() else (matrix, gradient, step, slope, tangents, counts)


def looped_knowledge(problem: RefinementProblem, state: PostureState) -> tuple[Array, ...] | None:
    """Return what covariances follow from, as `posekit.refinement.covariance.JointSystem` has it, or None.

    Matrix, Jacobian, factors, couplings, levers and joints; None where there is no loop, or one posture is not told.
    """
    walls = _walls(problem)
    if walls is None:
        return None
    count, width, reach = state.root.shape[1], problem.trunk_width, problem.limb_width
    arrays = (
        np.empty((width, width, count)),
        np.empty((6, 3, width, count)),
        np.empty((reach, reach, 4, count)),
        np.empty((reach, 7, 4, count)),
        np.zeros((2, 4, 3, reach, count)),
        np.empty((14, 3, count)),
    )
    asked = np.zeros(count, dtype=np.bool_)
    compiled(posture_kernels).know_postures(
        _rows(state), _data(problem), _figure(problem), TRUNK_APART, *walls, *arrays, asked
    )
    return None if asked.any() else arrays


def settings_of(damping: Damping, floor: float, steps: int, precision: float, hopeless: float) -> Array:
    """Lay out what a search is told, as `posekit.compiled.block_kernels.FIRST_DAMPING` and what follows it says."""
    own = (damping.initial, damping.smallest, damping.largest, damping.growth, damping.decay, damping.light)
    return np.array([*own, floor, steps, precision, hopeless], dtype=np.float64)


def _walls(problem: RefinementProblem) -> tuple[Array, Array] | None:
    """Return ends (4, 4, 2) and numbers (4, K) of limits that are no boxes; None where loops do not know all limits."""
    if not is_installed():
        return None
    return NO_WALLS if problem.walls is None or not problem.limited else problem.walls.loops


def _rows(state: PostureState) -> Array:
    """Lay out postures one after the other (N, 71)."""
    return np.ascontiguousarray(np.concatenate([_flat(each) for each in state]).T)


def _as_state(chains: Chains) -> PostureState:
    """Return limbs on the parts by which they are judged as postures; nothing else of them is known."""
    count = chains.start.shape[2]
    return PostureState(
        root=np.zeros((3, count)),
        torso=chains.parent[0],
        hips=chains.parent[2],
        head=chains.parent[0],
        directions=chains.directions,
        shape=np.zeros((9, count)),
        limbs=chains.lengths,
    )


def _flat(array: Array) -> Array:
    """Return an array (..., N) as rows of numbers (K, N)."""
    return array.reshape(math.prod(array.shape[:-1]), array.shape[-1])


def _state(rows: Array, like: PostureState) -> PostureState:
    """Return postures that were laid out so."""
    columns, ends = np.ascontiguousarray(rows.T), np.cumsum([math.prod(each.shape[:-1]) for each in like])
    parts = np.split(columns, ends[:-1])
    return PostureState(*(part.reshape(each.shape) for part, each in zip(parts, like, strict=True)))


def _data(problem: RefinementProblem) -> Array:
    """Lay out what was seen (N, ...)."""
    optics, count = problem.optics, problem.image.shape[2]
    lens = np.zeros(5) if optics.distortion is None else optics.distortion
    camera = np.empty((12, count))
    camera[0], camera[1:4], camera[4:6] = float(optics.perspective), optics.focal, optics.centre
    camera[6], camera[7:] = float(optics.distortion is not None), lens[:, None]
    free = np.zeros((4, count)) if problem.free is None else problem.free
    parts = [camera, problem.root, _flat(problem.root_weight), free]
    parts.append(_flat(np.concatenate([problem.image, problem.weight[:, None]], axis=1)))
    if problem.head_image is not None and problem.head_weight is not None:
        parts.append(_flat(np.concatenate([problem.head_image, problem.head_weight[:, None]], axis=1)))
    return np.ascontiguousarray(np.concatenate(parts).T)


def _figure(problem: RefinementProblem) -> Array:
    """Lay out the figure and what is varied of it."""
    anatomy, seen = problem.anatomy, problem.head_image is not None
    count, own = _anatomy(anatomy)
    flags = [
        problem.shape_weight is not None,
        problem.limb_weight is not None,
        1.0 / problem.limit_deviation,
        problem.walls is not None,
        problem.legs_on_torso,
        problem.trunk_only,
        anatomy.middle_pelvis,
        (len(anatomy.head) + len(problem.own_head)) * seen,
        count,
    ]
    out = np.concatenate([np.array(flags, dtype=np.float64), own, np.ravel(problem.own_head)])
    if problem.shape_weight is not None:
        out[SHAPE_WEIGHTS : SHAPE_WEIGHTS + 9] = problem.shape_weight
    if problem.limb_weight is not None:
        out[LIMB_WEIGHTS : LIMB_WEIGHTS + 8] = np.ravel(problem.limb_weight)
    return out


@lru_cache(maxsize=16)
def _anatomy(anatomy: FigureNumbers) -> tuple[int, Array]:
    """Count branches, and lay out what follows the flags: branches, weights (zero as yet), lengths and limits."""
    branches = possible_branches(anatomy.limb_bounds)
    ways = np.zeros((len(LIMB_BRANCHES), 2))
    ways[: len(branches)] = branches
    parts = [
        ways,
        np.zeros(9),
        ((TRUNK_APART @ anatomy.shape) ** 2).sum(axis=1),
        np.zeros(8),
        anatomy.limbs,
        *_middles_and_halves(anatomy.limb_bounds),
        *_middles_and_halves(anatomy.pelvis_bounds),
        *_middles_and_halves(anatomy.neck_bounds),
        anatomy.head,
    ]
    return len(branches), np.concatenate([np.ravel(part) for part in parts])


def _middles_and_halves(bounds: Bounds) -> tuple[Array, Array]:
    return (bounds.lower + bounds.upper) / 2, (bounds.upper - bounds.lower) / 2
