r"""One body for all frames: the lengths that explain them together, and how well they are known then.

Trunks are drawn in each frame (`trunk_evidence`), limbs hang on them in all directions (`limb_evidence`); a frame's
likelihood is the sum over both, so that no frame has to decide how it is turned, nor which end of a segment is nearer.
The body is a normal distribution of the logarithms of its 17 lengths. Trunks change it by their slope and curvature;
each limb segment by the moments of its likelihood, on a grid, times what is known of it without that (expectation
propagation: Minka 2001), for a likelihood that ends at the longest image is no parabola. Both are repeated with the
body that was found, which is first wide, so that wrong starts are left.

A body of size :math:`e^s` looks the same :math:`e^s` times as far away. Where nothing tells how far the necks are, the
size stays what it was: the start's lengths on average, and as uncertain as they were.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.body import LengthUncertainty
from posekit.body.uncertainty import MEASURED_LENGTHS
from posekit.errors import PosekitError
from posekit.geometry import Array
from posekit.refinement.inputs import EXACT_DISTANCE_DEVIATION
from posekit.refinement.limb_evidence import DirectionDensity, LimbEvidence
from posekit.refinement.observed_frames import ObservedFrames
from posekit.refinement.trunk_evidence import TRUNK_NAMES, TrunkEvidence
from posekit.refinement.trunks import Trunks
from posekit.skeleton import LIMB_JOINTS, SEGMENT_NAMES, other_side, segment_name

SIDE_ASYMMETRY: Final = 0.02
"""Standard deviation of the logarithm of one side's length over the other's.

