"""Limbs laid on their rays from where a trunk is, and refined there alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.refinement.descent import DescentResult
from posekit.refinement.equations import chains_of
from posekit.refinement.limb_descent import fit_limbs
from posekit.refinement.limb_terms import Chains, chi2_of_limbs
from posekit.refinement.problem import RefinementProblem
from posekit.refinement.start import relift
from posekit.tree.factors import LimbColumns, Rows, columns_of

MAX_LIMB_STEPS = 6
"""The most steps of a limb alone: it goes on together with its trunk."""


class SearchSettings(NamedTuple):
    """See `posekit.refinement.refine`."""

    steps: int
    precision: float
    hopeless: float


class Bases(NamedTuple):
    """B trunks with the limbs that pull at them.

    Attributes
    ----------
    found : DescentResult
        The trunks, refined with those limbs.
    leaf : int array (B,)
        A survivor of each.
    held : bool array (4, B)
        Which limbs they have.
    """

    found: DescentResult
    leaf: Rows
    held: NDArray[np.bool_]

    def open(self, settings: SearchSettings) -> NDArray[np.bool_]:
        """Return which are at a minimum, or may yet be explained (B,)."""
        return np.asarray(self.found.settled | (self.found.chi2 <= settings.hopeless))


class InitialLimbs(NamedTuple):
    """Limbs as they were given.

    Attributes
    ----------
    directions : array (4, 2, 3, M)
        Unit vectors of upper and lower segments, camera frame.
    far : bool array (4, 2, M)
        See `posekit.refinement.start.sides`.
    """

    directions: Array
    far: NDArray[np.bool_]

    def gather(self, which: Rows) -> InitialLimbs:
        """Return limbs (4, K)."""
        return InitialLimbs(
            *(np.stack([array[kind][..., which[kind]] for kind in range(4)]) for array in self)
        )


class PullingLimbs(NamedTuple):
    """Limbs that do not meet their image within their limits.

    Attributes
    ----------
    base : int array (P,)
        Of each column.
    problem : RefinementProblem
        The data of each column.
    chains : Chains
        The limbs where they were fitted alone.
    chi2 : array (4, P)
        Zero where a column has none.
    """

    base: Rows
    problem: RefinementProblem
    chains: Chains
    chi2: Array


class LimbsOnBases(NamedTuple):
    """Limbs on their bases.

    Attributes
    ----------
    chains : Chains
        Of M columns.
    chi2 : array (4, M)
        What each limb adds to its base's chi2; zero where a column has none.
    pulling : Pulling
        Those that do not meet their image.
    place : int array (4, M)
        The columns of limbs among those that pull, -1 for the others.
    """

    chains: Chains
    chi2: Array
    pulling: PullingLimbs
    place: Rows


def fit_on_bases(
    problem: RefinementProblem,
    bases: Bases,
    columns: LimbColumns,
    limbs: InitialLimbs,
    settings: SearchSettings,
) -> LimbsOnBases:
    """Lay limbs (M columns) on their rays from where their bases are, and fit those that do not meet their image.

    `problem` is that of all survivors.
    """
    rows = problem.take(bases.leaf[columns.base])
    held = chains_of(rows, bases.found.state.take(columns.base)._replace(directions=limbs.directions))
    chains = relift(rows, held, limbs.far)
    chi2 = chi2_of_limbs(rows, chains)
    chi2[~columns.used] = 0.0
    mine = [np.flatnonzero(chi2[kind] > settings.precision) for kind in range(4)]
    pulled = columns_of([columns.base[own] for own in mine], len(bases.leaf))
    place = np.full(chi2.shape, -1)
    on = chains_of(problem, bases.found.state.take(pulled.base))
    fit = PullingLimbs(
        pulled.base, problem.take(bases.leaf[pulled.base]), on, np.zeros((4, len(pulled.base)))
    )
    for kind, (own, to) in enumerate(zip(mine, pulled.of, strict=True)):
        place[kind, own] = to
        on.directions[kind][..., to] = chains.directions[kind][..., own]
        on.lengths[kind][..., to] = chains.lengths[kind][..., own]
        fit.chi2[kind, to] = chi2[kind, own]
    few = settings._replace(steps=min(settings.steps, MAX_LIMB_STEPS))
    fit_limbs(fit.problem, on, fit.chi2, pulled.used, **few._asdict())
    for kind, (own, to) in enumerate(zip(mine, pulled.of, strict=True)):
        chains.directions[kind][..., own] = on.directions[kind][..., to]
        chains.lengths[kind][..., own] = on.lengths[kind][..., to]
        chi2[kind, own] = fit.chi2[kind, to]
    return LimbsOnBases(chains, chi2, fit, place)
