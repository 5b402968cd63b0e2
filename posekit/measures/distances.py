"""Mean and root-mean-square distances between corresponding points, as they are or after alignment."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.measures.alignment import align
from posekit.measures.pairs import paired

Aligned = Literal["similarity", "rigid", "none"]


class Distance(NamedTuple):
    """Distances of N postures from their targets.

    Attributes
    ----------
    value : array (...)
        In the points' unit; NaN where no point is known in both, or nothing could be aligned.
    left_out : int array (...)
        How many points were left out, for being NaN in either.
    """

    value: Array
    left_out: NDArray[np.int64]


def rms_distance(points: ArrayLike, target: ArrayLike, *, aligned: Aligned = "similarity") -> Distance:
    r"""Return the root mean square distance between corresponding points, :math:`\sqrt{\sum_p d_p^2 / P}`.

    After "the rotation, translation and scale factor that best aligned the two data sets" (Taylor 2000, §3.2).

    Parameters
    ----------
    points, target : array (..., P, 3)
        What is measured, and what is true, in one unit; NaN where a point is not known.
    aligned : {"similarity", "rigid", "none"}
        How `points` are laid onto `target` first. The similarity is measured in the target's scale, so exchanging the
        two changes it; the other two are symmetric.

    Raises
    ------
    InputError
        Where the shapes do not go together, a coordinate is infinite, or `aligned` is another word.
    """
    squared, left_out = _squared(points, target, aligned)
    return Distance(np.sqrt(_mean(squared)), left_out)


def mpjpe(points: ArrayLike, target: ArrayLike, *, root: int | None = None) -> Distance:
    r"""Return the mean per-joint position error, :math:`\sum_p d_p / P` (Ionescu et al. 2014, §5.1).

    Parameters
    ----------
    points, target : array (..., P, 3)
        What is measured, and what is true, in one unit; NaN where a point is not known.
    root : int, optional
        The point that both are moved to before; without it, postures are compared where they are.

    Raises
    ------
    InputError
        Where the shapes do not go together, a coordinate is infinite, or there is no such root.
    """
    if root is not None:
        points, target, _ = paired(points, target)
        if isinstance(root, bool) or not 0 <= root < points.shape[-2]:
            raise InputError(f"root is {root!r}; expected the index of one of {points.shape[-2]} points")
        points, target = (each - each[..., [root], :] for each in (points, target))
    squared, left_out = _squared(points, target, "none")
    return Distance(_mean(np.sqrt(squared)), left_out)


def pa_mpjpe(points: ArrayLike, target: ArrayLike) -> Distance:
    """Return the mean per-joint position error after the similarity of `posekit.measures.align`.

    The similarity minimises squares, so that this is at most the RMS distance after alignment, and that at most the
    one before; it is not always less than `mpjpe`.

    Parameters
    ----------
    points, target : array (..., P, 3)
        What is measured, and what is true, in one unit; NaN where a point is not known.

    Raises
    ------
    InputError
        Where the shapes do not go together, or a coordinate is infinite.
    """
    squared, left_out = _squared(points, target, "similarity")
    return Distance(_mean(np.sqrt(squared)), left_out)


def _squared(points: ArrayLike, target: ArrayLike, aligned: Aligned) -> tuple[Array, NDArray[np.int64]]:
    """Return squared distances (..., P), NaN where left out, and how many were."""
    if aligned not in ("similarity", "rigid", "none"):
        raise InputError(f"aligned is {aligned!r}; expected similarity, rigid or none")
    x, y, known = paired(points, target)
    if aligned != "none":
        x = align(x, y, scale=aligned == "similarity").apply(x)
    squared = np.where(known, ((x - y) ** 2).sum(axis=-1), np.nan)
    return squared, np.asarray(known.shape[-1] - known.sum(axis=-1))


def _mean(values: Array) -> Array:
    """Return the mean over the last axis of what is known; NaN where nothing is."""
    known = ~np.isnan(values)
    count = known.sum(axis=-1)
    total = np.where(known, values, 0.0).sum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
