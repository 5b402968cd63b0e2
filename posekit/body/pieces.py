r"""Motion of a measured body that consists of 11 rigid pieces: torso, hips, head and eight limb segments.

Each point is its parent point plus a vector b that the rotation of its piece turns: :math:`x_p = x_{parent(p)} +
R_{piece(p)} b_p`. Rotations change no length.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import (
    Array,
    best_rotation,
    rotation_between,
    rotation_from_vector,
    unit,
    vector_from_rotation,
)
from posekit.skeleton import HEAD, HIPS, JOINT, JOINTS, LIMB_JOINTS, N_TRUNK_JOINTS, NAMES, PARENTS, POINTS

TORSO_PIECE, HIPS_PIECE, HEAD_PIECE = 0, 1, 2
N_PIECES: Final = 3 + 2 * len(LIMB_JOINTS)
#: Upper and lower piece of each limb.
LIMB_PIECES: Final = [{3 + 2 * limb, 4 + 2 * limb} for limb in range(len(LIMB_JOINTS))]
FEET: Final = tuple(range(len(POINTS), len(NAMES)))
#: Joints that must be known to place any piece.
TRUNK: Final = list(range(N_TRUNK_JOINTS))
#: The point from which the vector of each of `NAMES` starts; -1 for the neck.
PIECE_PARENTS: Final = (
    *PARENTS,
    *(JOINT["neck"] for _ in HEAD),
    *(JOINT[f"{NAMES[foot].split('_')[0]}_ankle"] for foot in FEET),
)
#: Middle and end joint of the hinges, by the names of their angles.
HINGES: Final = {f"{JOINTS[middle]}.flexion": (middle, end) for _, middle, end in LIMB_JOINTS}


def _piece_of_points() -> list[int]:
    pieces = [TORSO_PIECE] * len(NAMES)
    for name in HIPS[1:]:
        pieces[JOINT[name]] = HIPS_PIECE
    for point in HEAD:
        pieces[point] = HEAD_PIECE
    for limb, (_, middle, end) in enumerate(LIMB_JOINTS):
        pieces[middle], pieces[end] = HEAD_PIECE + 1 + 2 * limb, HEAD_PIECE + 2 + 2 * limb
    for foot in FEET:
        pieces[foot] = pieces[PIECE_PARENTS[foot]]
    return pieces


#: The piece whose vector ends at each point; the neck's entry is not used.
PIECE_OF_POINT: Final = _piece_of_points()


def vectors_of(points: Array) -> Array:
    """Return the vector to each point from its parent point (N, P, 3); the neck's vector is its position."""
    vectors = points.copy()
    vectors[:, 1:] -= points[:, list(PIECE_PARENTS[1:])]
    return vectors


def placed(vectors: Array) -> Array:
    """Return the points (N, P, 3) of vectors from parent points: the inverse of `vectors_of`."""
    points = vectors.copy()
    for point in range(1, len(NAMES)):  # parents come before their points
        points[:, point] += points[:, PIECE_PARENTS[point]]
    return points


def turns_between(start: Array, end: Array) -> Array:
    """Return the rotations (N, 11, 3, 3) of the pieces that best map postures `start` (N, P, 3) to postures `end`.

    A piece with one known vector gets the shortest rotation from the vector's direction in `start` to its direction in
    `end`. A piece with no known vector gets the identity matrix.
    """
    R = np.tile(np.eye(3), (len(start), N_PIECES, 1, 1))
    before, after = vectors_of(start), vectors_of(end)
    known = np.asarray(np.isfinite(before + after).all(axis=(0, 2)))
    for piece in range(N_PIECES):
        mine = [k for k in range(1, FEET[0]) if PIECE_OF_POINT[k] == piece and known[k]]
        if len(mine) == 1:
            R[:, piece] = rotation_between(unit(before[:, mine[0]]), unit(after[:, mine[0]]))
        elif mine:
            R[:, piece] = best_rotation(np.einsum("nki,nkj->nij", after[:, mine], before[:, mine]))[0]
    return R


def turned(points: Array, turn: Array) -> Array:
    """Rotate the pieces of postures (N, P, 3) by rotation vectors (N, 33), radians; the neck does not move."""
    R = rotation_from_vector(turn.reshape(-1, N_PIECES, 3))
    vectors = vectors_of(points)
    vectors[:, 1:] = np.einsum("npij,npj->npi", R[:, PIECE_OF_POINT[1:]], vectors[:, 1:])
    return placed(vectors)


def moved(points: Array, step: Array) -> Array:
    """Move the joints of postures (N, P, 3) by steps (N, 42), metres; head and feet move with neck and ankles."""
    step = step.reshape(len(points), len(JOINTS), 3)
    every = np.concatenate([step, step[:, PIECE_PARENTS[len(JOINTS) :]]], axis=1)
    return np.asarray(points + every)


def carried(start: Array, end: Array, share: Array) -> Array:
    """Interpolate postures (N, P, 3): apply a fraction (N,) of each piece's rotation and of the neck's translation."""
    turn = vector_from_rotation(turns_between(start, end)).reshape(len(start), 3 * N_PIECES)
    shift = end[:, :1] - start[:, :1]
    return turned(start, share[:, None] * turn) + share[:, None, None] * shift
