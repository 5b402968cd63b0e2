"""One answer a frame: the expected posture, how sure it is, and the few postures that stand for the rest."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, dot, unit
from posekit.skeleton import PARENTS, SEGMENTS, TREE_SEGMENTS

#: Distance in every joint up to which a posture is the person's, and one posture stands for another, metres.
WITHIN_METRES: Final = 0.05

#: Probability that representatives stand for together.
REPRESENTED: Final = 0.95

#: Samples of each mode: `sure` is then known to 0.06 where one mode holds everything, better where several do.
N_SAMPLES: Final = 64

#: Probability of a mode below which its spread is not sampled.
NEGLIGIBLE: Final = 1e-4

#: Postures of a frame that are compared each with each; of more, the likeliest stand for the rest.
MAX_COMPARED: Final = 600

#: Pairs of joints that are compared at once: the products stay in the processor's cache.
COMPARED_AT_ONCE: Final = 50_000

#: Degrees of freedom of the distribution within a mode, t, as of other misfits: a few lengths are far off, spines bend.
TAIL_DEGREES_OF_FREEDOM: Final = 4

#: Its scale over the deviation: the 97.5 % quantiles of the normal and of that t distribution, so that the radius that
#: holds 95 % is the same.
TAIL_SCALE: Final = 1.960 / 2.776


def _tailed_draws() -> Array:
    """Draw t distributed numbers, the same for every mode; with their opposites, so that means are exact."""
    rng = np.random.default_rng(1985)
    normal = rng.normal(size=(N_SAMPLES // 2, 42))
    spread = np.sqrt(TAIL_DEGREES_OF_FREEDOM / rng.chisquare(TAIL_DEGREES_OF_FREEDOM, len(normal)))
    draws = TAIL_SCALE * spread[:, None] * normal
    return np.concatenate([draws, -draws])


DRAWS: Final = _tailed_draws()

#: Variance (square metres, and relative to the trace) added to every covariance: a given neck has none, and rounding
#: may leave a little less.
ROUNDING: Final = 1e-8

#: 95 % quantile of the standard normal distribution.
NORMAL_95: Final = 1.6449

#: Distance from the lengths at which laying a posture onto them ends, metres.
SAME_METRES: Final = 1e-7


class FrameAnswer(NamedTuple):
    """The answer of one frame; rows are those of its survivors. See `posekit.recovery.Answer`."""

    joints: Array
    sure: float
    survivor: int
    representatives: NDArray[np.intp]
    represented: Array
    nearer: NDArray[np.intp]
    nearer_sure: Array


def answer_of(
    joints: Array,
    probability: Array,
    covariance: Array | None,
    lengths: Array,
    *,
    relative: bool = False,
    unlisted: float = 0.0,
) -> FrameAnswer:
    r"""Make the answer of one frame.

    Under noise the joints of the answer are the probability-weighted mean of the modes, laid onto the
    lengths. `sure` is :math:`\sum_m p_m P(\max_j |X_j - a_j| < 5 cm \mid X \sim t_4(\mu_m, \Sigma_m))`,
    by samples.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Survivors, metres, camera frame; NaN where a joint is not known.
    probability : array (N,)
        They sum to one minus `unlisted`.
    covariance : array (N, 42, 42), optional
        Of the joints of each, square metres; None for exact postures.
    lengths : array (17,)
        Segment lengths, in the order of `posekit.skeleton.SEGMENTS`, metres.
    relative : bool
        Measure distances relative to the neck: its depth is not known.
    unlisted : float
        Probability of postures that are not listed.
    """
    weight = probability / probability.sum()
    base = joints[:, :1] if relative else np.zeros((len(joints), 1, 3))
    shape = joints - base
    rows, held = representatives(shape, weight, min(REPRESENTED / max(1.0 - unlisted, REPRESENTED), 1.0))
    draws = _draws(shape, covariance, weight, relative)
    if covariance is None:
        # Between exact postures there is none: the answer is the one that stands for the most probability.
        survivor, laid, sure = int(rows[0]), shape[rows[0]], float(held[0])
    else:
        mean = np.einsum("n,njk->jk", weight, shape)
        laid = lay(mean[None], lengths[None])[0]
        inside = ~(np.linalg.norm(draws - laid, axis=3) > WITHIN_METRES).any(axis=2)  # NaN is not beyond
        sure = float(weight @ inside.mean(axis=1))
        survivor = int(np.nan_to_num(np.linalg.norm(shape - laid, axis=2)).mean(axis=1).argmin())
    nearer, nearer_sure = _nearer(draws, weight, unlisted)
    place = laid + (np.einsum("n,njk->jk", weight, base) if relative else 0.0)
    listed = 1.0 - unlisted
    return FrameAnswer(place, sure * listed, survivor, rows, held * listed, nearer, nearer_sure)


def lay(joints: Array, lengths: Array) -> Array:
    r"""Move postures (F, 14, 3) to the nearest ones with given segment lengths (F, 17).

    Newton's steps for :math:`\min |x - x_0|^2` subject to :math:`|x_a - x_b|^2 = l^2`. Postures in which a segment has
    no direction are laid joint by joint, outward from the neck. Segments with an unknown end are left out.
    """
    a, b = np.array(SEGMENTS).T
    x, known = np.nan_to_num(joints), np.isfinite(joints[:, :, 0])
    use = known[:, a] & known[:, b]
    J = np.zeros((len(x), len(SEGMENTS), *x.shape[1:]))
    rows = np.arange(len(SEGMENTS))
    for _ in range(30):
        apart = np.where(use[..., None], x[:, b] - x[:, a], 0.0)
        gap = np.where(use, 0.5 * ((apart**2).sum(axis=2) - lengths**2), 0.0)
        if np.abs(gap).max(initial=0.0) < SAME_METRES * 0.1:
            break
        J[:, rows, b], J[:, rows, a] = apart, -apart
        flat = J.reshape(len(x), len(SEGMENTS), -1)
        # A small damping keeps triangles that lie in a plane solvable.
        normal = flat @ flat.transpose(0, 2, 1) + 1e-9 * np.eye(len(SEGMENTS))
        step = np.einsum("fsk,fs->fk", flat, np.linalg.solve(normal, gap[..., None])[..., 0]).reshape(x.shape)
        x = x - step * np.minimum(1.0, 0.1 / np.maximum(np.abs(step).max(axis=(1, 2)), 1e-12))[:, None, None]
    off = np.where(use, np.abs(np.linalg.norm(x[:, b] - x[:, a], axis=2) - lengths), 0.0).max(
        axis=1, initial=0.0
    )
    for k in np.flatnonzero(off > 1e-4).tolist():
        x[k] = np.nan_to_num(joints[k])
        for index, (start, end) in enumerate(TREE_SEGMENTS):
            direction = unit(np.nan_to_num(joints[k, end] - joints[k, start]) + 1e-12)
            x[k, end] = x[k, start] + lengths[k, index] * direction
    return np.where(known[..., None], x, np.nan)


def representatives(shape: Array, weight: Array, hold: float) -> tuple[NDArray[np.intp], Array]:
    """Choose few postures (N, 14, 3): what is within 5 cm of them in every joint has a given probability.

    The posture that newly stands for the most probability comes first.

    Returns
    -------
    rows : int array (K,)
        Representatives.
    held : array (K,)
        Probability of each and of what it stands for.
    """
    order = np.argsort(-weight, kind="stable")[:MAX_COMPARED]
    # |a - b|^2 = |a|^2 + |b|^2 - 2 a.b, counted from the likeliest; an unknown joint is far from none.
    place = (shape[order] - shape[order[:1]]).transpose(1, 0, 2)
    place = np.where(np.isnan(place), 0.0, place)
    square = dot(place, place)
    within = (square - WITHIN_METRES**2) / 2
    near = np.ones((len(order), len(order)), dtype=np.bool_)
    step = 1 + COMPARED_AT_ONCE // near.size
    for at in range(0, len(place), step):
        one = place[at : at + step]
        reach = within[at : at + step, :, None] + square[at : at + step, None] / 2
        near &= (one @ one.swapaxes(1, 2) >= reach).all(axis=0)
    left, stands = weight[order], near.astype(np.float64)
    rows: list[int] = []
    held: list[float] = []
    total = 0.0
    while total < hold - 1e-9:
        gain = stands @ left
        best = gain.argmax()  # of equal ones the likeliest
        if not gain[best] > 0:
            break
        rows.append(int(order[best]))
        held.append(float(gain[best]))
        total += held[-1]
        left[near[best]] = 0.0
    by_share = np.argsort(-np.array(held), kind="stable")
    return np.array(rows, dtype=np.intp)[by_share], np.array(held)[by_share]


def joint_radius(covariance: Array) -> Array:
    r"""Return the radius that holds a joint with 95 % probability, of covariances (..., 3, 3), metres.

    The squared distance is a weighted sum of three chi-square variables; a gamma distribution with its mean and
    variance stands for it (Satterthwaite 1946), by the cube root that is nearly normal (Wilson & Hilferty 1931).
    """
    mean = np.einsum("...ii->...", covariance)
    variance = 2 * np.einsum("...ij,...ij->...", covariance, covariance)
    known = mean > 0
    mean, variance = np.where(known, mean, 1.0), np.where(known, variance, 1.0)
    shape = mean**2 / variance
    root = 1.0 - 1.0 / (9.0 * shape) + NORMAL_95 / (3.0 * np.sqrt(shape))
    return np.where(known, np.sqrt(mean * root**3), 0.0)


def _draws(shape: Array, covariance: Array | None, weight: Array, relative: bool) -> Array:
    """Draw postures (N, S, 14, 3) of each mode, relative to the neck if asked."""
    if covariance is None:
        return shape[:, None]
    found = np.repeat(shape[:, None], N_SAMPLES, axis=1)
    rows = np.flatnonzero(weight > NEGLIGIBLE)
    some = (covariance[rows] + covariance[rows].transpose(0, 2, 1)) / 2
    floor = ROUNDING * (1.0 + np.einsum("nii->n", some))
    root = np.linalg.cholesky(some + floor[:, None, None] * np.eye(some.shape[1]))
    off = (DRAWS @ root.transpose(0, 2, 1)).reshape(len(rows), N_SAMPLES, shape.shape[1], 3)
    found[rows] += off - off[:, :, :1] if relative else off
    return found


def _nearer(draws: Array, weight: Array, unlisted: float) -> tuple[NDArray[np.intp], Array]:
    """Return for each segment whether its outer end is nearer (1), farther (-1) or neither, and how sure that is."""
    depth = draws[..., 2]
    gap = depth[..., 1:] - depth[..., PARENTS[1:]]
    near, far = weight @ np.stack([gap < -WITHIN_METRES, gap > WITHIN_METRES]).mean(axis=2)
    each = np.stack([1.0 - near - far, near, far])
    best = each.argmax(axis=0)
    known = np.isfinite(gap).any(axis=(0, 1))
    sure = np.where(known, each.max(axis=0) * (1.0 - unlisted), np.nan)
    return np.where(known, np.array([0, 1, -1])[best], 0), sure
