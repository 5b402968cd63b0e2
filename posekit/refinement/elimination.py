r"""Solving the normal equations by their arrow structure, and what they say of the joints' uncertainty.

Each limb is eliminated by itself, a matrix of four (or six) unknowns; what remains of it is a quadratic function of
its start's place (and, where its limits are felt, of its part's rotation). The trunk's nine (or eighteen) unknowns
are solved last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from posekit.cameras import Array
from posekit.refinement.anatomy import ARMS, LEGS, START
from posekit.refinement.equations import Equations
from posekit.refinement.small import backward, cholesky, cross, dot, forward
from posekit.refinement.state import Step

FLOOR = 1e-6
"""Added to diagonals, one over rad^2 or m^2: what nothing determines does not move."""


class Reduced(NamedTuple):
    """The equations after limbs and head are eliminated, factored.

    Attributes
    ----------
    trunk : array (C, C, N)
        Cholesky factor, its lower triangle.
    trunk_right : array (C, 1, N)
        Its inverse times the gradient.
    limb, head : array (U, U, 4, N), (3, 3, N)
        Cholesky factors.
    limb_right, head_right : array (U, 7, 4, N), (3, 7, N)
        Their inverses times coupling and gradient.
    damped : tuple of array
        The damping of limbs (U, 4, N), head (3, N) and trunk (C, N).
    """

    trunk: Array
    trunk_right: Array
    limb: Array
    limb_right: Array
    head: Array
    head_right: Array
    damped: tuple[Array, Array, Array]


def reduce(here: Equations, damping: Array | float, floor: float = FLOOR) -> Reduced:
    """Eliminate limbs and head, and factor the trunk's matrix; damped by a fraction (N,) of the diagonals."""
    limb = here.limb.copy()
    limb_damping = _damp(limb, damping, floor)
    limb_right = np.concatenate([here.limb_start, here.limb_gradient[:, None]], axis=1)
    forward(cholesky(limb), limb_right)
    start, push = here.start.copy(), here.start_gradient.copy()
    for row in limb_right:
        for i in range(6):
            start[i] -= row[i] * row[:6]
        push -= row[:6] * row[6]
    P, g = here.points.copy(), here.point_gradient.copy()
    starts = list(START)
    P[starts] += start[:3, :3].transpose(2, 0, 1, 3)
    g[starts] += push[:3].transpose(1, 0, 2)
    trunk, gradient = here.trunk.copy(), here.trunk_gradient.copy()
    _spread(here.offsets, P, g, trunk, gradient)
    if here.ways.shape[2]:
        moving = np.einsum("pijn,pjsn->pisn", P, here.ways)
        _couple(here.ways, moving, g, here.offsets, trunk, gradient)
    if here.felt.any():
        _turn(here, start, push, trunk, gradient)
    head, head_right = here.head.copy(), here.head
    head_damping = here.head_gradient
    if len(head):
        head_damping = _damp(head, damping, floor)
        head_right = np.concatenate([here.head_start, here.head_gradient[:, None]], axis=1)
        forward(cholesky(head), head_right)
        coupling, own = head_right[:, :6], head_right[:, 6]
        trunk[:6, :6] += here.head_root - np.einsum("kin,kjn->ijn", coupling, coupling)
        gradient[:6] += here.head_root_gradient - np.einsum("kin,kn->in", coupling, own)
    trunk_damping = _damp(trunk, damping, floor)
    trunk_right = forward(cholesky(trunk), gradient[:, None])
    return Reduced(
        trunk, trunk_right, limb, limb_right, head, head_right, (limb_damping, head_damping, trunk_damping)
    )


def _damp(matrix: Array, damping: Array | float, floor: float) -> Array:
    """Add damping and floor to the diagonal, in place; return what was added."""
    index = np.arange(len(matrix))
    added = matrix[index, index] * damping + floor
    matrix[index, index] += added
    return np.asarray(added)


def step(here: Equations, reduced: Reduced) -> tuple[Step, Array]:
    """Solve for the step, and the decrease of chi2 that it promises (N,)."""
    trunk = -backward(reduced.trunk, reduced.trunk_right.copy())[:, 0]
    shift = start_shift(here, trunk[:, None])[:, 0]
    right = reduced.limb_right[:, 6].copy()
    for j in range(6):
        right += reduced.limb_right[:, j] * shift[j]
    limbs = -backward(reduced.limb, right)
    head = -backward(
        reduced.head, reduced.head_right[:, 6] + np.einsum("kin,in->kn", reduced.head_right[:, :6], trunk[:6])
    ) if len(reduced.head) else here.head_gradient
    gain = (reduced.trunk_right[:, 0] ** 2).sum(axis=0) + (reduced.limb_right[:, 6] ** 2).sum(axis=(0, 1))
    limb_damping, head_damping, trunk_damping = reduced.damped
    gain += (trunk_damping * trunk * trunk).sum(axis=0) + (limb_damping * limbs * limbs).sum(axis=(0, 1))
    if len(head):
        gain += (reduced.head_right[:, 6] ** 2).sum(axis=0) + (head_damping * head * head).sum(axis=0)
    return Step(trunk, limbs.transpose(1, 0, 2), head), gain


