"""How large a body is, when only its proportions were varied: what the depth of a known root tells.

A body of size e^s with its root at R looks as one of the figure's size does with its root at e^-s R. So refinement
keeps the figure's size, its root is free along its ray by as much as the size is, and what comes out is scaled about
the camera's centre until the root is where it is known to be.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.refinement.prior import RootPrior


class BodySize(NamedTuple):
    """How much larger than the figure N bodies are.

    Attributes
    ----------
    factor : array (N,)
        By which postures of the figure's size were scaled about the camera's centre.
    deviation : array (N,)
        Standard deviation of its logarithm, beside what the root's depth tells.
    gain : array (N, 3)
        How the factor's logarithm falls when the root, of a body of the figure's size, moves, one over metres.
    """

    factor: Array
    deviation: Array
    gain: Array

    def take(self, rows: NDArray[np.intp]) -> BodySize:
        """Return some bodies."""
        return BodySize(*(array[rows] for array in self))


def size_of(necks: Array, prior: RootPrior, frames: NDArray[np.intp], deviation: float) -> BodySize:
    r"""Estimate how much larger than the figure bodies are.

    With the neck at the distance z, known to be at :math:`\mu` up to :math:`\sigma_\mu` along its ray, and the size's
    :math:`\sigma_s`, the product of two normal densities has

    .. math::

       s = \frac{\sigma_s^2}{\sigma_s^2 + \sigma_\mu^2 / \mu^2} \ln\frac{\mu}{z}, \qquad
       \operatorname{var} s = \frac{\sigma_s^2\, \sigma_\mu^2 / \mu^2}{\sigma_s^2 + \sigma_\mu^2 / \mu^2} .

    A root that was found by the figure's size, or not at all, tells nothing of it.

    Parameters
    ----------
    necks : array (N, 3)
        Of bodies of the figure's size, camera frame, metres.
    prior : RootPrior
        Where roots are known to be, by frame.
    frames : int array (N,)
        The frame of each body.
    deviation : float
        Standard deviation of the size's logarithm.
    """
    mean = prior.mean[frames]
    far, z = np.linalg.norm(mean, axis=1), np.linalg.norm(necks, axis=1)
    known = np.isfinite(far) & ~prior.by_size[frames]
    mean, far = np.where(known[:, None], mean, necks), np.where(known, far, z)
    ray = mean / far[:, None]
    relative = np.einsum("ni,nij,nj->n", ray, np.nan_to_num(prior.covariance[frames]), ray) / far**2
    share = np.where(known, deviation**2 / np.maximum(deviation**2 + relative, np.finfo(float).tiny), 0.0)
    return BodySize(
        factor=np.exp(share * np.log(far / z)),
        deviation=np.sqrt(np.where(known, share * relative, deviation**2)),
        gain=share[:, None] * necks / z[:, None] ** 2,
    )
