"""The probability of each survivor: how well it fits the picture, times how likely such a posture is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking.evidence import RankingEvidence, numbers
from posekit.ranking.log_terms import log_terms
from posekit.ranking.posture_prior import OF_POSTURES, TERM_NAMES, Prior
from posekit.ranking.prior_file import load_prior
from posekit.ranking.ranking import Ranking, softmax
from posekit.safe_io import nearest


class Term(Protocol):
    """A term of one's own: postures (N, 14, 3) to a log-density each (N,)."""

    def __call__(self, joints: Array, /) -> ArrayLike:
        """Return the log-density of each posture, NaN where it says nothing."""
        ...


def rank(
    evidence: RankingEvidence,
    *,
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
    evidence : RankingEvidence
        The survivors of any number of frames, and what is known of them: see `RankingEvidence.of`.
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
        Where a term has a wrong shape or is infinite, or a name is unknown.

    Examples
    --------
    >>> import posekit
    >>> from posekit.ranking import RankingEvidence, Up, rank
    >>> recovery = posekit.recover(posekit.builtin_view("seq1"))
    >>> frame = recovery.frames[0]
    >>> evidence = RankingEvidence.of(
    ...     frame.joints, recovery.figure.lengths, length_residual=frame.length_residual, up=Up.level()
    ... )
    >>> ranking = rank(evidence)
    >>> round(float(ranking.probability.sum()), 9), len(ranking.order) == len(frame)
    (1.0, True)
    """
    added = dict(extra or {})
    left_out = _left_out(without, added)
    prior = prior or load_prior()
    terms = log_terms(evidence, [name for name in TERM_NAMES if name not in left_out], prior)
    # After a refinement chi2 says how well the image fits, and terms have weights of their own.
    refined = evidence.chi2 is not None
    if refined and "image" in terms:
        terms["image"] = _least_where_unknown(terms["image"], evidence.frame)
    weights = prior.weights_of(refined)
    coolness = 1.0 / (1.0 + (evidence.deviation / prior.image_temperature) ** 2)
    for name in terms:
        terms[name] *= weights[name]
        if refined and name not in OF_POSTURES:
            terms[name] *= coolness[evidence.frame]
    for name, term in added.items():
        if name not in left_out:
            terms[name] = _added(name, term, evidence)
    score = np.sum(list(terms.values()), axis=0) if terms else np.zeros(len(evidence.joints))
    return Ranking(
        probability=softmax(score, evidence.frame),
        frame=evidence.frame,
        terms=terms,
        up="" if evidence.up is None else evidence.up.says,
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


def _added(name: str, term: ArrayLike | Term, evidence: RankingEvidence) -> Array:
    """Return a term from outside, with its frame's mean where it is not known; 0 where none of its frame is."""
    values = numbers(name, term(evidence.joints) if callable(term) else term, (len(evidence.joints),))
    if (values == np.inf).any():
        raise InputError(f"{name}: an infinite log-density; expected numbers, minus infinity or NaN")
    known = np.isfinite(values)
    count = np.bincount(evidence.frame[known], minlength=len(evidence.deviation))
    total = np.bincount(evidence.frame[known], weights=values[known], minlength=len(evidence.deviation))
    return np.where(np.isnan(values), (total / np.maximum(count, 1))[evidence.frame], values)


def _least_where_unknown(values: Array, frame: NDArray[np.intp]) -> Array:
    """Give what is NaN the least of its frame; 0 where all of a frame are."""
    unknown = np.isnan(values)
    if not unknown.any():
        return values
    least = np.full(int(frame.max()) + 1, np.inf)
    np.minimum.at(least, frame[~unknown], values[~unknown])
    return np.where(unknown, np.where(np.isposinf(least), 0.0, least)[frame], values)
