r"""The prior of postures: mixtures of t distributions of segment directions, and weights for `log_terms`.

.. math::

    \log p(x) = c + \log \sum_k s_k \left(1 + \frac{(x - m_k)^T S^{-1} (x - m_k)}{\nu}\right)^{-(\nu + d) / 2}

Here s are weights, m centres, S is the scale matrix, and :math:`\nu` the degrees of freedom. The marginal distribution
of the known coordinates has the same form, with the known rows of m and the known rows and columns of S (Kotz &
Nadarajah 2004, Multivariate t distributions and their applications, §1.10).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.errors import refusal, shown
from posekit.files import DATA
from posekit.geometry import Array, Record, dot, read_only
from posekit.ranking.directions import DIRECTION_NAMES, UP_INDEX

PRIORS: Final = DATA / "priors"

#: Weights of the weighted sum of coordinates that identifies equal points: different points have different sums.
UNEVEN: Final = np.sqrt(2.0 + np.arange(3 * len(DIRECTION_NAMES)))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class StudentMixture(Record):
    """A mixture of K multivariate t distributions of d coordinates, with different centres and a common scale matrix.

    Parameters
    ----------
    means : array (K, d)
        Centres m.
    scale : array (d, d)
        S, symmetric and positive definite.
    dof : float
        Degrees of freedom; fewer degrees give heavier tails.
    share : array (K,)
        Weight s of each distribution; the weights are normalised to sum to one.
    """

    means: Array
    scale: Array
    dof: float
    share: Array

    def __post_init__(self) -> None:
        for name in ("means", "scale"):
            self._set(name, read_only(getattr(self, name)))
        self._set("share", read_only(np.asarray(self.share) / np.sum(self.share)))

    @cached_property
    def whitening(self) -> Array:
        """Lower triangular matrix W with W' W = S^-1; its first k rows whiten the first k coordinates."""
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.scale)))

    def part(self, rows: Any) -> StudentMixture:
        """Return the marginal distribution of selected coordinates."""
        return replace(self, means=self.means[:, rows], scale=self.scale[rows][:, rows])

    def widened(self, variance: Array) -> StudentMixture:
        """Return the mixture with variances (d,) added to the coordinates."""
        return replace(self, scale=self.scale + np.diag(variance))

    def excess(self, x: Array, count: int) -> Array:
        """Return the log-density (N,) of the first `count` coordinates, minus its expected value.

        Parameters
        ----------
        x : array (N, d)
            Coordinates; NaN if unknown. The marginal distribution of the known coordinates is used.
        count : int
            Number of leading coordinates.
        """
        known = np.isfinite(x[:, :count])
        if known.all():
            # Exact postures of a frame share limbs: equal coordinates are evaluated once.
            _, first, which = np.unique(x[:, :count] @ UNEVEN[:count], return_index=True, return_inverse=True)
            return np.asarray((self._log_sum(x[first], count) - self._usual(count))[which])
        found, code = np.zeros(len(x)), known @ (1 << np.arange(count))
        for pattern in set(code.tolist()) - {0}:
            rows = np.flatnonzero(code == pattern)
            columns = np.flatnonzero(known[rows[0]])
            part = self if len(columns) == count else self.part(columns)
            found[rows] = part.excess(x[np.ix_(rows, columns)], len(columns))
        return found

    def _usual(self, count: int) -> float:
        """Return the mean log-density of the first `count` coordinates, assuming that the components do not overlap."""
        if count not in self._averages:
            power = (self.dof + count) / 2
            own = power * (digamma(power) - digamma(self.dof / 2))
            self._averages[count] = float(self.share @ self._log_sum(self.means, count)) - own
        return self._averages[count]

    @cached_property
    def _averages(self) -> dict[int, float]:
        return {}

    def _log_sum(self, x: Array, count: int) -> Array:
        """Return the logarithm (N,) of the sum over k in the module's formula, at points x (N, d)."""
        W = self.whitening[:count, :count]
        points, middles = x[:, :count] @ W.T, self.means[:, :count] @ W.T
        # 1 + |p - m|^2 / nu, as one product of matrices.
        left = np.column_stack([points, dot(points, points), np.ones(len(points))])
        right = np.column_stack([-2 * middles, np.ones(len(middles)), self.dof + dot(middles, middles)])
        power = (self.dof + count) / 2
        # In place, because the allocation of arrays of this size is slower than the arithmetic.
        log = np.log(left @ (right.T / self.dof))
        log *= -power
        nearest = log.max(axis=1)
        log -= nearest[:, None]  # relative to the nearest component no power underflows
        return np.asarray(np.log(np.exp(log, out=log) @ self.share) + nearest)


