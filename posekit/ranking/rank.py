"""The probability of each survivor: its fit to the picture times how usual such a posture is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, Record, dot, read_only, unit
from posekit.ranking.directions import directions, log_room
from posekit.ranking.prior import Prior, digamma, load_prior
from posekit.ranking.standing import standing
from posekit.skeleton import RIGID_SEGMENTS

#: Standard deviation of the tilt of a camera that is assumed to be level.
LEVEL_WITHIN_DEGREES: Final = 20.0

#: Degrees of freedom of a misfit's t distribution: torsos give now and then by more than they mostly do.
MISFIT_DEGREES_OF_FREEDOM: Final = 4.0

#: Least deviation of a distance inside torso and hips: a real torso is not more rigid (CMU motion capture).
MIN_DEVIATION_METRES: Final = 0.006

#: Tolerance of rigid distances over the deviation of the survivors, as the weights were fitted.
PER_TOLERANCE: Final = 2.2

#: Distances from ankles to centre of mass, and between ankles: a wrong `up` moves one beside the other by as much.
CENTRE_OF_MASS_HEIGHT_METRES, STANCE_WIDTH_METRES = 0.9, 0.4


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Up(Record):
    """The direction against gravity.

    Parameters
    ----------
    direction : array (3,)
        Unit vector in the frame of the postures (x right, y down, z forward). A level camera by default.
    deviation : float
        Its standard deviation, degrees.
    source : str
        Its origin, as a result states it.
    """

    direction: Array
    deviation: float = 0.0
    source: str = "known"

    def __post_init__(self) -> None:
        self._set("direction", read_only(unit(np.asarray(self.direction, dtype=np.float64))))

    @staticmethod
    def level() -> Up:
        """Assume that the camera is held level: up is against the image's y."""
        source = f"assumed: a level camera, within {LEVEL_WITHIN_DEGREES:g} degrees"
        return Up(direction=np.array([0.0, -1.0, 0.0]), deviation=LEVEL_WITHIN_DEGREES, source=source)


def deviation_of_tolerance(rigid: float) -> float:
    """Return the deviation (m) of survivors of a tree that allowed rigid distances to differ by `rigid` metres."""
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
    """Return the weighted log terms (N,) of postures, by name; their sum is the log of an unnormalised probability.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Camera frame, metres; NaN where a joint is not known.
    deviation : float
        Deviation of the joints of exact postures, metres.
    chi2 : array (N,), optional
        Misfit of modes under noise. Without it the four rigid distances are judged.
    log_volume : array (N,), optional
        Half the log determinant of the covariance of each mode: the volume of the postures that it stands for.
    lengths : array (17,), optional
        Segment lengths in the order of `posekit.skeleton.SEGMENTS`, metres, for exact postures.
    length_residual : array (N,), optional
        Shortfall of the worst segment against its image, metres.
    up : Up, optional
        Without it gravity, balance and contact say nothing.
    prior : Prior, optional
        The built-in one by default.

    Notes
    -----
    The terms are ``image``, ``posture`` (directions of segments in the torso's frame), ``gravity`` (up given the
    posture), ``balance`` (centre of mass over the feet), ``contact`` (feet on one level) and ``foreshortening``. Each
    but chi2 is counted from its average over true postures, so that an unknown one is neither for nor against.
    """
    prior = prior or load_prior()
    # NumPy's loops then run along the postures, not along x, y, z.
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
    """Return the log-density (N,) of the rigid distances and of the shortfall, above its average."""
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
    """Return probabilities (N,) in proportion to the exponential of scores, within each frame (N,) from 0.

    If all scores of a frame are minus infinity its members are equally probable.
    """
    if not len(score):
        return np.empty(0)
    highest = np.full(int(frame.max()) + 1, -np.inf)
    np.maximum.at(highest, frame, score)
    least = np.where(np.isfinite(highest), highest, 0.0)[frame]
    weight = np.exp(np.where(np.isfinite(highest)[frame], score - least, 0.0))
    return np.asarray(weight / np.bincount(frame, weight, len(highest))[frame])


def rank(
    joints: Array, frame: NDArray[np.intp], terms: Mapping[str, Array] | None = None, **evidence: object
) -> Array:
    r"""Give every posture a probability within its frame.

    .. math:: p_i = e^{\sum_t w_t f_t(i)} / \sum_j e^{\sum_t w_t f_t(j)}

    Parameters
    ----------
    joints : array (N, 14, 3)
        Camera frame, metres.
    frame : int array (N,)
        Frame of each.
    terms : mapping of str to array (N,), optional
        Further log terms.
    **evidence
        Parameters of `log_terms`.

    Returns
    -------
    array (N,)
        They sum to one over a frame.
    """
    found = {**log_terms(joints, **evidence), **(terms or {})}  # type: ignore[arg-type]
    return softmax(np.sum(list(found.values()), axis=0), frame)
