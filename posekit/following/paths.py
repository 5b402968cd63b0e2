"""Most probable paths of one person through the frames of a sequence. A path has at most one survivor per frame.

A Kalman filter predicts position and velocity of the joints on each path. The cost of a path is minus its
log-likelihood, plus penalties for skipped frames and unknown joints. A path is extended by every survivor of the next
frame, and once by skipping that frame. If at most 64 paths have a cost near the lowest cost, all of them are kept.
Otherwise, only the cheapest paths to each survivor are kept, as in Viterbi's algorithm (Forney 1973, Proceedings of the
IEEE 61:268-278). Each kept path has its own filter (Raheli, Polydoros & Tzou 1995, IEEE Transactions on Communications
43:354-364). The forward-backward algorithm gives the probability of each survivor given all frames (Rabiner 1989,
Proceedings of the IEEE 77:257-286, eqs. 18 to 27).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import digamma, logsumexp

from posekit.body import lay
from posekit.errors import refusal
from posekit.following.kalman import DENSITY, Moving, smooth
from posekit.geometry import Array, unit
from posekit.progress import watched
from posekit.recovery.recovery import Paths, Recovery
from posekit.skeleton import SEGMENT_NAMES

#: Speeds that no joint exceeds, m/s. The trunk of the fastest sprinter passes 20 m at 12.1 m/s (Čoh et al. 2018,
#: Kinesiology 50:172); the fastest balls leave hand and foot at 47 and 37 m/s, which is faster than wrists and ankles
#: move.
MAX_SPEED: Final = np.array([15.0] * 6 + [25.0, 25.0, 35.0, 35.0, 25.0, 25.0, 35.0, 35.0])

#: Degrees of freedom of the t distribution of steps: a sudden move is improbable, not impossible.
NU: Final = 4.0

#: Weight of steps to survivors under noise: errors are correlated between the joints of a body and between frames.
NOISY_WEIGHT: Final = 0.25

#: Cost of skipping a frame, in addition to the cost of a usual step.
SKIP: Final = 100.0

#: Cost of each unknown joint of a survivor that another survivor of the frame has, because unknown joints have no cost
#: of a step.
MISSING_JOINT: Final = 5.0

#: Tolerance of `MAX_SPEED`, in standard deviations of both positions.
WALL_DEVIATIONS: Final = 3.0

#: Total probability, and largest number, of the survivors considered in a frame; largest number of separate paths;
#: largest cost, relative to the cheapest end, of an end that is kept.
COVERAGE, MAX_SURVIVORS, WIDTH, SLACK = 0.95, 128, 64, 60.0

#: Two paths are different if a joint differs by more than this in some frame, metres.
APART_METRES: Final = 0.25

#: Least probability of a further path in the frame where it differs most.
LEAST_SHARE: Final = 1e-6

#: Interval between frames that defines the cost of a usual step, seconds.
USUAL_INTERVAL: Final = 1 / 30

#: Ratio of a joint's 95 % radius to its standard deviation along the ray, which dominates.
RADIUS_DEVIATIONS: Final = 1.96

#: Ratio of a joint's standard deviation across its ray to that along it: 2 px at 4 m are 8 mm across, and 4 cm in
#: depth.
ACROSS: Final = 0.2


class Candidates(NamedTuple):
    """The survivors of one frame, each of which may extend a path.

    Attributes
    ----------
    time : float
        Seconds.
    joints : array (N, 14, 3)
        Metres; NaN where a joint is not known.
    covariance : array (N, 14, 3, 3)
        Square metres.
    cost : array (N,)
        Minus the logarithm of each probability.
    """

    time: float
    joints: Array
    covariance: Array
    cost: Array

    def at(self, survivor: NDArray[np.intp]) -> tuple[Array, Array]:
        """Return joints and covariances of survivors (S,); the index -1 skips the frame and has unknown joints."""
        joints = np.concatenate([self.joints, np.full((1, *self.joints.shape[1:]), np.nan)])
        covariance = np.concatenate([self.covariance, np.zeros((1, *self.covariance.shape[1:]))])
        return joints[survivor], covariance[survivor]


class Stage(NamedTuple):
    """The S ends of all paths in one frame, and the steps to them from the P ends in the previous frame.

    Attributes
    ----------
    survivor : int array (S,)
        Survivor at each end; -1 if the frame is skipped.
    cost : array (P, S)
        Cost of each step plus the cost of the survivor that it leads to; infinite if the step is impossible.
    forward : array (S,)
        Logarithm of the sum of the likelihoods of all paths that lead to each end, up to a constant.
    """

    survivor: NDArray[np.intp]
    cost: Array
    forward: Array


class Trellis:
    """All paths through the frames that `push` has added.

    Attributes
    ----------
    stages : list of Stage
    cheapest : array (S,)
        Cost of the cheapest path to each end.
    """

    def __init__(self) -> None:
        self.stages: list[Stage] = []
        self.ends = Moving.nothing(1)
        self.cheapest, self.forward = np.zeros(1), np.zeros(1)
        self._last = np.nan

    def push(self, frame: Candidates) -> None:
        """Extend all paths by one frame."""
        known = np.asarray(np.isfinite(frame.joints).all(axis=2))
        own = frame.cost + MISSING_JOINT * (known.any(axis=0) & ~known).sum(axis=1)
        chosen = _likeliest(np.where(known.any(axis=1), own, np.inf))
        joints, covariance, own = frame.joints[chosen], frame.covariance[chosen], own[chosen]
        seconds = 1.0 if np.isnan(self._last) else frame.time - self._last
        self._last = frame.time
        weight = NOISY_WEIGHT if covariance.any() else 1.0
        led = self.ends.after(seconds)
        ways = weight * step_costs(self.ends, led, joints, covariance) + own
        skip = SKIP
        if len(own):
            skip += weight * _usual_step(covariance[own.argmin()], known[chosen][own.argmin()])
        total = self.cheapest[:, None] + np.concatenate([ways, np.full((len(led.mean), 1), skip)], axis=1)
        parent, target, into = _kept(total)
        near = total <= total.min() + SLACK
        step = np.full((len(total), len(parent)), np.inf)
        rows, columns = np.nonzero(near)
        np.minimum.at(step, (rows, into[rows, columns]), (total - self.cheapest[:, None])[rows, columns])
        self.cheapest = total[parent, target]
        forward = logsumexp(self.forward[:, None] - step, axis=0)
        self.forward = forward - forward.max()
        survivor = np.append(chosen, -1)[target]
        self.ends = led.take(parent).given(*frame.at(survivor))
        self.stages.append(Stage(survivor, step, self.forward))

    def marginals(self, at: int = -1, among: NDArray[np.bool_] | None = None) -> list[Array]:
        """Return the probability of every end (S,) of each frame, given all frames.

        Parameters
        ----------
        at : int
            A frame.
        among : bool array (S,), optional
            Whether paths may pass through each end of this frame; by default all ends are allowed.
        """
        forward = [stage.forward for stage in self.stages]
        if among is not None:
            forward = [*forward[:at], np.where(among, forward[at], -np.inf)]
            for stage in self.stages[at + 1 :]:
                forward.append(logsumexp(forward[-1][:, None] - stage.cost, axis=0))
        backward, found = np.zeros(len(forward[-1])), []
        for k in range(len(self.stages) - 1, -1, -1):
            if among is not None and k == at:
                backward = np.where(among, backward, -np.inf)
            both = forward[k] + backward
            found.append(np.exp(both - logsumexp(both)))
            backward = logsumexp(backward - self.stages[k].cost, axis=1)
            backward -= backward.max()
        return found[::-1]


def step_costs(ends: Moving, led: Moving, joints: Array, covariance: Array) -> Array:
    r"""Return the costs (S, N) of steps from S path ends to N survivors; infinite if faster than `MAX_SPEED`.

    The cost of a step is minus the log-likelihood of the joints' offsets x from their predicted positions, under a
    Student t distribution (Lange, Little & Taylor 1989, JASA 84:881-896):

    .. math:: \sum_j \tfrac{\nu + 3}{2} \log\left(1 + \tfrac{1}{\nu} x_j^T S_j^{-1} x_j\right)
              + \tfrac12 \log\frac{|S_j|}{\sigma_j^6}, \qquad S_j = P_j + R_j,

    Here :math:`\nu` is `NU`, P is the filter's covariance of the predicted position, and R is the covariance of the
    survivor's joint. Random acceleration adds the variance :math:`\sigma_j^2` to P. A joint at its predicted position
    costs nothing if its previous position was exact.

    Parameters
    ----------
    ends, led : Moving
        State at the last frame, and the state predicted for this frame.
    joints, covariance : array (N, 14, 3), (N, 14, 3, 3)
    """
    known = np.isfinite(joints).all(axis=2)
    both = ends.known[:, None] & known
    x = np.where(both[..., None], np.nan_to_num(joints) - led.mean[:, None, :, :3], 0.0)
    S = led.spread[:, None, :, :3, :3] + covariance
    a, d, f = S[..., 0, 0], S[..., 1, 1], S[..., 2, 2]
    b, c, e = S[..., 0, 1], S[..., 0, 2], S[..., 1, 2]
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    size = a * A + b * B + c * C
    X, Y, Z = x[..., 0], x[..., 1], x[..., 2]
    own = A * X * X + (a * f - c * c) * Y * Y + (a * d - b * b) * Z * Z
    mixed = B * X * Y + C * X * Z + (b * c - a * e) * Y * Z
    distance = (own + 2 * mixed) / size
    scale = DENSITY * np.where(ends.known, led.since, 1.0) ** 3 / 3
    wide = np.log(np.maximum(size / scale[:, None] ** 3, 1.0))
    cost = np.where(both, (NU + 3) / 2 * np.log1p(distance / NU) + 0.5 * wide, 0.0).sum(axis=2)
    moved = np.linalg.norm(np.nan_to_num(joints) - ends.mean[:, None, :, :3], axis=3)
    traces = [np.sqrt(np.trace(one, axis1=-2, axis2=-1)) for one in (ends.spread[..., :3, :3], covariance)]
    reach = (MAX_SPEED * led.since)[:, None] + WALL_DEVIATIONS * (traces[0][:, None] + traces[1])
    return np.where((both & (moved > reach * (1 + 1e-12) + 1e-12)).any(axis=2), np.inf, cost)


def follow(recovery: Recovery, *, paths: int = 2) -> Recovery:
    """Follow the person through the frames of a recovery.

    The first path consists of the expected posture of each frame, given all frames. The path is smoothed, and each
    posture is moved to the nearest posture with the person's segment lengths. Each further path passes through the most
    probable survivor that has a joint more than 25 cm from all earlier paths. In an uncalibrated view, positions are
    relative to the neck.

    Parameters
    ----------
    recovery : Recovery
    paths : int
        Number of paths; fewer are returned if fewer exist.

    Returns
    -------
    Recovery
        A copy of the recovery with the paths as `path`.

    Raises
    ------
    InputError
        If no frame has a survivor, or times do not ascend.

    Examples
    --------
    >>> import posekit
    >>> from posekit.following.paths import follow
    >>> follow(posekit.recover(posekit.builtin_view("seq1"))).path.survivor.shape
    (2, 5)
    """
    time = np.asarray(recovery.frames.time)
    if not len(recovery.survivors):
        raise refusal(recovery.source, "follow", "no frame with a posture", "at least one")
    if (np.diff(time) <= 1e-6).any():
        raise refusal(recovery.source, "time", "times that do not ascend", "one picture for each time")
    frames = [candidates(recovery, k) for k in range(len(recovery))]
    trellis = Trellis()
    for frame in watched(frames, "following"):
        trellis.push(frame)
    ends = [stage.survivor for stage in trellis.stages]
    marginals = trellis.marginals()
    lengths = np.array([recovery.lengths[name] for name in SEGMENT_NAMES])
    found, odds = [_expected(frames, ends, marginals, lengths)], [1.0]
    while len(found) < paths:
        other = _elsewhere(frames, ends, marginals, [one[1] for one in found])
        if other is None:
            break
        found.append(_expected(frames, ends, trellis.marginals(*other[:2]), lengths))
        odds.append(other[2])
    order = np.argsort(-np.array(odds), kind="stable")
    local = np.stack([found[k][0] for k in order])
    rows = np.where(local < 0, -1, local + np.array([recovery.rows(k).start for k in range(len(frames))]))
    share = np.array(odds)[order]
    joints = np.stack([found[k][2] for k in order])
    return replace(recovery, path=Paths(survivor=rows, probability=share / share.sum(), joints=joints))


def candidates(recovery: Recovery, k: int) -> Candidates:
    """Return the survivors of frame k as `Candidates`, with covariances that are largest along the rays."""
    rows = recovery.rows(k)
    table = recovery.survivors
    joints, radius = table.joints[rows], np.asarray(table.radius)[rows]
    ray = unit(joints)
    if np.isfinite(np.asarray(table.scale)[rows]).any():  # a scaled orthographic camera
        joints = joints - joints[:, :1]
        ray = np.broadcast_to([0.0, 0.0, 1.0], joints.shape)
    along = np.nan_to_num(ray[..., :, None] * ray[..., None, :])
    deviation = radius / RADIUS_DEVIATIONS
    covariance = deviation[..., None, None] ** 2 * (along + ACROSS**2 * (np.eye(3) - along))
    with np.errstate(divide="ignore"):
        cost = -np.log(np.asarray(table.probability)[rows])
    return Candidates(float(recovery.frames.time[k]), joints, covariance, np.maximum(cost, 0.0))


def expected_posture(frame: Candidates, at: NDArray[np.intp], share: Array) -> tuple[int, Array, Array]:
    """Return the survivor nearest to the expected posture, the expected posture, and its covariance.

    The expected posture is the mean of all survivors, weighted by their probabilities given all frames; it has the
    least expected squared error. Its covariance is the mean covariance of the survivors plus the covariance of their
    positions about the mean. If the survivors are exact, the nearest survivor is returned instead of the mean. If the
    frame is skipped with a probability of at least one half, the survivor is -1 and the posture NaN.
    """
    rows = np.flatnonzero(at >= 0)
    weight, at = share[rows], at[rows]
    if not weight.sum() > 0.5:
        return -1, np.full(frame.joints.shape[1:], np.nan), np.zeros((*frame.joints.shape[1:], 3))
    joints = frame.joints[at]
    known = np.asarray(np.isfinite(joints).all(axis=2))
    each = weight[:, None] * known
    with np.errstate(invalid="ignore", divide="ignore"):
        each = each / each.sum(axis=0)
    mean = np.einsum("nj,njc->jc", each, np.nan_to_num(joints))
    one = int(np.nansum((joints - mean) ** 2, axis=(1, 2)).argmin())
    if not frame.covariance[at].any():
        return int(at[one]), joints[one], np.zeros((*mean.shape, 3))
    off = np.where(known[..., None], joints - mean, 0.0)
    spread = np.einsum("nj,njcd->jcd", each, frame.covariance[at]) + np.einsum(
        "nj,njc,njd->jcd", each, off, off
    )
    return int(at[one]), mean, np.nan_to_num(spread)


def _likeliest(own: Array) -> NDArray[np.intp]:
    """Choose the most probable survivors, up to a total probability of `COVERAGE`; at most `MAX_SURVIVORS`."""
    order = np.argsort(own, kind="stable")
    order = order[np.isfinite(own[order])]
    if not len(order):
        return order
    held = np.cumsum(np.exp(own[order[0]] - own[order]))
    last = min(int(np.searchsorted(held, COVERAGE * held[-1])), len(order) - 1)
    enough = int(np.searchsorted(own[order], own[order[last]] + 1e-9, side="right"))
    return np.sort(order[: min(enough, MAX_SURVIVORS)])


def _kept(total: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Choose the steps to keep by the total costs (S, N + 1) of the paths that they extend."""
    near = total <= total.min() + SLACK
    most = max(1, WIDTH // total.shape[1]) if near.sum() > WIDTH else len(total)
    masked = np.where(near, total, np.inf)
    order = np.argsort(masked, axis=0, kind="stable")[:most]
    target, place = np.nonzero(np.isfinite(np.take_along_axis(masked, order, axis=0)).T)
    parent = order[place, target]
    first = np.minimum(np.searchsorted(target, np.arange(total.shape[1])), len(target) - 1)
    into = np.tile(first, (len(total), 1))
    into[parent, target] = np.arange(len(parent))
    return parent, target, into


def _usual_step(covariance: Array, known: NDArray[np.bool_]) -> float:
    """Return the average cost of a step between two survivors that have the covariance (14, 3, 3)."""
    scale = DENSITY * USUAL_INTERVAL**3 / 3
    # For exact points, the variance of a predicted position is about twice the variance that acceleration adds.
    wide = np.log(np.linalg.det(2.0 * (np.eye(3) + covariance / scale[:, None, None])))
    typical = (NU + 3) / 2 * float(digamma((NU + 3) / 2) - digamma(NU / 2))
    return float((typical + 0.5 * wide)[known].sum())


def _expected(
    frames: Sequence[Candidates], ends: Sequence[NDArray[np.intp]], marginals: Sequence[Array], lengths: Array
) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the survivors (T,), their joints and the smoothed joints (T, 14, 3) of one path."""
    each = [expected_posture(*one) for one in zip(frames, ends, marginals, strict=True)]
    survivor = np.array([one[0] for one in each], dtype=np.intp)
    time = np.array([frame.time for frame in frames])
    own = np.concatenate([frame.at(survivor[[k]])[0] for k, frame in enumerate(frames)])
    given, covariance = np.stack([one[1] for one in each]), np.stack([one[2] for one in each])
    joints = smooth(time, given, covariance)
    if covariance.any():
        joints = lay(joints, np.broadcast_to(lengths, (len(time), len(lengths))))
    else:
        joints = np.where(np.isnan(given), joints, given)
    return survivor, own, joints


def _elsewhere(
    frames: Sequence[Candidates],
    ends: Sequence[NDArray[np.intp]],
    marginals: Sequence[Array],
    found: Sequence[Array],
) -> tuple[int, NDArray[np.bool_], float] | None:
    """Find the most probable survivors of one frame that are far from all paths in `found`."""
    best, at = LEAST_SHARE, -1
    places: list[Array] = []
    away: list[NDArray[np.bool_]] = []
    for k, (frame, chosen, share) in enumerate(zip(frames, ends, marginals, strict=True)):
        places.append(frame.at(chosen)[0])
        away.append(np.all([_apart(places[k], path[k]) > APART_METRES for path in found], axis=0))
        most = float(share[away[k]].max(initial=0.0))
        best, at = (most, k) if most > best else (best, at)
    if at < 0:
        return None
    share, joints = marginals[at], places[at]
    one = int(np.argmax(np.where(away[at], share, -1.0)))
    among = away[at] & (_apart(joints, joints[one]) <= APART_METRES)
    near = _apart(joints, found[0][at]) <= APART_METRES
    odds = float(share[among].sum() / max(float(share[near].sum()), LEAST_SHARE))
    return at, among, min(odds, 1.0)


def _apart(joints: Array, other: Array) -> Array:
    """Return the largest distance (N,) of a joint between each posture and another posture."""
    return np.asarray(np.fmax.reduce(np.linalg.norm(joints - other, axis=-1), axis=1, initial=0.0))
