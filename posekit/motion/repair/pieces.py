r"""How a measured body moves as rigid pieces: torso, hips, head and eight segments, each turned about its own start.

A point is its parent's place plus a vector of its piece. Turning the pieces by :math:`\omega_k` and shifting the neck
by :math:`\tau` moves it by :math:`\tau + \sum \omega_{k(p)} \times b_p` over the points p on the way from the neck,
with vectors b. All lengths stay.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import (
    Array,
    Ints,
    best_rotation,
    cross_matrix,
    rotation_between,
    rotation_from_vector,
    unit,
    vector_from_rotation,
)
from posekit.motion.motion import NAMES
from posekit.skeleton import HEAD, HIPS, JOINT, LIMB_JOINTS, PARENTS, POINTS, TORSO

Bools = NDArray[np.bool_]

TORSO_PIECE, HIPS_PIECE, HEAD_PIECE = 0, 1, 2
N_PIECES: Final = 3 + 2 * len(LIMB_JOINTS)
#: A shift of the neck, then a rotation vector a piece.
N_UNKNOWNS: Final = 3 + 3 * N_PIECES

FEET: Final = tuple(range(len(POINTS), len(NAMES)))
#: The point from which the vector of each of `NAMES` starts; -1 for the neck.
PIECE_PARENTS: Final = (
    *PARENTS,
    *(JOINT["neck"] for _ in HEAD),
    *(JOINT[f"{NAMES[foot].split('_')[0]}_ankle"] for foot in FEET),
)

#: Frames at an end of a clip, such as a T-pose in the first, up to which the motion beside them is continued.
MOST_CONTINUED: Final = 3
#: Joints without which nothing of a posture can be placed.
TRUNK: Final = tuple(JOINT[name] for name in (*TORSO, *HIPS[1:]))


def _piece_of_points() -> tuple[int, ...]:
    pieces = [TORSO_PIECE] * len(NAMES)
    for name in HIPS[1:]:
        pieces[JOINT[name]] = HIPS_PIECE
    for point in HEAD:
        pieces[point] = HEAD_PIECE
    for limb, (_, middle, end) in enumerate(LIMB_JOINTS):
        pieces[middle], pieces[end] = HEAD_PIECE + 1 + 2 * limb, HEAD_PIECE + 2 + 2 * limb
    for foot in FEET:
        pieces[foot] = pieces[PIECE_PARENTS[foot]]
    return tuple(pieces)


#: The piece whose vector ends at each point; that of the neck is not read.
PIECE_OF_POINT: Final = _piece_of_points()


def columns_of(piece: int) -> slice:
    """Return the place of a piece's rotation vector among the unknowns."""
    return slice(3 + 3 * piece, 6 + 3 * piece)


def _vectors(points: Array) -> Array:
    """Return the vector that ends at each point (N, P, 3); of the neck its place."""
    vectors = points.copy()
    vectors[:, 1:] -= points[:, list(PIECE_PARENTS[1:])]
    return vectors


def jacobian_of(points: Array) -> Array:
    """Return the derivative of points (N, P, 3) by the unknowns (N, P, 3, 36); zero for unknown points."""
    jacobian = np.zeros((*points.shape, N_UNKNOWNS))
    jacobian[:, 0, :, :3] = np.eye(3)
    turned = -cross_matrix(np.nan_to_num(_vectors(points)))
    for point in range(1, len(NAMES)):
        jacobian[:, point] = jacobian[:, PIECE_PARENTS[point]]
        jacobian[:, point, :, columns_of(PIECE_OF_POINT[point])] += turned[:, point]
    return jacobian


def moved(points: Array, step: Array) -> Array:
    """Turn the pieces of postures (N, P, 3) by steps (N, 36), radians, and shift them, metres."""
    turn = rotation_from_vector(step[:, 3:].reshape(-1, N_PIECES, 3))
    vectors = _vectors(points)
    out = np.empty_like(points)
    out[:, 0] = points[:, 0] + step[:, :3]
    for point in range(1, len(NAMES)):
        vector = (turn[:, PIECE_OF_POINT[point]] @ vectors[:, point, :, None])[..., 0]
        out[:, point] = out[:, PIECE_PARENTS[point]] + vector
    return out


def turns_between(start: Array, end: Array) -> Array:
    """Return the rotations (N, 11, 3, 3) of the pieces that bring postures (N, P, 3) nearest to others.

    A piece of one vector turns by the shortest rotation; one of which nothing is known does not turn.
    """
    R = np.tile(np.eye(3), (len(start), N_PIECES, 1, 1))
    before, after = _vectors(start), _vectors(end)
    for piece in range(N_PIECES):
        mine = [k for k in range(1, len(NAMES)) if PIECE_OF_POINT[k] == piece and k not in FEET]
        known = np.asarray(np.isfinite(before[:, mine] + after[:, mine]).all(axis=(0, 2)))
        mine = [k for k, use in zip(mine, known, strict=True) if use]
        if len(mine) == 1:
            R[:, piece] = rotation_between(unit(before[:, mine[0]]), unit(after[:, mine[0]]))
        elif mine:
            R[:, piece] = best_rotation(np.einsum("nki,nkj->nij", after[:, mine], before[:, mine]))[0]
    same = np.all(np.nan_to_num(after[:, 1:] - before[:, 1:]) == 0, axis=2)
    for piece in range(N_PIECES):
        mine = [k - 1 for k in range(1, len(NAMES)) if PIECE_OF_POINT[k] == piece]
        R[same[:, mine].all(axis=1), piece] = np.eye(3)
    return R


def between(bad: Bools) -> tuple[Ints, Ints, Ints, Array]:
    """Return bad frames, the good ones before and after each, and the share of the way (n, 1) between them.

    At an end of the clip a few frames go on as the two nearest good ones do, with shares below 0 or above 1; more of
    them stay as they are.
    """
    good, rows = np.flatnonzero(~bad), np.flatnonzero(bad)
    if len(good) < 2:
        return rows[:0], rows[:0], rows[:0], np.empty((0, 1))
    rows = rows[(rows > good[0]) | (good[0] <= MOST_CONTINUED)]
    rows = rows[(rows < good[-1]) | (len(bad) - 1 - good[-1] <= MOST_CONTINUED)]
    place = np.clip(np.searchsorted(good, rows), 1, len(good) - 1)
    before, after = good[place - 1], good[place]
    return rows, before, after, ((rows - before) / (after - before))[:, None]


def interpolated(points: Array, bad: Bools) -> Array:
    """Put postures (T, P, 3) between the good frames around them.

    Each piece of the body turns evenly, and the neck moves evenly, from the one good frame to the other.
    """
    out = points.copy()
    known = np.isfinite(points[:, list(TRUNK)]).all(axis=(1, 2))
    rows, before, after, share = between(bad | ~known)
    ways = []
    for start, end, part in ((before, after, share), (after, before, 1 - share)):
        turn = vector_from_rotation(turns_between(points[start], points[end])).reshape(
            len(rows), 3 * N_PIECES
        )
        ways.append(moved(points[start], part * np.hstack([points[end, 0] - points[start, 0], turn])))
    out[rows] = (1 - share[..., None]) * ways[0] + share[..., None] * ways[1]
    out[~bad] = points[~bad]
    return out
