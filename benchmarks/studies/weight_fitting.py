r"""How much each term counts: the weights with which probabilities are calibrated.

Conditional logit (McFadden 1974, in Frontiers in econometrics): of a frame's survivors one is nearest to the truth; the
weights are those under which these choices were most likely,

.. math::

    \max_{w \ge 0} \sum_f \log \frac{e^{w \cdot x_{f}}}{\sum_j e^{w \cdot x_j}} - r |w|^2,

a concave problem in as many unknowns as there are terms.

Some frames are of postures like none that the prior knows; fitted to these too, weights are too modest of all others.
So frames may be `astray`: the choice is then any survivor's alike, for a share of the frames that is found together
with the weights by expectation and maximisation (Dempster et al. 1977).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking.ranking import Ranking, softmax

RIDGE_PENALTY: Final = 1e-3
"""The r of the problem: holds a weight near zero whose term says nothing."""

MAX_ITERATIONS: Final = 100
"""Newton steps: enough for any, where ten are usual."""

ASTRAY_STEPS, FIRST_ASTRAY_SHARE = 12, 0.05
"""Rounds in which frames are told astray or not, and their share in the first."""

MIN_IMPROVEMENT: Final = 1e-9
"""A gain of the mean log-likelihood that is not worth another step."""


class Choices(NamedTuple):
    """Terms (N, K) of survivors in the order of frames (N,), where frames start, and which survivor is the truth.

    Frames count as much as `counts` (F,) says.
    """

    terms: Array
    frame: NDArray[np.intp]
    starts: NDArray[np.intp]
    chosen: NDArray[np.intp]
    counts: Array

    def chances(self, weights: Array) -> Array:
        """Return the probability of what was chosen (F,)."""
        return np.asarray(softmax(self.terms @ weights, self.frame)[self.chosen])


def fit_weights(
    rankings: Sequence[Ranking],
    nearest: Sequence[ArrayLike],
    *,
    names: Sequence[str] | None = None,
    astray: bool = False,
) -> dict[str, float]:
    """Fit one weight a term; each ranking counts the same, however many frames it has.

    Parameters
    ----------
    rankings : sequence of Ranking
        Made with a prior whose weights are all one.
    nearest : sequence of int array (F,)
        For each ranking the survivor that is nearest to the truth, frame by frame; -1 for frames that do not count.
    names : sequence of str, optional
        The terms; by default all that some ranking has. A term that a ranking has not is 0 there.
    astray : bool
        Whether a share of the frames, which is fitted too, says nothing of the weights.

    Returns
    -------
    dict
        Zero or more, by name.

    Raises
    ------
    InputError
        Where a survivor is not of its frame, or nothing is left to fit.
    """
    wanted = (
        tuple(names) if names is not None else tuple(dict.fromkeys(n for one in rankings for n in one.terms))
    )
    sets = [
        _choices(ranking, np.asarray(rows), wanted) for ranking, rows in zip(rankings, nearest, strict=True)
    ]
    sets = [one for one in sets if len(one.chosen)]
    if not wanted or not sets:
        raise InputError("no terms or no frames to fit weights to")
    weights = _most_likely(sets, np.full(len(wanted), 0.5))
    share = FIRST_ASTRAY_SHARE
    for _ in range(ASTRAY_STEPS if astray else 0):
        straight = []
        for one in sets:
            among = np.diff(one.starts, append=len(one.frame))
            follows = (1 - share) * one.chances(weights)
            straight.append(follows / (follows + share / among))
        share = float(1 - np.mean([part.mean() for part in straight]))
        sets = [one._replace(counts=part) for one, part in zip(sets, straight, strict=True)]
        weights = _most_likely(sets, weights)
    return dict(zip(wanted, weights.tolist(), strict=True))


def _most_likely(sets: Sequence[Choices], weights: Array) -> Array:
    """Return the weights under which the choices are most likely, from some on."""
    value, slope, curve = _objective(sets, weights)
    for _ in range(MAX_ITERATIONS):
        free = (weights > 0) | (slope > 0)
        step = np.zeros(len(weights))
        step[free] = np.linalg.solve(-curve[np.ix_(free, free)], slope[free])
        # The step is halved until it is no worse: weights that are held at zero bend the parabola.
        size = 1.0
        while True:
            tried = np.maximum(weights + size * step, 0.0)
            better, next_slope, next_curve = _objective(sets, tried)
            if better >= value or size < 1e-6:
                break
            size /= 2
        gain, weights, value, slope, curve = better - value, tried, better, next_slope, next_curve
        if gain < MIN_IMPROVEMENT:
            break
    return weights


def _choices(ranking: Ranking, nearest: NDArray[np.intp], names: Sequence[str]) -> Choices:
    rows = nearest[nearest >= 0]
    if (rows >= len(ranking)).any() or (ranking.frame[rows] != np.flatnonzero(nearest >= 0)).any():
        raise InputError("the survivor nearest to the truth is not of its frame; expected its row, or -1")
    counted = np.zeros(int(ranking.frame.max(initial=-1)) + 1, dtype=bool)
    counted[ranking.frame[rows]] = True
    kept = np.flatnonzero(counted[ranking.frame])
    kept = kept[np.argsort(ranking.frame[kept], kind="stable")]
    place = np.empty(len(ranking), dtype=np.intp)
    place[kept] = np.arange(len(kept))
    absent = np.zeros(len(ranking))
    terms = np.stack([ranking.terms.get(name, absent)[kept] for name in names], axis=1)
    frame = ranking.frame[kept]
    starts = np.flatnonzero(np.diff(frame, prepend=-1))
    return Choices(terms, frame, starts, place[rows], np.ones(len(rows)))


def _objective(sets: Sequence[Choices], weights: Array) -> tuple[float, Array, Array]:
    """Return the mean log-likelihood of the choices less the ridge, its gradient and its Hessian."""
    value = -RIDGE_PENALTY * float(weights @ weights)
    slope, curve = -2 * RIDGE_PENALTY * weights, -2 * RIDGE_PENALTY * np.eye(len(weights))
    for one in sets:
        p = softmax(one.terms @ weights, one.frame)
        count = one.counts.sum()
        counted = np.repeat(one.counts, np.diff(one.starts, append=len(p)))
        weighted = p[:, None] * one.terms
        mean = np.add.reduceat(weighted, one.starts)
        value += float(one.counts @ np.log(np.maximum(p[one.chosen], 1e-300))) / count
        slope = slope + one.counts @ (one.terms[one.chosen] - mean) / count
        curve = curve - (one.terms.T @ (counted[:, None] * weighted) - (mean.T * one.counts) @ mean) / count
    return value, slope, curve
