"""Which whole bodies are told as one: those whose trunk and limbs all lie within the ellipsoids of likelier ones.

Where lengths are uncertain, a branch of the tree has a valley of postures in which searches stop here and there: one of
them tells it, with its ellipsoids. Thousands of bodies are put together from tens of limbs: a limb that is indistinct
from another of its trunk makes every body that has it indistinct from the body that has the other.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.refinement.descent import CHI2_PRECISION
from posekit.refinement.merging import leaders_of_pairs
from posekit.refinement.refine import BegunRefinement
from posekit.skeleton import LIMB_JOINTS, N_TRUNK_JOINTS
from posekit.tree.distinct import equal_pairs
from posekit.tree.factors import Rows

INDISTINCT_SQUARE: Final = 2.366
"""Chi-square of three degrees of freedom that half of all draws are below: a joint within it is in the ellipsoid that
holds the truth as often as not."""

ROUNDING_SQUARE_METRES: Final = 1e-8
"""Square metres that are added to every variance: a neck that is known exactly has none."""


def alike(begun: BegunRefinement, frame: NDArray[np.intp]) -> Rows:
    """Give bodies (N,) of frames (N,) numbers, the same to those that are told as one.

    A trunk is as another where its six joints are in the ellipsoids of the likelier one, a limb on the same or such a
    trunk where both its joints are.
    """
    factors, columns = begun.factors, begun.columns
    count = len(factors.trunk)
    inverse = np.asarray(np.linalg.inv(columns.covariance + ROUNDING_SQUARE_METRES * np.eye(3)))
    base, of = begun.search.columns
    first = np.searchsorted(base, np.arange(count))
    chi2 = begun.search.bases.found.chi2
    own_joints, ellipsoids = columns.joints[first, :N_TRUNK_JOINTS], inverse[first, :N_TRUNK_JOINTS]
    leader = _leaders(frame[factors.trunk], chi2, own_joints, ellipsoids)
    matched = np.ones(len(factors.trunk_of), dtype=np.bool_)
    keys = [leader[factors.trunk_of]]
    own = [factors.trunk_of]
    for kind, (_, *ends) in enumerate(LIMB_JOINTS):
        place, ellipsoid = columns.joints[of[kind]][:, ends], inverse[of[kind]][:, ends]
        on, fit = base[of[kind]], begun.limb_chi2[kind]
        alone = _leaders(on, fit, place, ellipsoid)
        # Limbs of a trunk that is as another: the likeliest of that one's that they are as.
        b, a = equal_pairs(np.where(leader[on] == on, -1, leader[on]), on)
        near = _within(place[b] - place[a], ellipsoid[a])
        order = np.lexsort((_without_rounding(fit[a[near]]), b[near]))
        other, which = np.unique(b[near][order], return_index=True)
        across = np.full(len(on), -1)
        across[other] = alone[a[near][order][which]]
        stays = leader[on] == on
        across[stays] = alone[stays]
        limb = factors.limb_of[kind]
        matched &= across[limb] >= 0
        keys.append(across[limb])
        own.append(alone[limb])
    table = np.where(matched, np.stack(keys), np.stack(own))
    return np.unique(table, axis=1, return_inverse=True)[1].reshape(-1)


def _leaders(group: Rows, chi2: Array, place: Array, ellipsoid: Array) -> Rows:
    """Find for each part (n, J, 3) the first of its group, the likeliest first, in whose ellipsoids it is."""
    order = np.argsort(_without_rounding(chi2), kind="stable")
    b, a = equal_pairs(group[order], group[order])
    a, b = a[a < b], b[a < b]
    near = _within(place[order[b]] - place[order[a]], ellipsoid[order[a]])
    leader = np.empty_like(order)
    leader[order] = order[leaders_of_pairs(len(order), a[near], b[near])]
    return leader


def _without_rounding(chi2: Array) -> Array:
    """Return chi2 (n,) in steps of what searches leave open: less than that would choose otherwise on each machine."""
    return np.asarray(np.round(chi2 / CHI2_PRECISION))


def _within(apart: Array, ellipsoid: Array) -> NDArray[np.bool_]:
    """Tell where all joints (n, J, 3) are within ellipsoids (n, J, 3, 3)."""
    square = np.einsum("nji,njik,njk->nj", apart, ellipsoid, apart)
    return np.asarray((square < INDISTINCT_SQUARE).all(axis=1))
