r"""Left and right exchanged in single pictures: an exchange makes the person jump.

Exchanging left and right leaves the sum of both sides, and turns round their difference d. Along a sequence d goes
smoothly: of all signs :math:`s_t` those are sought that make the second differences least,

.. math:: \min_s \sum_t | s_t d_t - 2 s_{t-1} d_{t-1} + s_{t-2} d_{t-2} |^2

by dynamic programming over :math:`r_t = s_t s_{t-1}` (Viterbi 1967). Second differences, for legs that pass each other
seen from the side go through d = 0 with full speed: first differences would call each such step an exchange.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.keypoints.side_body import ARM_JOINTS, LEG_JOINTS, pair, size
from posekit.geometry import Array, runs

MIN_PICTURES_OF_JUMPS: Final = 5
"""Pictures of a sequence: with fewer, a jump is no jump."""
EXCHANGE_GAIN: Final = 4.0
"""How much less the second differences must be after an exchange back, for it to be suspected."""
JUMP_LEG_LENGTHS: Final = 0.25
"""How large the jump must be, in leg lengths: smaller ones are the detector's noise, and do little harm."""
APART_LEG_LENGTHS: Final = 0.5
"""Where second differences are larger in the median, leg lengths, the pictures are too far apart, or of no sequence."""
LIMB_GROUPS: Final = {"arms": ARM_JOINTS, "legs": LEG_JOINTS}


def flips(landmarks: Array, frame: NDArray[np.intp], parts: tuple[str, ...]) -> Array:
    """Find the pictures in which some parts of one person have left and right exchanged against the others.

    Parameters
    ----------
    landmarks : array (F, 21, 2)
        One person's, in the order of the pictures.
    frame : int array (F,)
        The pictures' numbers.
    parts : tuple of str
        As ``("hip", "knee", "ankle")``.

    Returns
    -------
    array (F,)
        How many times smaller the second differences are after an exchange back; 0 where nothing is suspected.
    """
    found = np.zeros(len(frame))
    d = np.stack([pair(landmarks, part) for part in parts], axis=1) / size(landmarks)[:, None, None]
    known = ~np.isnan(d).any(axis=(1, 2))
    rows: NDArray[np.intp] = np.flatnonzero(known)
    breaks = np.flatnonzero(np.diff(frame[rows]) > _step(frame[rows])) + 1
    for stretch in np.split(rows, breaks):
        if len(stretch) >= MIN_PICTURES_OF_JUMPS:
            found[stretch] = _stretch(d[stretch].reshape(len(stretch), -1))
    return found


def _step(frame: NDArray[np.intp]) -> int:
    """Return the step between pictures: the median, for files that hold every tenth frame; twice is a gap."""
    return int(np.median(np.diff(frame))) if len(frame) > 1 else 1


def _stretch(d: Array) -> Array:
    """Judge a stretch without gaps (F, n), in leg lengths."""
    signs = _signs(d)
    if (signs < 0).sum() * 2 > len(signs):
        signs = -signs
    found = np.zeros(len(d))
    if float(np.median(_bends(d * signs[:, None]))) > APART_LEG_LENGTHS**2:
        return found
    for start, end in runs(np.asarray(signs < 0)):
        kept = signs.copy()
        kept[start:end] = 1
        near = slice(max(start - 2, 0), min(end + 2, len(d)))
        before, after = (_bends(d[near] * s[near, None]) for s in (kept, signs))
        worst, rest = before.max(initial=0.0), after.max(initial=0.0)
        if worst > JUMP_LEG_LENGTHS**2 and worst > EXCHANGE_GAIN * rest:
            found[start:end] = min(worst / max(rest, 1e-6), 1e3)
    return found


def _bends(d: Array) -> Array:
    """Return the squares of the second differences."""
    return np.asarray((np.diff(d, n=2, axis=0) ** 2).sum(axis=1))


def _signs(d: Array) -> Array:
    """Return the signs (F,) that make the sum of squared second differences least."""
    a = np.concatenate([[0.0], (d[1:] * d[:-1]).sum(axis=1)])
    b = np.concatenate([[0.0, 0.0], (d[2:] * d[:-2]).sum(axis=1)])
    ratio = np.array([1.0, -1.0])
    cost = np.zeros(2)
    came = np.zeros((len(d), 2), dtype=np.intp)
    for t in range(2, len(d)):
        # Of |s_t d_t - 2 s_(t-1) d_(t-1) + s_(t-2) d_(t-2)|^2, what the signs change.
        way = cost[:, None] + (-4 * a[t] * ratio[None] + 2 * b[t] * np.outer(ratio, ratio))
        way -= 4 * a[t - 1] * ratio[:, None]
        came[t] = way.argmin(axis=0)
        cost = way.min(axis=0)
    state = int(cost.argmin())
    steps = np.ones(len(d))
    for t in range(len(d) - 1, 0, -1):
        steps[t] = ratio[state]
        state = int(came[t, state])
    return np.asarray(np.cumprod(steps))
