"""The branch code that the truth takes through the tree, and what pruned it."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS, PARENTS, SIDES
from posekit.tree import Leaves

TREE_DEPTH: Final = len(JOINTS) - 1

LIMB_CHOICES: Final = tuple(
    tuple(JOINT[f"{side}_{joint}"] for joint in limb)
    for limb in (("elbow", "wrist"), ("knee", "ankle"))
    for side in SIDES
)
"""The two joints of each limb whose near-far choices a limb can get wrong: arms, then legs."""


class TrueBranch(NamedTuple):
    """The branch of the truth in H hypotheses.

    Attributes
    ----------
    code : int array (H,)
        Its branch code; -1 where no branch reaches all joints.
    known : bool array (H,)
        Where there is one to be known: all joints are true and seen.
    lost_at : int array (H,)
        The joint that no branch on the true path reaches; 0 where all are reached.
    """

    code: NDArray[np.int32]
    known: NDArray[np.bool_]
    lost_at: NDArray[np.intp]


def true_branch(leaves: Leaves, truth: Array) -> TrueBranch:
    """Follow, from the root, the candidate that is nearer to the true joint.

    Parameters
    ----------
    leaves : Leaves
        Of trees over the 14 joints, H hypotheses.
    truth : array (H, 14, 3)
        Camera frame, metres; NaN where not known.
    """
    hypotheses = np.arange(len(truth))
    bits = np.zeros((len(truth), len(JOINTS)), dtype=np.int32)
    path = np.zeros((len(truth), len(JOINTS)), dtype=np.intp)
    known = np.asarray(np.isfinite(truth).all(axis=(1, 2)))
    lost_at = np.zeros(len(truth), dtype=np.intp)
    for joint in range(1, len(JOINTS)):
        both = 2 * path[:, PARENTS[joint], None] + np.array([0, 1])
        pair = leaves.candidates.positions[joint][hypotheses[:, None], both]
        away = np.linalg.norm(pair - truth[:, joint, None], axis=-1)
        reached = np.isfinite(pair).all(axis=-1).any(axis=1)
        lost_at[(lost_at == 0) & ~reached] = joint
        bits[:, joint] = np.argmin(np.where(np.isnan(away), np.inf, away), axis=1)
        path[:, joint] = both[:, 0] + bits[:, joint]
    code = (bits[:, 1:] << np.arange(TREE_DEPTH - 1, -1, -1)).sum(axis=1).astype(np.int32)
    return TrueBranch(np.where(lost_at > 0, -1, code).astype(np.int32), known, lost_at)


def limbs_right(code: NDArray[np.int32], true: NDArray[np.int32]) -> Array:
    """Return which share of the four limbs takes the true branch (N,); NaN where the truth has no code (-1).

    Parameters
    ----------
    code, true : int array (N,)
        Branch codes; those of an arm are the choices of elbow and wrist, of a leg those of knee and ankle.
    """
    differs = np.asarray(code) ^ np.asarray(true)
    right = np.zeros(len(differs))
    for limb in LIMB_CHOICES:
        bits = sum(1 << (TREE_DEPTH - joint) for joint in limb)
        right += (differs & bits) == 0
    return np.where(true < 0, np.nan, right / len(LIMB_CHOICES))


def killers(leaves: Leaves, true: TrueBranch) -> list[str]:
    """Return for each hypothesis what pruned the true branch, ``check/where``; empty where nothing did."""
    found = [""] * len(true.code)
    for hypothesis in np.flatnonzero(true.lost_at).tolist():
        found[hypothesis] = f"lengths/{JOINTS[true.lost_at[hypothesis]]}"
    for group in leaves.pruned:
        code = true.code[group.frame]
        hit = np.flatnonzero((code >= 0) & (code >> (TREE_DEPTH - group.level) == group.code))
        for k in hit.tolist():
            found[int(group.frame[k])] = f"{group.check}/{group.where[group.place[k]]}"
    return [one if known else "" for one, known in zip(found, true.known.tolist(), strict=True)]
