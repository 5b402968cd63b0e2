"""From survivors of the tree to the most likely postures that the image, the lengths and the limits allow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.body import Figure
from posekit.geometry import Array
from posekit.refinement.descent import CHI2_PRECISION, MAX_STEPS
from posekit.refinement.freedom import degrees_of_freedom
from posekit.refinement.inputs import frames_of, numbers
from posekit.refinement.limb_fitting import SearchSettings
from posekit.refinement.observed_frames import ObservedFrames
from posekit.refinement.problem import RefinementProblem
from posekit.refinement.refined import REJECTION_PROBABILITY, Refined
from posekit.refinement.shared_search import SearchResult, SharedSearch
from posekit.refinement.size import BodySize, size_of
from posekit.refinement.state import head_points, place, place_limbs, trunk_joints
from posekit.refinement.survival import chi2_survival
from posekit.skeleton import HEAD_POINTS, JOINTS, LIMB_JOINTS
from posekit.tree.factors import Factors, factor_postures, whole_bodies

MAX_COORDINATE_METRES = 1e6
"""Metres beyond which a survivor is not refined."""

UNPLACED_METRES = 1e3
"""Metres: stands for the joints of survivors that cannot be placed."""


def refine(
    observed: ObservedFrames,
    postures: ArrayLike,
    *,
    frame: ArrayLike | None = None,
    head: ArrayLike | None = None,
    steps: int = MAX_STEPS,
    precision: float = CHI2_PRECISION,
    hopeless: float = np.inf,
) -> Refined:
    r"""Refine survivors to the most likely postures near them.

    Minimises

    .. math::

       \chi^2 = \sum_j \frac{|\pi(p_j) - y_j|^2}{\sigma_j^2} + |W (p_{root} - \mu)|^2
              + \sum_s \frac{\ln^2(l_s / \bar l_s)}{\rho_s^2} + \sum_i \frac{v_i^2}{\sigma_{limit}^2}

    over the configuration, and the lengths where their uncertainty is given; v is how far a joint is outside its
    limits. See `posekit.refinement.shared_search` for the way.

    Parameters
    ----------
    observed : ObservedFrames
        What was seen.
    postures : array (N, 14, 3) or (N, nq)
        Survivors, camera frame, metres; or configurations. NaN for joints that are not known; a survivor without a
        neck, or beyond 1000 km, is not refined.
    frame : int array (N,), optional
        The frame of each survivor; without it survivors and frames are the same.
    head : array (F, 5, 3) or (N, 5, 3), optional
        Where the head's points are, metres: the start of the search for the head, where it was seen.
    steps : int
        The most steps of trunks, of limbs, and of survivors.
    precision : float
        Decrease of chi2 that is not worth another step.
    hopeless : float
        A chi2 beyond which the search is given up unless the next step promises to halve it.

    Returns
    -------
    Refined
        In the order of the survivors.

    Raises
    ------
    InputError
        Where a shape is wrong, a deviation is not positive, or a name is unknown.
    """
    return begin_refinement(
        observed, postures, frame=frame, head=head, settings=SearchSettings(steps, precision, hopeless)
    ).finish()


def begin_refinement(
    observed: ObservedFrames,
    postures: ArrayLike,
    *,
    frame: ArrayLike | None = None,
    head: ArrayLike | None = None,
    settings: SearchSettings,
) -> BegunRefinement:
    """Refine the trunks and the limbs of survivors by themselves; parameters are those of `refine`.

    Raises
    ------
    InputError
        Where a shape is wrong, a deviation is not positive, or a name is unknown.
    """
    given = np.asarray(postures, dtype=np.float64)
    figure = observed.figure
    if given.ndim == 2 and given.shape[1] == figure.model.nq:
        given = figure.forward_kinematics(given)[:, : len(JOINTS)]
    positions = numbers("postures", given, (None, len(JOINTS), 3))
    count = len(observed.points())
    frames = frames_of(frame, len(positions), count)
    near = ~(np.abs(positions) > MAX_COORDINATE_METRES).any(axis=(1, 2))
    placeable = np.asarray(np.isfinite(positions[:, 0]).all(axis=1) & near)
    positions = np.where(placeable[:, None, None], positions, UNPLACED_METRES)
    problem = observed.problem(frames, positions[:, 0])
    heads = None if head is None else _heads(head, count, frames)
    factors = factor_postures(frames, positions)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # of joints at the very lens
        search = SharedSearch(problem, positions, heads, factors, settings)
    return BegunRefinement(
        observed=observed, frame=frames, placeable=placeable, factors=factors, search=search
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class BegunRefinement:
    """Survivors (N) whose trunks and limbs are refined by themselves, before any is refined as a whole.

    Parameters
    ----------
    observed : ObservedFrames
        What was seen.
    frame : int array (N,)
        The frame of each survivor.
    placeable : bool array (N,)
        Which can be refined.
    factors : Factors
        Their trunks and limbs.
    search : SharedSearch
        How far each is.
    """

    observed: ObservedFrames
    frame: NDArray[np.intp]
    placeable: NDArray[np.bool_]
    factors: Factors
    search: SharedSearch

    @cached_property
    def promised(self) -> Array:
        """What chi2 comes down to (N,); NaN where a survivor cannot be refined.

        To second order; where noise would not explain that, what it cannot come below.
        """
        search = self.search
        with np.errstate(over="ignore", invalid="ignore"):
            found = np.where(self.placeable, search.promised, np.nan)
            doubtful = self._p(found) < REJECTION_PROBABILITY
            return np.where(doubtful & self.placeable, search.least, found)

    @cached_property
    def promised_p(self) -> Array:
        """The probability that noise alone gives a chi2 as large as is promised (N,)."""
        return self._p(self.promised)

    def _p(self, chi2: Array) -> Array:
        known = np.isfinite(chi2)
        return np.where(known, chi2_survival(np.where(known, chi2, 0.0), self._dof), 0.0)

    @cached_property
    def _dof(self) -> NDArray[np.intp]:
        return degrees_of_freedom(self.search.problem) + self.search.promised_dof

    @cached_property
    def trunks(self) -> Array:
        """The trunks (T, 6, 3), each refined by itself, camera frame, metres."""
        return trunk_joints(self.search.bases.found.state) * self._factor[:, None, None]

    @cached_property
    def limbs(self) -> tuple[Array, ...]:
        """By kind the limbs (L, 2, 3), each refined by itself on its trunk, camera frame, metres."""
        chains, columns = self.search.fitted.chains, self.search.columns
        points = np.empty((8, 3, chains.start.shape[2]))
        place_limbs(chains.start, chains.directions, chains.lengths, points)
        made = []
        for kind, (_, middle, end) in enumerate(LIMB_JOINTS):
            own = columns.of[kind]
            at = points[[middle - 6, end - 6]][..., own].transpose(2, 0, 1)
            made.append(at * self._factor[columns.base[own], None, None])
        return tuple(made)

    @property
    def limb_chi2(self) -> tuple[Array, ...]:
        """By kind what each limb adds to the chi2 of its trunk (L,), before either gives way."""
        return tuple(self.search.fitted.chi2[kind, own] for kind, own in enumerate(self.search.columns.of))

    @property
    def joints(self) -> Array:
        """Survivors (N, 14, 3) put together from these; NaN where one cannot be refined."""
        joints = whole_bodies(self.trunks, self.limbs, self.factors.trunk_of, self.factors.limb_of)
        joints[~self.placeable] = np.nan
        return joints

    @cached_property
    def _factor(self) -> Array:
        """By what factor the body of each trunk is larger than its figure (T,)."""
        root, prior = self.search.bases.found.state.root.T, self.observed.root
        if not self.observed.size_deviation or prior is None:
            return np.ones(len(root))
        frames = self.frame[self.factors.trunk]
        return size_of(root, prior, frames, self.observed.size_deviation).factor

    @cached_property
    def columns(self) -> Refined:
        """The limbs side by side on their trunks, as whole bodies (M): what they share is theirs, with covariances."""
        search = self.search
        base, chains = search.columns.base, search.fitted.chains
        found = search.bases.found.take(base)
        state = found.state._replace(directions=chains.directions, limbs=chains.lengths)
        one = self.factors.trunk[base]
        return self._refined(one, SearchResult(found._replace(state=state), search.first[one]))

    def finish(self, rows: NDArray[np.intp] | None = None) -> Refined:
        """Refine survivors, or some of them, to the end."""
        rows = np.arange(len(self.frame)) if rows is None else rows
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # of joints at the very lens
            found = self.search.finish(rows)
        return self._refined(rows, found)

    def _refined(self, rows: NDArray[np.intp], found: SearchResult) -> Refined:
        size = None
        frames, observed = self.frame[rows], self.observed
        if observed.size_deviation and observed.root is not None:
            size = size_of(found.descent.state.root.T, observed.root, frames, observed.size_deviation)
        problem = self.search.problem.take(rows)
        return _refined(observed.figure, problem, frames, found, self.placeable[rows], size)


def _refined(
    figure: Figure,
    problem: RefinementProblem,
    frames: NDArray[np.intp],
    searched: SearchResult,
    placeable: NDArray[np.bool_],
    size: BodySize | None,
) -> Refined:
    found, first = searched
    joints = place(found.state).transpose(2, 0, 1).copy()
    joints[~placeable] = np.nan
    head = np.full((len(frames), len(HEAD_POINTS), 3), np.nan)
    if problem.head_image is not None:
        head = (found.state.root + head_points(found.state, problem.anatomy.head)).transpose(2, 0, 1).copy()
        head[~placeable] = np.nan
    if size is not None:
        joints *= size.factor[:, None, None]
        head *= size.factor[:, None, None]
    return Refined(
        figure=figure,
        frame=frames,
        joints=joints,
        head=head,
        chi2=np.where(placeable, found.chi2, np.nan),
        dof=degrees_of_freedom(problem) + found.active + found.folds,
        start_chi2=np.where(placeable, first, np.nan),
        steps=found.steps,
        converged=found.settled & placeable,
        problem=problem,
        size=size,
    )


def _heads(head: ArrayLike, count: int, frames: NDArray[np.intp]) -> Array:
    given = np.asarray(head, dtype=np.float64)
    if given.shape == (count, len(HEAD_POINTS), 3):
        return np.asarray(given[frames])
    return numbers("head", given, (len(frames), len(HEAD_POINTS), 3))