def start_shift(here: Equations, trunk: Array) -> Array:
    """Return how limbs' starts move, and their parts turn, (6, K, 4, N) with K changes of the trunk (C, K, N)."""
    x, y = here.offsets, here.offsets[4:] - here.offsets[3]
    out = np.empty((6, trunk.shape[1], 4, trunk.shape[2]))
    root, torso, hips = (trunk[k : k + 3].transpose(1, 0, 2) for k in (0, 3, 6))
    for limb, start in enumerate(START):
        if limb < LEGS.start:
            moved = root + cross(torso, x[start][None])
            turned_by = torso
        else:
            moved = root + cross(torso, x[3][None]) + cross(hips, y[start - 4][None])
            turned_by = hips
        if here.ways.shape[2]:
            moved = moved + np.einsum("isn,skn->kin", here.ways[start], trunk[9:])
        out[:3, :, limb], out[3:, :, limb] = moved.transpose(1, 0, 2), turned_by.transpose(1, 0, 2)
    return out


def _spread(offsets: Array, P: Array, g: Array, trunk: Array, gradient: Array) -> None:
    r"""Add matrices (6, 3, 3, N) and gradients (6, 3, N) at the trunk's joints to those of root, torso and hips.

    A joint at x from the root moves by :math:`\omega \times x`, a hip by :math:`\omega_T \times x_{pelvis}
    + \omega_H \times y`.
    """
    y = offsets[4:] - offsets[3]
    P_hips, g_hips = P[4:], g[4:]
    x = offsets[1:4]
    P_torso, g_torso = P[1:4].copy(), g[1:4].copy()
    P_torso[2] += P_hips[0] + P_hips[1]
    g_torso[2] += g_hips[0] + g_hips[1]
    trunk[:3, :3] += P[0] + P_torso.sum(axis=0)
    gradient[:3] += g[0] + g_torso.sum(axis=0)
    gradient[3:6] += cross(x, g_torso).sum(axis=0)
    gradient[6:9] += cross(y, g_hips).sum(axis=0)
    W = cross(x[:, None], P_torso)  # rows of P, crossed: P (w x x) = W w
    V = cross(y[:, None], P_hips)
    root_torso, root_hips = W.sum(axis=0), V.sum(axis=0)
    torso = _columns_crossed(x, W).sum(axis=0)
    hips = _columns_crossed(y, V).sum(axis=0)
    torso_hips = _columns_crossed(x[2:], root_hips[None])[0]
    # Turning outward-pushed points: see the module.
    for block, arm, push in ((torso, x, g_torso), (hips, y, g_hips)):
        out = np.maximum(-dot(arm, push), 0.0)
        square = dot(arm, arm)
        share = out / np.where(square > 0, square, 1.0)
        block -= (share[:, None, None] * arm[:, :, None] * arm[:, None]).sum(axis=0)
        total = out.sum(axis=0)
        for i in range(3):
            block[i, i] += total
    trunk[3:6, 3:6] += torso
    trunk[6:9, 6:9] += hips
    for first, second, block in ((0, 3, root_torso), (0, 6, root_hips), (3, 6, torso_hips)):
        trunk[first : first + 3, second : second + 3] += block
        trunk[second : second + 3, first : first + 3] += block.transpose(1, 0, 2)


def _columns_crossed(x: Array, W: Array) -> Array:
    """Cross vectors (P, 3, N) with the columns of matrices (P, 3, 3, N)."""
    return cross(x[:, None], W.transpose(0, 2, 1, 3)).transpose(0, 2, 1, 3)


def _couple(ways: Array, moving: Array, pull: Array, offsets: Array, trunk: Array, gradient: Array) -> None:
    """Add the rows and columns of the shape, from `moving` (6, 3, 9, N): the joints' matrices times its ways."""
    y = offsets[4:] - offsets[3]
    torso = moving[1:4].copy()
    torso[2] += moving[4:].sum(axis=0)
    root = moving[0] + torso.sum(axis=0)
    turn = _columns_crossed(offsets[1:4], torso).sum(axis=0)
    turn_hips = _columns_crossed(y, moving[4:]).sum(axis=0)
    for first, block in ((0, root), (3, turn), (6, turn_hips)):
        trunk[first : first + 3, 9:] += block
        trunk[9:, first : first + 3] += block.transpose(1, 0, 2)
    trunk[9:, 9:] += np.einsum("pisn,pitn->stn", ways, moving)
    gradient[9:] += np.einsum("pisn,pin->sn", ways, pull)


def _turn(here: Equations, start: Array, push: Array, trunk: Array, gradient: Array) -> None:
    """Add how the limits of limbs depend on the rotation of the part on which they hang."""
    x, y = here.offsets, here.offsets[4:] - here.offsets[3]
    for part, own in ((ARMS, 3), (LEGS, 6)):
        trunk[own : own + 3, own : own + 3] += start[3:, 3:, part].sum(axis=2)
        gradient[own : own + 3] += push[3:, part].sum(axis=1)
    for limb, place in enumerate(START):
        own = 3 if limb < LEGS.start else 6
        S = start[:3, 3:, limb]  # how the start's place couples with the part's rotation
        arms = [(0, S), (3, _columns_crossed((x[place] if own == 3 else x[3])[None], S[None])[0])]
        if own == 6:
            arms.append((6, _columns_crossed(y[place - 4][None], S[None])[0]))
        if here.ways.shape[2]:
            arms.append((9, np.einsum("isn,ijn->sjn", here.ways[place], S)))
        for first, block in arms:
            trunk[first : first + len(block), own : own + 3] += block
            trunk[own : own + 3, first : first + len(block)] += block.transpose(1, 0, 2)
