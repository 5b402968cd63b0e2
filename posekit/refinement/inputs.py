"""Checking what refinement is given, and laying it out with the batch as the last axis."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.refinement.figure_numbers import TRUNK_SEGMENTS
from posekit.refinement.prior import RootPrior
from posekit.skeleton import LIMB_JOINTS, SEGMENT_NAMES, segment_name

MIN_DEVIATION_PIXELS = 1e-9
"""Pixels: the least standard deviation of a key point."""

EXACT_LENGTH_DEVIATION = 1e-5
"""Relative deviation of a limb's length that is known exactly, where others are not."""

EXACT_DISTANCE_DEVIATION = 1e-3
"""The same for a distance of torso or hips, which are varied together: stiffer, and every step would be tiny."""


def numbers(name: str, given: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """Return an array of a shape, None for any size; NaN is what is not known, infinity is refused."""
    array = np.asarray(given, dtype=np.float64)
    fits = array.ndim == len(shape) and all(
        want in (None, have) for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("N" if size is None else str(size) for size in shape)
        raise InputError(f"{name} has shape {array.shape}; expected ({wanted})")
    if np.isinf(array).any():
        raise InputError(f"{name} has infinite entries; expected numbers, NaN for what is not known")
    return array


def frames_of(frame: ArrayLike | None, survivors: int, count: int) -> NDArray[np.intp]:
    """Return the frame of each survivor."""
    if frame is None:
        if survivors != count:
            raise InputError(
                f"{survivors} survivors and {count} frames of image points; say by `frame` which is whose"
            )
        return np.arange(count)
    frames = np.asarray(frame)
    if frames.shape != (survivors,) or frames.dtype.kind not in "iu":
        raise InputError(
            f"frame has shape {frames.shape} of {frames.dtype}; expected ({survivors},) whole numbers"
        )
    if survivors and not (0 <= int(frames.min()) and int(frames.max()) < count):
        raise InputError(f"frame runs from {frames.min()} to {frames.max()}; expected 0 to {count - 1}")
    return frames.astype(np.intp)


def weights(name: str, deviation: ArrayLike, points: Array) -> Array:
    """Return one over the standard deviations (F, P); zero where a point was not seen."""
    given = np.asarray(deviation, dtype=np.float64)
    try:
        given = np.broadcast_to(given, points.shape[:2])
    except ValueError:
        raise InputError(f"{name} has shape {given.shape}; expected a number or {points.shape[:2]}") from None
    seen = np.isfinite(points).all(axis=2)
    if not (given[seen] >= MIN_DEVIATION_PIXELS).all():
        raise InputError(
            f"{name} is {float(given[seen].min()):g} pixels where a point was seen; expected "
            f"{MIN_DEVIATION_PIXELS:g} or more, and infinity for a point not to be used"
        )
    return np.where(seen, 1.0 / np.where(seen, given, 1.0), 0.0)


def length_weights(deviation: Mapping[str, float] | float) -> tuple[Array | None, Array | None]:
    """Return one over the relative deviations of the trunk's nine distances (9,) and of the limbs' lengths (4, 2).

    None where all of them are held.
    """
    if isinstance(deviation, Mapping):
        unknown = [name for name in deviation if name not in SEGMENT_NAMES]
        if unknown:
            raise InputError(
                f"length_deviation: {unknown[0]!r} is not a segment; expected some of {', '.join(SEGMENT_NAMES)}"
            )
        by_name = {name: float(deviation.get(name, 0.0)) for name in SEGMENT_NAMES}
    else:
        by_name = dict.fromkeys(SEGMENT_NAMES, float(deviation))
    for name, value in by_name.items():
        if not 0 <= value < 1:
            raise InputError(
                f"length_deviation: {name} is {value!r}; expected a fraction of the length, zero or more and below one"
            )
    trunk = np.array([by_name[segment_name(pair)] for pair in TRUNK_SEGMENTS])
    limbs = np.array(
        [
            [by_name[segment_name(pair)] for pair in ((limb[0], limb[1]), (limb[1], limb[2]))]
            for limb in LIMB_JOINTS
        ]
    )
    # Where some lengths vary all are unknowns: those that are exact get a small deviation, so that steps stay finite.
    return (
        1.0 / np.maximum(trunk, EXACT_DISTANCE_DEVIATION) if trunk.any() else None,
        1.0 / np.maximum(limbs, EXACT_LENGTH_DEVIATION) if limbs.any() else None,
    )


def root_of(root: RootPrior | None, count: int) -> tuple[Array, Array]:
    """Return the root's mean (F, 3), NaN where it is not known, and its whitening (F, 3, 3)."""
    if root is None:
        return np.full((count, 3), np.nan), np.zeros((count, 3, 3))
    if len(root.mean) != count:
        raise InputError(f"the root's prior has {len(root.mean)} frames; expected {count}")
    return root.mean, root.whitening()


def batch_last(array: Array) -> Array:
    """Move the batch from the first axis to the last."""
    return np.ascontiguousarray(np.moveaxis(array, 0, -1))
