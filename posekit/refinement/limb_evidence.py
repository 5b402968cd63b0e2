r"""What an image says of the lengths of a limb's two segments, its directions left open.

A segment that makes the angle :math:`\varphi` with the plane at a right angle to its ray is seen at
:math:`\rho = l \cos\varphi` beside it. Where in that plane it points the image shows; :math:`\varphi` it does not.
With a density p of directions d the likelihood of a length is

.. math:: p(\rho \mid l) \propto \int p(d(\varphi)) \cos\varphi\; N(\rho - l \cos\varphi; \sigma)\, d\varphi ,

for isotropic directions :math:`x / \sqrt{1 - x^2}`, smeared by the noise, with its pole at the full length. A likeliest
posture says nothing of that: any length that is long enough explains one image as well. The density is that of upper
and lower segment together in the torso's frame, so that knees and elbows bend as they do; where the lower one starts
depends on which way the upper one leans.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from posekit.compiled import evidence_kernels
from posekit.compiled.compiling import compiled, is_installed
from posekit.geometry import Array, dot

N_ANGLES: Final = 41
"""Angles at which directions are looked at."""

_ANGLES: Final = (np.arange(N_ANGLES) - N_ANGLES // 2) * (np.pi / N_ANGLES)
_STEP: Final = np.pi / N_ANGLES
_COSINE, _SINE = np.cos(_ANGLES), np.sin(_ANGLES)

OUTLIER_DENSITY: Final = 0.02
"""Density, one over metres, of points that have nothing to do with the segment: one in fifty to a hundred of them."""


class DirectionDensity(NamedTuple):
    """How segments point in the torso's frame: Student's t of the components of their unit vectors, three each.

    Attributes
    ----------
    mean : array (d,)
        The middle of the distribution.
    whitening : array (d, d)
        W with W' W the inverse of the scale.
    dof : float
        Degrees of freedom.
    """

    mean: Array
    whitening: Array
    dof: float

    def log(self, squared: Array) -> Array:
        """Return the log-density, but for a constant, at squared whitened distances from the mean."""
        return np.asarray(-(self.dof + len(self.mean)) / 2 * np.log1p(squared / self.dof))

    def log_of(self, vectors: Array) -> Array:
        """Return it at components (d, N)."""
        return self.log(((self.whitening @ (vectors - self.mean[:, None])) ** 2).sum(axis=0))

    def log_of_pairs(self, first: Array, second: Array) -> Array:
        """Return it at every pair (N, K, K) of K first and K second directions (N, K, 3) of two."""
        W = self.whitening
        one, other = first @ W[:, :3].T - W @ self.mean, second @ W[:, 3:].T
        squared = (one**2).sum(axis=2)[:, :, None] + (other**2).sum(axis=2)[:, None, :]
        return self.log(squared + 2 * one @ other.transpose(0, 2, 1))


NEGLIGIBLE_LOG: Final = 8.0
"""Logarithm by which a pair of angles is less likely than the best that is not looked at."""

LEAST_LOG: Final = -700.0
"""Logarithm that stands for nothing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LimbEvidence:
    """One limb on N trunks.

    Parameters
    ----------
    depth : array (N,)
        Of its start, metres.
    upper, lower : array (N,)
        How far beside the start's (the middle's) ray the middle (the end) is seen, for each metre of depth; NaN where
        one of them is not seen.
    blur : array (2, N)
        Their standard deviations.
    forward : array (N,)
        The depth that a metre along the middle's ray is.
    prior : array (N, K, K)
        Log-density of directions, by the angles of upper and lower segment.
    """

    depth: Array
    upper: Array
    lower: Array
    blur: Array
    forward: Array
    prior: Array

    @staticmethod
    def of(
        rays: Array, deviation: Array, depth: Array, torso: Array, directions: DirectionDensity
    ) -> LimbEvidence:
        """Look at the rays (3, 3, N) of start, middle and end, NaN where not seen, known to `deviation` (3, N) radians.

        Parameters
        ----------
        depth : array (N,)
            Of the start, metres.
        torso : array (3, 3, N)
            Rotations from the torso's frame into the camera's.
        """
        beside, seen, tables = [], [], []
        for start, end in ((rays[0], rays[1]), (rays[1], rays[2])):
            at = start / start[2]
            across = dot(end, at, axis=-2) * end - at
            far = np.sqrt(dot(across, across, axis=-2))
            beside.append(far)
            seen.append(np.isfinite(far))
            u, ray = (np.einsum("ijn,in->nj", torso, np.where(seen[-1], v, 0.0)) for v in (across / far, end))
            tables.append(_COSINE[:, None] * u[:, None] + _SINE[:, None] * ray[:, None])
        return LimbEvidence(
            depth=depth,
            upper=beside[0],
            lower=np.where(seen[0], beside[1], np.nan),
            blur=np.hypot(deviation[:2], deviation[1:]),
            forward=np.where(seen[0], rays[1][2], 1.0),
            prior=directions.log_of_pairs(*tables),
        )

    def of_upper(self, lengths: Array) -> Array:
        """Return log-likelihoods (N, K, G) of G lengths of the upper segment, at each of its angles."""
        seen, blur = (self.upper * self.depth)[:, None, None], (self.blur[0] * self.depth)[:, None, None]
        bell = _bell(seen, lengths * _COSINE[:, None], blur, lengths * _SINE[:, None])
        found = np.log(_COSINE[:, None] * self.depth[:, None, None] * (bell + OUTLIER_DENSITY))
        return np.asarray(np.where(np.isnan(seen), np.log(_COSINE)[:, None], found))

    def of_lower(self, upper: Array, lengths: Array, best: float) -> Array:
        """Return log-likelihoods (N, K, G) of G lengths of the lower segment, at each angle of the upper one.

        The density of directions is in them.

        Parameters
        ----------
        upper : array (N, K)
            The upper segment's log-likelihood at its best length of those that will be asked for: pairs of angles that
            are far from likely with any are left out.
        lengths : array (G,)
            Metres.
        best : float
            The length of the upper segment, metres: it says where the lower one starts.
        """
        depth = self.depth[:, None] + best * _SINE * self.forward[:, None]
        seen, blur = self.lower[:, None] * depth, self.blur[1][:, None] * depth
        # The least that a length of these would be off.
        short = np.maximum(lengths.min() * _COSINE - seen[:, :, None], 0.0)
        long = np.maximum(seen[:, :, None] - lengths.max() * _COSINE, 0.0)
        off = (short + long) ** 2 / (blur[:, :, None] ** 2 + (lengths.max() * _SINE * _STEP) ** 2 / 12)
        likely = upper[:, :, None] + self.prior - 0.5 * np.nan_to_num(off)
        least = likely.max(axis=(1, 2)) - NEGLIGIBLE_LOG
        if is_installed():
            return self.looped(likely, least, (seen, blur, depth), lengths)
        return self.summed(likely, least, (seen, blur, depth), lengths)

    def looped(self, likely: Array, least: Array, found: tuple[Array, Array, Array], lengths: Array) -> Array:
        """Add up over the lower segment's angles by a compiled loop, its end found (seen, blur and depth)."""
        out = np.full((*likely.shape[:2], len(lengths)), LEAST_LOG)
        spread = np.abs(_SINE) * _STEP / np.sqrt(12)
        arrays = likely, self.prior, *found, _COSINE, spread, lengths, least
        compiled(evidence_kernels).weigh_lower(*map(np.ascontiguousarray, arrays), OUTLIER_DENSITY, out)
        return out

    def summed(self, likely: Array, least: Array, found: tuple[Array, Array, Array], lengths: Array) -> Array:
        """Do the same with all pairs at once."""
        (seen, blur, depth), known = found, np.isfinite(self.lower)
        n, i, j = np.nonzero(likely > least[:, None, None])
        most = self.prior.max(axis=(1, 2))
        weight = np.exp(self.prior[n, i, j] - most[n]) * _COSINE[j]
        bell = _bell(
            seen[n, i][:, None],
            lengths * _COSINE[j][:, None],
            blur[n, i][:, None],
            lengths * _SINE[j][:, None],
        )
        bell = np.where(known[n][:, None], (bell + OUTLIER_DENSITY) * depth[n, i][:, None], 1.0)
        row = n * N_ANGLES + i
        first = np.flatnonzero(np.diff(row, prepend=-1))
        out = np.full((len(known) * N_ANGLES, len(lengths)), LEAST_LOG)
        out[row[first]] = (
            np.log(np.add.reduceat(weight[:, None] * bell, first, axis=0)) + most[n[first]][:, None]
        )
        return out.reshape(len(known), N_ANGLES, len(lengths))


def _bell(seen: Array, expected: Array, blur: Array, turning: Array) -> Array:
    """Return the normal density of what is seen; an angle stands for those around it: their difference is noise."""
    # Six digits are enough of a likelihood, and take a third of the time.
    variance = np.asarray(blur * blur + (turning * _STEP) ** 2 / 12, dtype=np.float32)
    off = np.asarray(seen - expected, dtype=np.float32)
    return np.asarray(np.exp(-0.5 * off * off / variance) / np.sqrt(2 * np.pi * variance), dtype=np.float64)
