r"""How a posture moves as rigid pieces: torso, hips, head and eight segments, each turned about its own start.

A point is its parent's place plus a vector of its piece. Turning the pieces by :math:`\omega_k` and shifting the neck
by :math:`\tau` moves it by

.. math:: \tau + \sum \omega_{k(p)} \times b_p

over the points p on the way from the neck, with vectors b. Whatever turns, all lengths stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross_matrix, rotation_from_vector
from posekit.skeleton import HEAD, HIPS, JOINT, LIMB_JOINTS, PARENTS, POINTS, TORSO

TORSO_PIECE, HIPS_PIECE, HEAD_PIECE = 0, 1, 2

PIECE_PARENTS: Final = (*PARENTS, *(JOINT["neck"] for _ in HEAD))
"""The point from which the vector of each of `posekit.skeleton.POINTS` starts; -1 for the neck."""


def _piece_of_points() -> tuple[int, ...]:
    pieces = [TORSO_PIECE] * len(POINTS)
    for name in HIPS[1:]:
        pieces[JOINT[name]] = HIPS_PIECE
    for point in HEAD:
        pieces[point] = HEAD_PIECE
    for limb, (_, middle, end) in enumerate(LIMB_JOINTS):
        pieces[middle], pieces[end] = HEAD_PIECE + 1 + 2 * limb, HEAD_PIECE + 2 + 2 * limb
    return tuple(pieces)


PIECE_OF_POINT: Final = _piece_of_points()
"""The piece whose vector ends at each point; the neck's is not read."""

N_PIECES: Final = HEAD_PIECE + 1 + 2 * len(LIMB_JOINTS)
N_UNKNOWNS: Final = 3 + 3 * N_PIECES
"""A shift of the neck, then a rotation vector a piece."""

PLACING_ORDER: Final = tuple(range(1, len(POINTS)))
"""Points after the neck, parents first."""


def vectors_of(points: Array) -> Array:
    """Return the vector that ends at each point (N, 19, 3); of the neck its place."""
    vectors = points.copy()
    vectors[:, 1:] -= points[:, list(PIECE_PARENTS[1:])]
    return vectors


def jacobian_of(points: Array) -> Array:
    """Return the derivative of points (N, 19, 3) by the unknowns (N, 19, 3, 36); zero of unknown points."""
    jacobian = np.zeros((len(points), len(POINTS), 3, N_UNKNOWNS))
    jacobian[:, 0, :, :3] = np.eye(3)
    turned = -cross_matrix(np.nan_to_num(vectors_of(points)))
    for point in PLACING_ORDER:
        jacobian[:, point] = jacobian[:, PIECE_PARENTS[point]]
        jacobian[:, point, :, columns_of(PIECE_OF_POINT[point])] += turned[:, point]
    return jacobian


def moved(points: Array, step: Array) -> Array:
    """Turn the pieces of postures (N, 19, 3) by steps (N, 36), radians and metres."""
    turn = rotation_from_vector(step[:, 3:].reshape(-1, N_PIECES, 3))
    vectors = vectors_of(points)
    out = np.empty_like(points)
    out[:, 0] = points[:, 0] + step[:, :3]
    for point in PLACING_ORDER:
        vector = (turn[:, PIECE_OF_POINT[point]] @ vectors[:, point, :, None])[..., 0]
        out[:, point] = out[:, PIECE_PARENTS[point]] + vector
    return out


def columns_of(piece: int) -> slice:
    """Return where a piece's rotation vector stands among the unknowns."""
    return slice(3 + 3 * piece, 6 + 3 * piece)


@cache
def pieces_between(points: tuple[int, ...]) -> tuple[int, ...]:
    """Return the pieces whose turning moves some of these points against others of them."""
    between = []
    for piece in range(N_PIECES):
        through = {_end_in(piece, point) for point in points}
        if len(through) > 1:
            between.append(piece)
    return tuple(between)


def _end_in(piece: int, point: int) -> int:
    """Return the point at which the way from the neck to a point leaves a piece; -1 where it does not pass it."""
    while point > 0:
        if PIECE_OF_POINT[point] == piece:
            return point
        point = PIECE_PARENTS[point]
    return -1


def unknowns_between(points: Sequence[int]) -> NDArray[np.intp]:
    """Return which unknowns move some of these points against others of them."""
    return np.array(
        [3 + 3 * piece + axis for piece in pieces_between(tuple(points)) for axis in range(3)], dtype=np.intp
    )


TORSO_AND_HIPS: Final = tuple(JOINT[name] for name in (*TORSO, *HIPS[1:]))
"""The joints without which nothing of a posture can be placed."""
