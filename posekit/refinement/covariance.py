r"""The uncertainty of refined joints, to first order.

With the trunk's covariance C (the inverse of its matrix when limbs and head are eliminated), a limb whose own matrix
is H and whose coupling with its start is K moves by :math:`-H^{-1} K` per change of the start, and by
:math:`H^{-1}` besides. So a joint with ways T of the trunk and U of the limb has

.. math:: (T - U H^{-1} K)\, C\, (T - U H^{-1} K)^T + U H^{-1} U^T .

What nothing determines keeps the deviation of an angle that may be anything, :math:`\pi / \sqrt 3`, and of a place
in the room. Near a right angle to the ray, where a segment's depth does not show in the image to first order, the
image still shows it to second order: a length l seen too short by the noise :math:`\sigma` (metres) turns by
:math:`t = \sqrt{2 \sigma / l}`, and the estimate :math:`\sqrt{\max(y, 0)}` from :math:`y = t^2 + e` is off by
:math:`E[(\hat t - t)^2] = E[\max(e, 0)] = 0.4\,\sigma` at t = 0. Its inverse, :math:`1.25\, l / \sigma`, is added as
information on the turn.
"""

from __future__ import annotations

import numpy as np

from posekit.cameras import Array
from posekit.refinement.anatomy import END, MIDDLE
from posekit.refinement.elimination import reduce, start_shift
from posekit.refinement.equations import Equations, image_terms, linearise
from posekit.refinement.problem import Problem
from posekit.refinement.small import backward, cross, dot, forward, turned
from posekit.refinement.state import State, place

ROOM = 10.0
"""Metres: standard deviation of a place of which nothing is known."""

ANY = np.pi / np.sqrt(3.0)
"""Radians: standard deviation of an angle of which nothing is known."""

CAP = 1.25
"""See the module: information on a turn, times the noise over the length."""

BLOCK = 256


def covariances(problem: Problem, state: State) -> Array:
    """Return the covariance of every joint (N, 14, 3, 3), square metres."""
    n = state.root.shape[1]
    out = np.empty((n, 14, 3, 3))
    for at in range(0, n, BLOCK):
        rows = np.arange(at, min(at + BLOCK, n))
        part, here = problem.take(rows), state.take(rows)
        out[rows] = _covariances(part, here, linearise(part, here))
    return out


def _covariances(problem: Problem, state: State, here: Equations) -> Array:
    n = state.root.shape[1]
    limb = _with_priors(problem, state, here)
    reduced = reduce(here._replace(limb=limb, trunk=_trunk_prior(problem, here)), 0.0, 0.0)
    width = len(here.trunk)
    ways = np.zeros((6, 3, width, n))
    ways[:, :, :3] = np.eye(3)[:, :, None]
    x, y = here.offsets, here.offsets[4:] - here.offsets[3]
    for joint in range(1, 6):
        ways[joint, :, 3:6] = -_cross_matrix(x[min(joint, 3)])
        if joint > 3:
            ways[joint, :, 6:9] = -_cross_matrix(y[joint - 4])
    if width > 9:
        ways[:, :, 9:] = here.ways
    out = np.empty((14, 3, 3, n))
    # T C T' with C = (L L')^-1 is S'S with S = L^-1 T'.
    right = np.ascontiguousarray(ways.transpose(2, 0, 1, 3)).reshape(width, 18, n)
    root = forward(reduced.trunk, right).reshape(width, 6, 3, n)
    out[:6] = np.einsum("wpin,wpjn->pijn", root, root)
    # How limbs' starts and parts move with the trunk's whitened unknowns.
    whitened = backward(reduced.trunk, np.repeat(np.eye(width)[:, :, None], n, axis=2))
    shift = start_shift(here, whitened)
    reach = len(limb)
    coupling = reduced.limb_right[:, :6]
    follow = np.einsum("usln,swln->uwln", coupling, shift)
    follow = -backward(reduced.limb, follow)
    spread = backward(reduced.limb, np.repeat(np.repeat(np.eye(reach)[:, :, None, None], 4, axis=2), n, axis=3))
    for limb_index in range(4):
        moving = _limb_ways(state, here, limb_index, reach)
        for segment, joint in ((0, MIDDLE[limb_index]), (1, END[limb_index])):
            U = moving[segment]
            with_trunk = np.einsum("iun,uwn->iwn", U, follow[:, :, limb_index]) + shift[:3, :, limb_index]
            own = np.einsum("iun,uwn->iwn", U, spread[:, :, limb_index])
            out[joint] = np.einsum("iwn,jwn->ijn", with_trunk, with_trunk) + np.einsum("iwn,jwn->ijn", own, own)
    return out.transpose(3, 0, 1, 2)


def _trunk_prior(problem: Problem, here: Equations) -> Array:
    trunk = here.trunk.copy()
    for i in range(3):
        trunk[i, i] += ROOM**-2
    for i in range(3, 9):
        trunk[i, i] += ANY**-2
    return trunk


def _with_priors(problem: Problem, state: State, here: Equations) -> Array:
    """Add to the limbs' matrices what is known of turns that the image does not show to first order."""
    limb = here.limb.copy()
    joints = place(state).joints
    information = image_terms(problem, joints)[0]
    for segment, ends in enumerate((MIDDLE, END)):
        first = 2 * segment
        for i in (first, first + 1):
            limb[i, i] += ANY**-2
        length, direction = state.limbs[:, segment], state.directions[:, segment]
        noise = np.sqrt(np.maximum(dot(direction, turned(information[list(ends)], direction)), 0.0))
        ray = joints[list(ends)] if problem.optics.perspective else np.array([0.0, 0.0, 1.0])[:, None]
        weak = [dot(here.tangents[:, segment, k], ray) for k in range(2)]
        size = np.maximum(np.hypot(*weak), 1e-12)
        c, s = weak[0] / size, weak[1] / size
        known = CAP * length * noise
        limb[first, first] += known * c * c
        limb[first + 1, first + 1] += known * s * s
        limb[first, first + 1] += known * c * s
        limb[first + 1, first] += known * c * s
    return limb


def _limb_ways(state: State, here: Equations, limb: int, reach: int) -> tuple[Array, Array]:
    """Return how a limb's unknowns move its middle and its end: (3, U, N) each."""
    n = state.root.shape[1]
    middle, end = np.zeros((3, reach, n)), np.zeros((3, reach, n))
    for segment, columns in ((0, (0, 1)), (1, (2, 3))):
        for tangent, column in enumerate(columns):
            way = state.limbs[limb, segment] * here.tangents[limb, segment, tangent]
            end[:, column] = way
            if segment == 0:
                middle[:, column] = way
        if reach > 4:
            way = state.limbs[limb, segment] * state.directions[limb, segment]
            end[:, 4 + segment] = way
            if segment == 0:
                middle[:, 4] = way
    return middle, end


def _cross_matrix(x: Array) -> Array:
    """Return [x] (3, 3, N) with [x] v = x cross v."""
    return np.stack([cross(x, np.broadcast_to(np.eye(3)[:, k, None], x.shape)) for k in range(3)], axis=1)