def digamma(x: float) -> float:
    """Return the logarithmic derivative of the gamma function at x > 0 (Abramowitz & Stegun 1964, 6.3.5 and 6.3.18)."""
    below = 0.0
    while x < 12.0:
        below -= 1.0 / x
        x += 1.0
    y = 1.0 / (x * x)
    series = y * (1 / 12 - y * (1 / 120 - y * (1 / 252 - y * (1 / 240 - y / 132))))
    return below + math.log(x) - 0.5 / x - series


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Prior(Record):
    r"""A prior of postures, and the weights of the terms of `posekit.ranking.log_terms`.

    Parameters
    ----------
    blocks : sequence of (names, StudentMixture, bool)
        Each block has the names of some directions and their joint distribution. If the bool is true, only the
        conditional density of `up` given the other directions is used.
    temperature : float
        Metres. For postures from exact image points, the log-density of directions is divided by 1 + deviation /
        temperature, where deviation is the standard deviation of the joints. Errors of a centimetre change directions
        by more than the width of the prior's peaks.
    weights, noisy : mapping of str to float
        Weights of the terms by name: for postures from exact image points, and for modes of noisy image points.
    balance, contact : (float, float)
        Scale s (metres) and constant u of the log-density :math:`u - \log(1 + (d / s)^2)`. The distance d is a result
        of `posekit.ranking.standing.standing`.
    """

    blocks: Sequence[tuple[tuple[str, ...], StudentMixture, bool]]
    temperature: float
    weights: Mapping[str, float]
    noisy: Mapping[str, float]
    balance: tuple[float, float]
    contact: tuple[float, float]
    _wide: dict[tuple[int, float], StudentMixture] = field(default_factory=dict)

    def judge(self, found: Array, sine: float = 0.0) -> tuple[Array, Array]:
        """Return the log-densities of directions (N, 10 or 11, 3), each minus its expected value under the prior.

        Parameters
        ----------
        found : array
            Result of `posekit.ranking.directions.directions`, with or without `up`.
        sine : float
            Sine of the angular standard deviation of `up`; its square is added to the variances of `up`.

        Returns
        -------
        posture, gravity : array (N,)
            Log-density of the posture, and of `up` given the posture; 0 if no direction is known.
        """
        posture, gravity = np.zeros(len(found)), np.zeros(len(found))
        for index, (names, student, conditional) in enumerate(self.blocks):
            at = [DIRECTION_NAMES.index(name) for name in names]
            alone = 3 * sum(k != UP_INDEX for k in at)
            if found.shape[1] <= UP_INDEX:
                at = [k for k in at if k != UP_INDEX]
            flat = found[:, at].reshape(len(found), 3 * len(at))
            one = student.excess(flat, alone)
            if not conditional:
                posture += one
            if flat.shape[1] > alone:
                # log p(posture, up) - log p(posture) is the log-density of up given the posture.
                if (index, sine) not in self._wide:
                    extra = np.where(np.arange(flat.shape[1]) < alone, 0.0, sine**2)
                    self._wide[index, sine] = student.widened(extra)
                gravity += self._wide[index, sine].excess(flat, flat.shape[1]) - one
        return posture, gravity


@lru_cache(maxsize=4)
def load_prior(name: str = "people") -> Prior:
    """Load a prior by its name, or from a TOML file with the same keys as the built-in prior.

    Raises
    ------
    InputError
        If there is no such file, or a part of it is missing.
    """
    path = Path(name) if name.endswith(".toml") else PRIORS / f"{name}.toml"
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        blocks = [_block(one, float(table["dof"])) for one in table["block"]]
        return Prior(
            blocks=blocks,
            temperature=table["temperature"],
            weights=table["weights"],
            noisy=table["noisy"],
            balance=(table["balance"]["scale"], table["balance"]["usual"]),
            contact=(table["contact"]["scale"], table["contact"]["usual"]),
        )
    except (OSError, KeyError, ValueError, TypeError, np.linalg.LinAlgError) as error:
        raise refusal(
            name, "", shown(str(error)), "a table like urdf/priors/people.toml", "correct it"
        ) from None


def _block(table: Mapping[str, Any], dof: float) -> tuple[tuple[str, ...], StudentMixture, bool]:
    """Read one block of a prior's file.

    A matrix is a text with one row per line. The text of the scale matrix has only its lower triangle.
    """
    names = tuple(table["directions"])
    scale = np.zeros((3 * len(names), 3 * len(names)))
    for row, line in enumerate(table["scale"].splitlines()):
        scale[row, : row + 1] = scale[: row + 1, row] = line.split()
    means = np.array([line.split() for line in table["mean"].splitlines()], dtype=np.float64)
    student = StudentMixture(means=means, scale=scale, dof=dof, share=table.get("share", np.ones(len(means))))
    return names, student, bool(table.get("conditional", False))
