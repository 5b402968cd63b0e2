"""Numbers of mesh files: finite as the float32 that native readers make of them, and indices within bounds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.safe_io.refusal import cut, one_line, refusal

MAX_TRIANGLES: Final = 500_000
"""Faces of one mesh: a tree of boxes over so many takes seconds; published robots have at most 350,000."""
MAX_POLYGON: Final = 1000
"""Corners of one face: to triangulate it takes the square of their number."""
LARGEST: Final = 1e6
"""Coordinates beyond this, in whatever unit, describe no body part; 1e39 is infinite as float32."""


def finite_numbers(path: Path, field: str, words: Sequence[bytes] | Sequence[str]) -> NDArray[np.float64]:
    """Read words as numbers, each finite and at most 1e6 in size."""
    try:
        numbers: NDArray[np.float64] = np.array(words, dtype=np.float64)
    except (ValueError, OverflowError) as error:
        raise refusal(path, field, cut(one_line(str(error))), "numbers", "export the mesh again") from None
    check_finite(path, field, numbers)
    return numbers


def check_finite(path: Path, field: str, numbers: NDArray[Any]) -> None:
    """Refuse numbers that are not finite, or too large for any body."""
    wrong = ~(np.abs(numbers) <= LARGEST)
    if wrong.any():
        first = float(numbers.reshape(-1)[int(np.argmax(wrong.reshape(-1)))])
        expected = f"finite numbers, at most {LARGEST:,.0f} in size"
        raise refusal(path, field, f"{first:g}", expected, "export the mesh again")


def whole_numbers(path: Path, field: str, words: Sequence[bytes] | Sequence[str]) -> NDArray[np.int64]:
    """Read words as whole numbers."""
    try:
        return np.array(words, dtype=np.int64)
    except (ValueError, OverflowError) as error:
        raise refusal(
            path, field, cut(one_line(str(error))), "whole numbers", "export the mesh again"
        ) from None
