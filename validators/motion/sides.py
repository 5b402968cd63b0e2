"""Detection of exchanged right and left joints, by continuity, segment lengths and the direction that a body faces.

In every frame each of six pairs of joints (shoulders, elbows, wrists, hips, knees, ankles) is either labelled correctly
or exchanged: 64 states. The energy of a state increases with errors of segment lengths, and with evidence that the body
faces the opposite direction. It also increases with the distances of right and left joints from their positions in the
previous frame. Dynamic programming finds the sequence of states with the lowest energy (Viterbi 1967, IEEE Trans. Inf.
Theory 13). The state changes only at frames in which the motion of at least one pair suggests an exchange, or after a
gap.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross, dot, known_median, norm, unit
from posekit.skeleton import JOINT, N_TRUNK_JOINTS, both

#: Names of the pairs of a right and a left joint.
SIDE_PAIRS: Final = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")

RIGHT_JOINTS: Final = tuple(JOINT[f"right_{name}"] for name in SIDE_PAIRS)
LEFT_JOINTS: Final = tuple(JOINT[f"left_{name}"] for name in SIDE_PAIRS)

#: Whether each pair is exchanged in each state (64, 6).
_PAIR_STATES: Final = (np.arange(64)[:, None] >> np.arange(6)) & 1

#: Pairs with a limb segment between them.
_LIMB_LINKS: Final = ((0, 1), (1, 2), (3, 4), (4, 5))

#: Sign of each of seven kinds of evidence in each state (7, 64): five about two pairs that belong together, one about
#: the hips, one about the shoulders.
_AS_LABELLED: Final = np.array(
    [
        *(1 - 2 * (_PAIR_STATES[:, a] != _PAIR_STATES[:, b]) for a, b in (*_LIMB_LINKS, (0, 3))),
        *(1 - 2 * _PAIR_STATES[:, k] for k in (3, 0)),
    ]
)

#: Difference between two lengths that counts as full evidence, as a share of the length.
LENGTH_SHARE: Final = 0.1

#: Minimum median deviation of a limb's length that shows that its two joints often belong to different limbs, metres.
TORN_METRES: Final = 0.02

#: Distance of a knee or a toe in front of the leg that counts as full evidence of the hips' direction, metres.
BEND_METRES: Final = 0.03

#: Distance that counts as full evidence in measured data, in standard deviations of noise.
NOISE_FACTOR: Final = 5.0

#: Minimum distance between a right and a left joint for full evidence of an exchange in the next frame, metres.
APART_METRES: Final = 0.1

#: Energy of a change of state, as a multiple of the full evidence of one frame.
TURNING_COST: Final = 1.0

#: Weight of the continuity between two frames, as a multiple of the full evidence of one frame.
CONTINUITY_WEIGHT: Final = 6.0

#: Energy of an exchanged pair, as a multiple of the full evidence of one frame; most labels are correct.
EXCHANGED_COST: Final = 0.03


def exchanged_pairs(
    joints: Array, feet: Array, head: Array, follows: NDArray[np.bool_], noise: float
) -> NDArray[np.bool_]:
    """Return for each frame and each pair in `SIDE_PAIRS` whether right and left joint are exchanged (T, 6).

    Parameters
    ----------
    joints : array (T, 14, 3)
        Joint positions, metres, in the order of time; NaN where unknown.
    feet : array (T, 4, 3)
        Positions of right and left toe, right and left heel, metres.
    head : array (T, 5, 3)
        Positions of nose, eyes and ears, metres.
    follows : bool array (T - 1,)
        Whether each frame except the first is one time step after the previous frame.
    noise : float
        Standard deviation of measured coordinates, metres.
    """
    count = len(joints)
    if not count:
        return np.zeros((0, 6), dtype=np.bool_)
    across = joints[:, RIGHT_JOINTS] - joints[:, LEFT_JOINTS]
    evidence = _evidence(joints, across, feet, head, NOISE_FACTOR * noise)
    continuity = _continuity(joints, across)
    known = np.isfinite(across[..., 0])
    gap = ~((known[1:] & known[:-1]).any(axis=1) & follows)
    continuity[gap] = 0.0
    firsts = np.flatnonzero(np.concatenate([[True], (continuity > 0).any(axis=1) | gap]))
    lengths = np.diff(np.append(firsts, count))
    energy = EXCHANGED_COST * lengths[:, None] * _PAIR_STATES.sum(axis=1)
    energy = energy - np.add.reduceat(evidence, firsts, axis=0) @ _AS_LABELLED
    chosen = _least(energy, continuity[firsts[1:] - 1])
    return np.asarray(np.repeat(_PAIR_STATES[chosen].astype(np.bool_), lengths, axis=0))


def put_right(points: Array, swapped: NDArray[np.bool_]) -> Array:
    """Return joints (T, 14, 3) with right and left joint exchanged in the pairs given by `swapped` (T, 6)."""
    if not swapped.any():
        return points
    mended, turned = points.copy(), swapped[..., None]
    mended[:, RIGHT_JOINTS] = np.where(turned, points[:, LEFT_JOINTS], points[:, RIGHT_JOINTS])
    mended[:, LEFT_JOINTS] = np.where(turned, points[:, RIGHT_JOINTS], points[:, LEFT_JOINTS])
    return mended


def _evidence(joints: Array, across: Array, feet: Array, head: Array, unsure: float) -> Array:
    """Return seven kinds of evidence for correct labels (T, 7), from -2 to 2, in the order of `_AS_LABELLED`."""
    together = np.zeros((len(joints), 5))
    for k, (first, second) in enumerate(_LIMB_LINKS):
        straight, crossed = (
            np.stack([norm(joints[:, a[first]] - joints[:, b[second]]) for a, b in sides], axis=1)
            for sides in (
                ((RIGHT_JOINTS, RIGHT_JOINTS), (LEFT_JOINTS, LEFT_JOINTS)),
                ((RIGHT_JOINTS, LEFT_JOINTS), (LEFT_JOINTS, RIGHT_JOINTS)),
            )
        )
        length = _length(straight, crossed, TORN_METRES + unsure / 2.0)
        off, off_crossed = (np.abs(one - length).sum(axis=1) for one in (straight, crossed))
        together[:, k] = _sure((off_crossed - off) / np.fmax(LENGTH_SHARE * length, unsure + 1e-9))
    trunk = joints[:, JOINT["neck"]] - joints[:, JOINT["pelvis"]]
    across_shoulders, across_hips = across[:, 0], across[:, 3]
    sizes = np.maximum(norm(across_shoulders) * norm(across_hips), 1e-9)
    together[:, 4] = _sure(dot(across_shoulders, across_hips) / sizes * 2.0)
    forward = unit(cross(trunk, across_hips))
    # A knee is in front of the line from hip to ankle, even if the thigh is raised above the horizontal.
    legs = (joints[:, both("hip")] + joints[:, both("ankle")]) / 2.0
    bends = dot(joints[:, both("knee")] - legs, forward[:, None])
    toes = dot(feet[:, :2] - joints[:, both("ankle")], forward[:, None])
    hips = _sure(bends.sum(axis=1) / (2 * max(BEND_METRES, unsure)))
    hips = hips + _sure(np.where(np.isnan(toes), 0.0, toes).sum(axis=1) / (2 * max(BEND_METRES, unsure)))
    facing = unit(cross(trunk, across_shoulders))
    nose = dot(head[:, 0] - (head[:, 3] + head[:, 4]) / 2.0, facing)
    return np.column_stack([together, hips, _sure(nose / max(BEND_METRES, unsure))])


def _length(straight: Array, crossed: Array, torn: float) -> float:
    """Return a segment's length: the median of its labelled lengths or, if they scatter, the mode of all lengths.

    Labelled lengths are distances between joints with the same side label, crossed lengths are distances between joints
    with opposite labels. Half of all these lengths are correct, whatever share of a clip is exchanged. The mode is the
    middle of the shortest interval that contains two fifths of all lengths (Robertson & Cryer 1974, J. Am. Stat. Assoc.
    69, 1012-1016).
    """
    middle = known_median(straight)
    if not known_median(np.abs(straight - middle)) > torn:
        return middle
    every = np.sort(np.concatenate([straight, crossed], axis=None))
    every = every[np.isfinite(every)]
    within = max(2 * len(every) // 5, 1)
    start = int((every[within:] - every[: len(every) - within]).argmin())
    return float(every[start + within // 2])


def _sure(evidence: Array) -> Array:
    """Clip evidence to -1 to 1; unknown evidence becomes 0."""
    return np.asarray(np.nan_to_num(np.clip(evidence, -1.0, 1.0)))


def _continuity(joints: Array, across: Array) -> Array:
    """Return the evidence, -1 to 1, that each pair was exchanged since the previous frame (T - 1, 6).

    The evidence compares displacements of the pair relative to the trunk, with and without an exchange of labels. It is
    positive if the exchange makes the displacements smaller.
    """
    moved = np.diff(joints[:, :N_TRUNK_JOINTS], axis=0)
    known = np.isfinite(moved[..., 0])
    number = np.maximum(known.sum(axis=1), 1)[:, None, None]
    trunk = np.where(known[..., None], moved, 0.0).sum(axis=1, keepdims=True) / number
    right, left = joints[1:, RIGHT_JOINTS] - trunk, joints[1:, LEFT_JOINTS] - trunk
    right_before, left_before = joints[:-1, RIGHT_JOINTS], joints[:-1, LEFT_JOINTS]
    straight = norm(right - right_before) + norm(left - left_before)
    crossed = norm(right - left_before) + norm(left - right_before)
    apart = norm(across)
    sizes = 2.0 * np.fmax(np.fmax(apart[1:], apart[:-1]), APART_METRES)
    return np.asarray(np.nan_to_num((straight - crossed) / sizes))


def _least(energy: Array, turned: Array) -> NDArray[np.intp]:
    """Return the states (N,) of lowest total energy, given energies (N, 64) and evidence of exchanges (N - 1, 6)."""
    differs = (_PAIR_STATES[:, None] != _PAIR_STATES[None]).astype(np.float64)
    back = np.zeros(energy.shape, dtype=np.intp)
    least = energy[0]
    for k in range(1, len(energy)):
        cost = TURNING_COST - 2.0 * CONTINUITY_WEIGHT * turned[k - 1]
        ways = least[:, None] + differs @ cost
        back[k] = ways.argmin(axis=0)
        least = ways.min(axis=0) + energy[k]
    chosen = np.empty(len(energy), dtype=np.intp)
    chosen[-1] = int(least.argmin())
    for k in range(len(energy) - 1, 0, -1):
        chosen[k - 1] = back[k, chosen[k]]
    return chosen
