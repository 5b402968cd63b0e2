"""Survivors that are proven to have no completion, among the branches that a tree pruned."""

from __future__ import annotations

import numpy as np

from posekit.hidden.completion import CompletedSurvivors
from posekit.tree import Leaves
from posekit.tree.leaves import Pruned

OCCLUDED_REASON = "occluded"
"""How the reason is named, before the joint's name."""


def reject(leaves: Leaves, completion: CompletedSurvivors) -> tuple[Leaves, CompletedSurvivors]:
    """Prune the survivors that are impossible, each with the joint that has no position: ``occluded/right_elbow``.

    Parameters
    ----------
    leaves : Leaves
        The survivors of the tree.
    completion : CompletedSurvivors
        Of all their survivors.

    Returns
    -------
    Leaves, Completion
        What is left, and its rows.
    """
    gone = completion.impossible
    if not gone.any():
        return leaves, completion
    count = int(gone.sum())
    pruned = Pruned(
        level=leaves.level,
        frame=leaves.frame[gone],
        code=leaves.code[gone],
        check=OCCLUDED_REASON,
        where=leaves.joints,
        unit="m",
        place=completion.blamed[gone],
        value=np.full(count, np.nan),
        lower=np.full(count, -np.inf),
        upper=np.full(count, np.inf),
    )
    left = leaves.keep(~gone, leaves.frame, leaves.code, leaves.level, (*leaves.pruned, pruned))
    return left, completion.take(~gone)
