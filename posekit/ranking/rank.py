"""The probability of each survivor: its likelihood of the image times the prior of its posture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, Record, dot, read_only, unit
from posekit.ranking.directions import directions, log_room
from posekit.ranking.prior import Prior, digamma, load_prior
from posekit.ranking.standing import standing
from posekit.skeleton import RIGID_SEGMENTS

#: Standard deviation of the tilt of a camera that is assumed to be level, degrees.
LEVEL_WITHIN_DEGREES: Final = 20.0

#: Degrees of freedom of the t distribution of a rigid distance's error: errors of torsos have heavy tails.
MISFIT_DEGREES_OF_FREEDOM: Final = 4.0

#: Least standard deviation of a distance inside torso and hips, metres: real torsos are not more rigid (CMU motion
#: capture).
MIN_DEVIATION_METRES: Final = 0.006

#: Ratio of the tolerance of rigid distances to the standard deviation of the survivors' joints (dimensionless). The
#: prior's weights were fitted with this ratio.
PER_TOLERANCE: Final = 2.2

#: Distance from ankles to centre of mass, and between the ankles, metres: an error of `up` by a small angle changes
#: `standing` by these distances times the angle.
CENTRE_OF_MASS_HEIGHT_METRES, STANCE_WIDTH_METRES = 0.9, 0.4


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Up(Record):
    """The direction against gravity.

    Parameters
    ----------
    direction : array (3,)
        Unit vector in the frame of the postures (x right, y down, z forward).
    deviation : float
        Standard deviation of the direction, degrees.
    source : str
        Text that says where the direction comes from; results contain it.
    """

    direction: Array
    deviation: float = 0.0
    source: str = "known"

    def __post_init__(self) -> None:
        self._set("direction", read_only(unit(np.asarray(self.direction, dtype=np.float64))))

    @staticmethod
    def level() -> Up:
        """Return the up direction of a level camera: opposite to the image's y axis."""
        source = f"assumed: a level camera, within {LEVEL_WITHIN_DEGREES:g} degrees"
        return Up(direction=np.array([0.0, -1.0, 0.0]), deviation=LEVEL_WITHIN_DEGREES, source=source)


def deviation_of_tolerance(rigid: float) -> float:
    """Return the error (standard deviation, m) of each joint that a tolerance (m) of distances in the torso allows."""
    return max(rigid / PER_TOLERANCE, MIN_DEVIATION_METRES)


def log_terms(
    joints: Array,
    *,
    deviation: float = 0.0,
    chi2: Array | None = None,
    log_volume: Array | None = None,
    lengths: Array | None = None,
    length_residual: Array | None = None,
    up: Up | None = None,
    prior: Prior | None = None,
) -> dict[str, Array]:
    """Return terms (N,) by name; their sum is the logarithm of the unnormalised probability of each posture.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Camera frame, metres; NaN where a joint is not known.
    deviation : float
        Standard deviation of the joint positions, metres, for postures from exact image points.
    chi2 : array (N,), optional
        Chi-square of modes of noisy image points. Without it, the term ``image`` uses the errors of the four rigid
        distances in torso and hips.
    log_volume : array (N,), optional
        Half the log determinant of the covariance of each mode.
    lengths : array (17,), optional
        Segment lengths in the order of `posekit.skeleton.SEGMENTS`, metres, for postures from exact image points.
    length_residual : array (N,), optional
        Largest distance by which a segment of each posture is too short to reach its ray, metres.
    up : Up, optional
        The up direction; without it, there are no terms ``balance`` and ``contact``, and ``gravity`` is 0.
    prior : Prior, optional
        The prior of postures; by default the built-in prior.

    Notes
    -----
    The terms are ``image`` (fit to the image), ``posture`` (directions of segments in the torso's frame), ``gravity``
    (up direction given the posture), ``balance`` (centre of mass over the feet), ``contact`` (feet on one level) and
    ``foreshortening`` (`posekit.ranking.directions.log_room`). Modes of noisy image points also have ``volume``
    (`log_volume`). The mean over true postures is subtracted from each term except chi2. A term that cannot be
    evaluated is 0.
    """
    prior = prior or load_prior()
    # In this order NumPy's inner loops run over postures, not over x, y, z.
    joints = np.asfortranarray(joints)
    direction = None if up is None else up.direction
    sine = 0.0 if up is None else math.sin(math.radians(up.deviation))
    posture, gravity = prior.judge(directions(joints, direction), sine)
    terms = {"posture": posture, "gravity": gravity, "foreshortening": log_room(joints)}
    if direction is not None:
        beside, apart = standing(joints, direction)
        for name, distance, (scale, usual), arm in (
            ("balance", beside, prior.balance, CENTRE_OF_MASS_HEIGHT_METRES),
            ("contact", apart, prior.contact, STANCE_WIDTH_METRES),
        ):
            value = usual - np.log1p(distance**2 / (scale**2 + (arm * sine) ** 2))
            terms[name] = np.nan_to_num(value)
    if chi2 is not None:
        terms["image"] = -0.5 * chi2
        terms["volume"] = np.zeros(len(joints)) if log_volume is None else log_volume
        return {name: prior.noisy[name] * values for name, values in terms.items()}
    if lengths is not None:
        terms["image"] = _misfit(joints, lengths, length_residual, deviation)
    cool = 1.0 / (1.0 + deviation / prior.temperature)
    cooled = {"posture", "gravity"}
    return {n: prior.weights[n] * (cool if n in cooled else 1.0) * v for n, v in terms.items()}


def _misfit(joints: Array, lengths: Array, residual: Array | None, deviation: float) -> Array:
    """Return the log-density (N,) of distance errors, minus its expected value.

    The errors are those of the rigid distances in torso and hips, and `residual`, the lengths that segments lack.
    """
    start, end = np.array(RIGID_SEGMENTS).T
    apart = joints[:, end] - joints[:, start]
    off = np.sqrt(dot(apart, apart)) - lengths[-len(RIGID_SEGMENTS) :]
    if residual is not None:
        off = np.concatenate([off, residual[:, None]], axis=1)
    nu = MISFIT_DEGREES_OF_FREEDOM
    power = (nu + 1) / 2
    squared = (off / max(deviation, MIN_DEVIATION_METRES)) ** 2
    each = power * (digamma(power) - digamma(nu / 2)) - power * np.log1p(squared / nu)
    return np.asarray(np.nan_to_num(each).sum(axis=1))


def softmax(score: Array, frame: NDArray[np.intp]) -> Array:
    """Return probabilities (N,) proportional to the exponential of scores (N,); they sum to one over each frame.

    `frame` (N,) is the index of the frame of each score. If all scores of a frame are minus infinity, its probabilities
    are equal.
    """
    if not len(score):
        return np.empty(0)
    highest = np.full(int(frame.max()) + 1, -np.inf)
    np.maximum.at(highest, frame, score)
    least = np.where(np.isfinite(highest), highest, 0.0)[frame]
    weight = np.exp(np.where(np.isfinite(highest)[frame], score - least, 0.0))
    return np.asarray(weight / np.bincount(frame, weight, len(highest))[frame])