Sides of bones differ by 1 % or less in most people (Auerbach & Ruff 2006, J. Human Evolution 50:203: medians of length
0.1 to 1.3 %); joints as they are tracked by as much again.
"""

LENGTH_GRID: Final = np.sinh(3.0 * np.linspace(-1.0, 1.0, 17)) / np.sinh(3.0)
"""Lengths of a limb segment that are tried, as shares of the widest: denser where it is."""

GRID_WIDTHS: Final = (0.25, 0.2, 0.15, 0.15)
"""The widest, logarithms; one a round."""

SEARCHED_ROUNDS: Final = 2
"""Rounds in which trunks are searched; then the body hardly moves, and those that were found are followed."""

MAX_STEP: Final = 0.05
"""The most that a logarithm is changed in a round."""

LIMB_FRAME_SHARE: Final = 0.1
"""As how much of a frame each counts for limbs: neighbours in a clip show nearly the same posture, and what people do
is not what the density of directions says."""

TRUNK_FRAME_SHARE: Final = 0.1
"""The same for trunks, which bend as their shapes do not."""

LEAST_PRECISION: Final = 1e-3
"""Precision of a segment of which the frames say nothing."""

MOST_DEVIATION: Final = 0.3
"""What a deviation counts at most."""

_TRUNK: Final = [SEGMENT_NAMES.index(name) for name in TRUNK_NAMES]
_LIMBS: Final = [
    [SEGMENT_NAMES.index(segment_name((limb[k], limb[k + 1]))) for k in range(2)] for limb in LIMB_JOINTS
]


class PostureDirections(NamedTuple):
    """What is known of postures before they are seen.

    Attributes
    ----------
    limbs : tuple of 4 DirectionDensity
        Of upper and lower segment of right arm, left arm, right leg, left leg.
    trunk : DirectionDensity
        Of the hips' left and down and of the camera's up.
    """

    limbs: tuple[DirectionDensity, ...]
    trunk: DirectionDensity


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyEstimate:
    """One body.

    Parameters
    ----------
    lengths : mapping
        Metres, by segment name.
    covariance : array (17, 17)
        Of their logarithms, beside the size where that was not told.
    sized : bool
        Whether the size was told, by necks whose depth is known.
    frames : int
        Frames that it was found from.
    """

    lengths: Mapping[str, float]
    covariance: Array
    sized: bool
    frames: int

    @cached_property
    def uncertainty(self) -> LengthUncertainty:
        """The deviations: of the size, the mean of the logarithms weighted by how well each is known, and beside it.

        A size that was not told has none here: it is as uncertain as it was.
        """
        weight = 1 / np.diag(self.covariance)
        of_size = np.tile(weight / weight.sum(), (len(weight), 1))
        beside = np.eye(len(weight)) - of_size
        own = np.sqrt(np.einsum("ij,jk,ik->i", beside, self.covariance, beside))
        common = float(np.sqrt(of_size[0] @ self.covariance @ of_size[0])) if self.sized else 0.0
        own = np.minimum(own, MOST_DEVIATION)
        return LengthUncertainty(common=common, own=dict(zip(SEGMENT_NAMES, own.tolist(), strict=True)))


def find_body(
    observed: ObservedFrames,
    known: LengthUncertainty,
    directions: PostureDirections,
    *,
    sized: bool,
    stands_for: float = 1.0,
) -> BodyEstimate:
    """Find the body that explains frames of one person.

    Parameters
    ----------
    observed : ObservedFrames
        The frames, with the figure to start from; its root says where necks are, however roughly.
    known : LengthUncertainty
        How far that figure's lengths may be off.
    directions : PostureDirections
        What is known of postures.
    sized : bool
        Whether the root's depths are known from elsewhere than the lengths.
    stands_for : float
        For how many frames each counts, where some were left out.
    """
    figure = observed.figure
    start = np.log([figure.lengths[name] for name in SEGMENT_NAMES])
    own = np.maximum([known.own[name] for name in SEGMENT_NAMES], EXACT_DISTANCE_DEVIATION)
    prior = np.linalg.inv(np.diag(own**2) + (known.common**2 if sized else 0.0))
    pull = prior @ start
    prior = prior + _sides_alike()
    x, covariance = np.linalg.solve(prior, pull), np.linalg.inv(prior)
    sites = np.zeros((len(SEGMENT_NAMES), 2))
    frames, trunks = 0, None
    for number, width in enumerate(GRID_WIDTHS):
        x = x if sized else _in_size(x, start, own)
        try:
            figure = figure.scaled(dict(zip(SEGMENT_NAMES, np.exp(x).tolist(), strict=True)))
        except PosekitError:
            break
        x = np.log([figure.lengths[name] for name in SEGMENT_NAMES])
        deviation = np.sqrt(np.diag(covariance))
        seen = replace(observed, figure=figure)
        round_ = _Round.of(seen, deviation, directions, number, np.exp(x), width, trunks)
        frames = round_.count
        trunks = round_.evidence.found if number + 1 >= SEARCHED_ROUNDS else None
        if not frames:
            break
        for segment, values in round_.limbs(x, width, stands_for):
            cavity = max(1 / covariance[segment, segment] - sites[segment, 0], LEAST_PRECISION)
            middle = (x[segment] / covariance[segment, segment] - sites[segment, 1]) / cavity
            sites[segment] = _site(values, x[segment] + width * LENGTH_GRID, cavity, middle)
        slope, curvature = (stands_for * each for each in round_.trunk())
        precision = prior + np.diag(sites[:, 0])
        right = pull + sites[:, 1]
        precision[np.ix_(_TRUNK, _TRUNK)] += curvature
        right[_TRUNK] += curvature @ x[_TRUNK] + slope
        covariance = np.linalg.inv(precision)
        x = x + np.clip(covariance @ right - x, -MAX_STEP, MAX_STEP)
    x = x if sized else _in_size(x, start, own)
    figure = figure.scaled(dict(zip(SEGMENT_NAMES, np.exp(x).tolist(), strict=True)))
    return BodyEstimate(
        lengths=figure.lengths,
        covariance=np.asarray(covariance, dtype=np.float64),
        sized=sized,
        frames=frames,
    )


def _sides_alike() -> Array:
    """Return the precision (17, 17) of left and right being alike."""
    out = np.zeros((len(SEGMENT_NAMES), len(SEGMENT_NAMES)))
    for one, name in enumerate(SEGMENT_NAMES):
        mirrored = "-".join(map(other_side, name.split("-")))
        if mirrored in SEGMENT_NAMES and mirrored != name:
            apart = np.zeros(len(SEGMENT_NAMES))
            apart[one], apart[SEGMENT_NAMES.index(mirrored)] = 1.0, -1.0
            out += np.outer(apart, apart) / (2 * SIDE_ASYMMETRY**2)  # each pair comes twice
    return out


def _in_size(x: Array, start: Array, own: Array) -> Array:
    """Return lengths of the size that those of the start have on average, the better known ones counting more."""
    return np.asarray(x - np.average(x - start, weights=own**-2.0))


def _site(values: Array, grid: Array, cavity: float, middle: float) -> Array:
    """Return precision, and precision times mean, that turn a cavity into the moments of the likelihood on it (2,)."""
    logarithm = values - 0.5 * cavity * (grid - middle) ** 2
    weight = np.exp(logarithm - logarithm.max()) * np.gradient(grid)
    weight /= weight.sum()
    mean = float(weight @ grid)
    variance = float(weight @ (grid - mean) ** 2) + float(weight @ np.gradient(grid) ** 2) / 12
    precision = max(1 / variance - cavity, LEAST_PRECISION)
    return np.array([precision, mean * (precision + cavity) - middle * cavity])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Round:
    """The frames with a body.

    Parameters
    ----------
    evidence : TrunkEvidence
    deviation : array (9,)
        Of the trunk's distances.
    upper, lower : list of 4 arrays (N, K, G)
        Log-likelihoods of each limb's segments on the grid.
    each : array (4, N)
        Log-likelihood of each limb on each trunk, at the body's lengths.
    """

    evidence: TrunkEvidence
    deviation: Array
    upper: list[Array]
    lower: list[Array]
    each: Array

    @staticmethod
    def of(
        observed: ObservedFrames,
        deviation: Array,
        directions: PostureDirections,
        number: int,
        lengths: Array,
        width: float,
        trunks: Trunks | None = None,
    ) -> _Round:
        """Look at the frames with the figure's lengths; `deviation` (17,) is how far they may be off."""
        varied = {
            name: float(np.hypot(one, MEASURED_LENGTHS.own[name]))
            for name, one in zip(SEGMENT_NAMES, deviation.tolist(), strict=True)
        }
        observed = replace(observed, length_deviation=varied, size_deviation=0.0)
        of_trunk = np.maximum([varied[name] for name in TRUNK_NAMES], EXACT_DISTANCE_DEVIATION)
        evidence = TrunkEvidence.of(observed, of_trunk, np.random.default_rng(number), trunks)
        vectors = [np.einsum("cin,cn->in", evidence.torso, one) for one in _parts(evidence)]
        evidence = evidence.weighted(directions.trunk.log_of(np.concatenate(vectors)))
        upper, lower = [], []
        for limb, density in zip(range(4), directions.limbs, strict=True):
            found = _limb(observed, evidence, limb, density)
            one, two = (lengths[segment] * np.exp(width * LENGTH_GRID) for segment in _LIMBS[limb])
            upper.append(found.of_upper(one))
            lower.append(found.of_lower(upper[-1].max(axis=2), two, float(lengths[_LIMBS[limb][0]])))
        middle = len(LENGTH_GRID) // 2
        each = [_summed(a[:, :, middle] + b[:, :, middle]) for a, b in zip(upper, lower, strict=True)]
        return _Round(
            evidence=evidence, deviation=of_trunk, upper=upper, lower=lower, each=np.reshape(each, (4, -1))
        )

    @property
    def count(self) -> int:
        """How many frames have a trunk."""
        return len(set(self.evidence.frame.tolist()))

    @cached_property
    def total(self) -> Array:
        """The log-likelihood of each trunk with its limbs (N,)."""
        return np.asarray(self.evidence.log_weight + self.each.sum(axis=0))

    def limbs(self, x: Array, width: float, stands_for: float) -> list[tuple[int, Array]]:
        """Return for each limb segment its place in the body, and log-likelihoods (G,) of lengths on the grid."""
        middle = len(LENGTH_GRID) // 2
        out = []
        for limb, (first, second) in enumerate(_LIMBS):
            upper, lower = self.upper[limb], self.lower[limb]
            rest = (self.total - self.each[limb])[:, None]
            for segment, found in (
                (first, upper + lower[:, :, middle, None]),
                (second, lower + upper[:, :, middle, None]),
            ):
                by_trunk = rest + _summed(found)
                out.append((segment, stands_for * LIMB_FRAME_SHARE * self._by_frame(by_trunk).sum(axis=0)))
        return out

    def trunk(self) -> tuple[Array, Array]:
        """Return the slope (9,) and the curvature (9, 9) of the trunk's log-likelihood, along logarithms."""
        frame = self.evidence.frame
        _, of = np.unique(frame, return_inverse=True)
        share = (
            np.exp(self.total - self._by_frame(self.total[:, None])[of.reshape(-1), 0]) * TRUNK_FRAME_SHARE
        )
        slope = share @ self.evidence.stretch / self.deviation**2
        return slope, np.einsum("n,nij->ij", share, self.evidence.information)

    def _by_frame(self, values: Array) -> Array:
        """Add likelihoods (N, G), of which logarithms are given, frame by frame; the frames ascend."""
        _, of = np.unique(self.evidence.frame, return_inverse=True)
        of = of.reshape(-1)
        most = np.full((int(of.max()) + 1, values.shape[1]), -np.inf)
        np.maximum.at(most, of, values)
        total = np.zeros_like(most)
        np.add.at(total, of, np.exp(values - most[of]))
        return np.asarray(most + np.log(total))


