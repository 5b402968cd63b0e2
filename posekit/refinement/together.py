r"""The joint step of survivors whose trunk and limbs have each been refined alone.

At its own minimum the trunk is quadratic, :math:`\chi^2_0 + \delta^T H \delta`, and each limb with its own unknowns
eliminated too, in the shift of its start and the turn of its part. Their sum is minimised for each survivor: one
system of nine (or eighteen) unknowns. Where chi2 then is what the quadratic promised, the survivor is done; where not,
`posekit.refinement.descent` goes on from there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.refinement.descent import BLOCK
from posekit.refinement.equations import (
    FLOOR,
    Equations,
    Reduced,
    chains_of,
    eliminate,
    evaluate,
    factor,
    left_over,
    linearise,
)
from posekit.refinement.factors import Factors
from posekit.refinement.limb_terms import Chains, limb_terms
from posekit.refinement.problem import Problem
from posekit.refinement.small import backward
from posekit.refinement.state import State, Step, moved
from posekit.refinement.trunk_terms import start_ways, trunk_terms

AGREES = 0.02
"""By how much chi2 may differ from what the quadratic promised: then a further step would gain less than that."""


class Together(NamedTuple):
    """Survivors after their joint step.

    Attributes
    ----------
    state : State
    chi2 : array (N,)
    settled : bool array (N,)
    folds, active : int array (N,)
        Of the limbs alone, before the step.
    """

    state: State
    chi2: Array
    settled: NDArray[np.bool_]
    folds: NDArray[np.intp]
    active: NDArray[np.intp]
