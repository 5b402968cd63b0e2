"""Degrees of freedom: how many residuals are left over when the posture is determined."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posekit.refinement.problem import RefinementProblem


def degrees_of_freedom(problem: RefinementProblem) -> NDArray[np.intp]:
    r"""Count residuals less the unknowns that they determine (N,).

    A limb has as many unknowns as image coordinates, or fewer coordinates: it leaves nothing over. Lengths that are
    varied have one residual each. So what counts are the torso's points (two coordinates each, and the prior of the
    root) against six unknowns, the hips' two against three, the head's against three; a part that is not determined
    by its own leaves nothing over either. Hips with the pelvis between them turn with the spine about their own line:
    two unknowns are left.
    """
    seen = problem.weight > 0
    root = (np.abs(problem.root_weight) > 0).any(axis=1).sum(axis=0)
    torso = 2 * seen[:4].sum(axis=0) + root - 6
    over = np.maximum(2 * seen[4:6].sum(axis=0) - (2 if problem.anatomy.middle_pelvis else 3), 0)
    if problem.head_weight is not None:
        over = over + np.maximum(2 * (problem.head_weight > 0).sum(axis=0) - 3, 0)
    return np.asarray(np.maximum(torso + over, 0), dtype=np.intp)
