"""Representatives: a few postures of a frame that stand for all likely postures within 5 cm of them."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array, Ints, norm

#: Largest distance of any joint, metres, at which an answer counts as right and one posture represents another.
WITHIN_METRES: Final = 0.05

#: Largest number of postures of a frame that are compared with each other, the likeliest first.
MAX_COMPARED: Final = 600

#: Probabilities that differ by less are equal.
ROUNDED_PROBABILITY: Final = 1e-9


def representatives(shape: Array, frame: Ints, weight: Array, hold: Array) -> tuple[Ints, Array]:
    """Choose a few postures of each frame such that the postures within 5 cm of them have a given total probability.

    Parameters
    ----------
    shape : array (N, 14, 3)
        Joint positions of postures, metres, sorted by frame and then by descending probability.
    frame : int array (N,)
        Frame of each posture, 0 to K - 1.
    weight : array (N,)
        Probability of each posture; within a frame the sum is one.
    hold : array (K,)
        Total probability that the representatives of each frame and the postures near them must reach.

    Returns
    -------
    rows : int array (R,)
        Indices of the representatives, sorted by frame and then by descending `held`.
    held : array (R,)
        Total probability of each representative and the postures within 5 cm of it. A posture near several
        representatives counts only for the first of them that was chosen.
    """
    one, other = _near(shape, frame)
    rows, rest, left = np.arange(len(frame)), weight.copy(), hold.copy()
    chosen: list[Ints] = []
    held: list[Array] = []
    while len(rows):
        gain = np.bincount(one, rest[other], len(frame))[rows]
        new = np.concatenate([[True], frame[rows[1:]] != frame[rows[:-1]]])
        starts = np.flatnonzero(new)
        most = np.maximum.reduceat(gain, starts)
        each = most[np.cumsum(new) - 1]
        equal = np.flatnonzero(gain > each - ROUNDED_PROBABILITY)
        best = rows[equal[np.searchsorted(equal, starts)]]  # the likeliest of equal gains
        chosen.append(best)
        held.append(most)
        left[frame[best]] -= most
        is_best = np.bincount(best, minlength=len(frame))
        rest[other[is_best[one] > 0]] = 0.0
        rows = rows[(left[frame[rows]] > ROUNDED_PROBABILITY) & (each > 0)]
    rows, share = np.concatenate(chosen), np.concatenate(held)
    order = np.lexsort((-share, frame[rows]))
    return rows[order], share[order]


def _near(shape: Array, frame: Ints) -> tuple[Ints, Ints]:
    """Return the pairs of postures of one frame that are within 5 cm of each other in every joint: two arrays (P,)."""
    rows, start = np.arange(len(frame)), np.searchsorted(frame, frame)
    before = np.where(rows - start < MAX_COMPARED, rows - start, 0)
    one = np.repeat(rows, before)
    other = np.arange(len(one)) + np.repeat(start + before - np.cumsum(before), before)
    for depth in reversed(shape[:, :, 2].T.copy()):  # wrists and ankles differ most
        near = np.flatnonzero(np.abs(depth[one] - depth[other]) <= WITHIN_METRES)
        one, other = one[near], other[near]
    within = np.asarray(norm(shape[one] - shape[other]) <= WITHIN_METRES).all(axis=1)
    one, other, own = one[within], other[within], rows[rows - start < MAX_COMPARED]
    return np.concatenate([one, other, own]), np.concatenate([other, one, own])
