"""The probability of each survivor: how well it fits the picture, times how likely such a posture is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking.depth import Depth
from posekit.ranking.given import RankingEvidence, numbers
from posekit.ranking.judging import judge
from posekit.ranking.prior import TERM_NAMES, Prior
from posekit.ranking.prior_file import load_prior
from posekit.ranking.ranking import Ranking, softmax
from posekit.ranking.upright import Up
from posekit.safe_io import nearest

DEFAULT_DEVIATION_METRES: Final = 0.012
"""Metres by which survivors are off, where nobody says: 2 px at 4 m, or a torso that gives."""


class Term(Protocol):
    """A term of one's own: postures (N, 14, 3) to a log-density each (N,)."""

    def __call__(self, joints: Array, /) -> ArrayLike:
        """Return the log-density of each posture, NaN where it says nothing."""
        ...


def rank(
    joints: ArrayLike,
    lengths: Mapping[str, float] | None = None,
    *,
    frame: ArrayLike | None = None,
    length_residual: ArrayLike | None = None,
    chi2: ArrayLike | None = None,
    deviation: ArrayLike = DEFAULT_DEVIATION_METRES,
    up: Up | None = None,
    depth: Depth | None = None,
    extra: Mapping[str, ArrayLike | Term] | None = None,
    without: Iterable[str] = (),
    prior: Prior | None = None,
) -> Ranking:
    r"""Give every survivor a probability.

    .. math::

        p_i = \frac{e^{\sum_t w_t f_t(i)}}{\sum_j e^{\sum_t w_t f_t(j)}}

    over the survivors j of the same frame, with the log terms f and weights w of the prior: ``image``, ``posture`` (the
    directions of segments in the torso's frame), ``gravity`` (which way is up, given the posture), ``balance`` (centre
    of mass over the feet), ``contact`` (feet on one level) and ``depth``. Each but `chi2` is counted from its average
    over true postures, so that what is not known is neither for nor against a survivor.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Survivors, camera frame, metres; NaN where a joint is not known.
    lengths : mapping, optional
        The person's, by segment name, metres. Without them and `chi2` the image says nothing.
    frame : int array (N,), optional
        The frame of each survivor, from 0, in any order; without it all are of one frame.
    length_residual : array (N,), optional
        How much too short each survivor's worst segment was for its image, metres.
    chi2 : array (N,), optional
        Of a refinement: then the image's term is minus its half. NaN counts as the largest of its frame.
    deviation : float or array (F,)
        How far off survivors' joints are, metres (`deviation_of_noise`, `deviation_of_tolerance`): the deviation of
        distances inside torso and hips, and what blurs the prior on postures.
    up : Up, optional
        Which way is up in the camera's frame. Without it gravity, balance and contact say nothing.
    depth : Depth, optional
    extra : mapping, optional
        Terms from outside: a name to log-densities (N,), or to a function of the joints that returns them. Unknown ones
        (NaN) count as their frame's mean.
    without : iterable of str
        Terms to leave out, by name.
    prior : Prior, optional
        The built-in one if not given.

    Returns
    -------
    Ranking

    Raises
    ------
    InputError
        Where a shape is wrong, a joint is infinite, or a name is unknown.

    Examples
    --------
    >>> import posekit
    >>> from posekit.ranking import Up, rank
    >>> recovery = posekit.recover(posekit.builtin_view("seq1"))
    >>> frame = recovery.frames[0]
    >>> ranking = rank(frame.joints, recovery.figure.lengths, length_residual=frame.length_residual, up=Up.level())
    >>> round(float(ranking.probability.sum()), 9), len(ranking.order) == len(frame)
    (1.0, True)
    """
    given = RankingEvidence.checked(joints, lengths, frame, length_residual, chi2, deviation, up, depth)
    added = dict(extra or {})
    left_out = _left_out(without, added)
    prior = prior or load_prior()
    terms = judge(given, [name for name in TERM_NAMES if name not in left_out], prior)
    refined = given.chi2 is not None
    if refined and "image" in terms:
        terms["image"] = _least_where_unknown(terms["image"], given.frame)
    for name in terms:
        terms[name] *= prior.weights["chi2" if refined and name == "image" else name]
    for name, term in added.items():
        if name not in left_out:
            terms[name] = _added(name, term, given)
    score = np.sum(list(terms.values()), axis=0) if terms else np.zeros(len(given.joints))
    return Ranking(
        probability=softmax(score, given.frame),
        frame=given.frame,
        terms=terms,
        up="" if up is None else up.says,
    )


def _left_out(without: Iterable[str], added: Mapping[str, object]) -> set[str]:
    names = {without} if isinstance(without, str) else set(without)
    for name in added:
        if name in TERM_NAMES:
            raise InputError(f"{name!r} is a term already; expected another name for one of your own")
    for name in sorted(names):
        if name not in (*TERM_NAMES, *added):
            raise InputError(f"{name!r} is no term to leave out; {nearest(name, (*TERM_NAMES, *added))}")
    return names


def _added(name: str, term: ArrayLike | Term, given: RankingEvidence) -> Array:
    """Return a term from outside, with its frame's mean where it is not known; 0 where none of its frame is."""
    values = numbers(name, term(given.joints) if callable(term) else term, (len(given.joints),))
    if (values == np.inf).any():
        raise InputError(f"{name}: an infinite log-density; expected numbers, minus infinity or NaN")
    known = np.isfinite(values)
    count = np.bincount(given.frame[known], minlength=len(given.deviation))
    total = np.bincount(given.frame[known], weights=values[known], minlength=len(given.deviation))
    return np.where(np.isnan(values), (total / np.maximum(count, 1))[given.frame], values)


def _least_where_unknown(values: Array, frame: NDArray[np.intp]) -> Array:
    """Give what is NaN the least of its frame; 0 where all of a frame are."""
    unknown = np.isnan(values)
    if not unknown.any():
        return values
    least = np.full(int(frame.max()) + 1, np.inf)
    np.minimum.at(least, frame[~unknown], values[~unknown])
    return np.where(unknown, np.where(np.isposinf(least), 0.0, least)[frame], values)
