"""Numbers of a page as binary text: a hundredth of the time, and a third of the size, that JSON would take."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array

UNKNOWN_STEP: Final = -32_768
"""What stands for a coordinate that is not known."""

LARGEST_STEP: Final = 32_767

FINEST_STEP_METRES: Final = 1e-4
"""Metres: a step is 0.1 mm, or what the largest frame needs so that it fits into 16 bits."""

MOST_BRANCH_BITS: Final = 15
"""Choices of near and far that fit into 16 bits, behind a one that says how many there are."""


def packed(values: NDArray[Any]) -> dict[str, str]:
    """Pack an array, little-endian; NaN stays NaN.

    Parameters
    ----------
    values : array
        Of any shape; the page knows it.
    """
    one = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    return {"type": values.dtype.name, "base64": b64encode(one.tobytes()).decode("ascii")}


def origins(bodies: Sequence[Array]) -> tuple[list[Array], float]:
    """Find from where the points of each frame are counted, and how wide a step is, metres.

    Parameters
    ----------
    bodies : sequence of array (..., 3)
        All points of each frame, metres; NaN where unknown.
    """
    found, widest = [], 0.0
    for points in bodies:
        known = points.reshape(-1, 3)
        known = known[np.isfinite(known).all(axis=1)]
        if not len(known):
            found.append(np.zeros(3))
            continue
        low, high = known.min(axis=0), known.max(axis=0)
        found.append((low + high) / 2)
        widest = max(widest, float((high - low).max()) / 2)
    return found, max(FINEST_STEP_METRES, widest / LARGEST_STEP)


def steps(points: Array, origin: Array, step: float) -> NDArray[np.int16]:
    """Return points (..., 3) as whole steps from an origin (3,).

    Parameters
    ----------
    points : array (..., 3)
        Metres; NaN where unknown.
    origin : array (3,)
        Metres.
    step : float
        Metres.
    """
    counted = np.clip(np.rint((points - origin) / step), -LARGEST_STEP, LARGEST_STEP)
    unknown = ~np.isfinite(points).all(axis=-1, keepdims=True)
    return np.where(unknown, UNKNOWN_STEP, np.nan_to_num(counted)).astype(np.int16)


def branch_bits(branches: Sequence[str]) -> NDArray[np.uint16]:
    """Return choices of near (0) and far (1) as numbers: a one, then a bit each; 0 where they are no such choices."""
    return np.array(
        [
            int("1" + text, 2) if len(text) <= MOST_BRANCH_BITS and set(text) <= {"0", "1"} else 0
            for text in branches
        ],
        dtype=np.uint16,
    )