def _parts(evidence: TrunkEvidence) -> list[Array]:
    """Return the hips' left and down and the camera's up (3, N), camera frame."""
    up = np.zeros_like(evidence.hips[:, 1])
    up[1] = -1.0
    return [evidence.hips[:, 1], -evidence.hips[:, 2], up]


def _limb(
    observed: ObservedFrames, evidence: TrunkEvidence, limb: int, density: DirectionDensity
) -> LimbEvidence:
    """Look at one limb on the trunks."""
    joints = list(LIMB_JOINTS[limb])
    problem = observed.problem(evidence.frame, evidence.joints[0].T)
    start = evidence.joints[joints[0]]
    weight, focal = problem.weight[joints], np.sqrt(problem.optics.focal[0] * problem.optics.focal[2])
    seen: NDArray[np.bool_] = weight > 0
    rays = problem.optics.rays(problem.image[joints], np.stack([start] * 3))[0]
    rays = np.where(seen[:, None], rays, np.nan)
    # A start that is not seen is where the trunk has it.
    rays[0] = np.where(seen[0], rays[0], start / np.sqrt((start**2).sum(axis=0)))
    deviation = np.where(seen, 1 / np.where(seen, weight, 1.0), UNSEEN_PIXELS) / focal
    return LimbEvidence.of(rays, deviation, start[2], evidence.torso, density)


UNSEEN_PIXELS: Final = 15.0
"""Pixels by which a start that was not seen may be off where the trunk has it."""


def _summed(logarithms: Array) -> Array:
    """Add likelihoods of which logarithms (N, K, ...) are given over the second axis."""
    most = logarithms.max(axis=1, keepdims=True)
    # Six digits are enough of a likelihood, and take a third of the time.
    shares = np.exp((logarithms - most).astype(np.float32))
    return np.asarray(most[:, 0] + np.log(shares.sum(axis=1, dtype=np.float64)))
