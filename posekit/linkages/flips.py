"""Flip assignments as numbers: only of the segments that matter, and without those that are mirror images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array

Codes = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class FlipCodes:
    """The assignments of signs to k segments, numbered from 0.

    Constraints that share no segment do not know of each other's flips. Within such a *block* turning all signs round
    mirrors the posture in depth and changes no residual: one sign of each block is held, unless the block has signs
    that were given by hand.

    Parameters
    ----------
    base : array (k,)
        The signs of code 0.
    free : tuple of int
        The segments whose sign is a bit of the code, the first the lowest.
    masks : tuple of int (k,)
        What turning one segment round does to a code: one bit, or all others of its block where it is held; 0 where it
        was given by hand.
    """

    base: Array
    free: tuple[int, ...]
    masks: tuple[int, ...]

    @property
    def n(self) -> int:
        """How many assignments there are."""
        return 1 << len(self.free)

    def signs(self, codes: Codes) -> Array:
        """Return the signs (len(codes), k) of some codes."""
        signs = np.tile(self.base, (len(codes), 1))
        for bit, segment in enumerate(self.free):
            signs[:, segment] = 1.0 - 2.0 * ((codes >> bit) & 1)
        return signs

    def regardless(self, codes: Codes, segments: Sequence[int]) -> Codes:
        """Return for each code the least of those that differ from it only in the flips of some segments."""
        pivots: dict[int, int] = {}  # highest bit to mask, each mask reduced by those before it
        for segment in segments:
            mask = self.masks[segment]
            for bit in sorted(pivots, reverse=True):
                mask = min(mask, mask ^ pivots[bit])
            if mask:
                pivots[mask.bit_length() - 1] = mask
        least = codes.copy()
        for bit in sorted(pivots, reverse=True):
            least = np.minimum(least, least ^ pivots[bit])
        return least


def number_flips(
    k: int, blocks: Sequence[Sequence[int]], given: Array, avoid: NDArray[np.bool_]
) -> FlipCodes:
    """Give each choice of flips of k segments a number.

    Parameters
    ----------
    k : int
        How many segments there are.
    blocks : sequence of sequence of int
        Which of them share constraints.
    given : array (k,)
        Signs given by hand; 0 where none was.
    avoid : bool array (k,)
        Segments whose sign is better not held: those that set the bound.
    """
    base = np.where(given == 0, 1.0, given)
    free = [segment for segment in range(k) if given[segment] == 0]
    held: dict[int, Sequence[int]] = {}
    for block in blocks:
        if all(given[segment] == 0 for segment in block):
            anchor = next((segment for segment in block if not avoid[segment]), block[0])
            free.remove(anchor)
            held[anchor] = [segment for segment in block if segment != anchor]
    bit = {segment: 1 << place for place, segment in enumerate(free)}
    masks = [
        sum(bit[other] for other in held[segment]) if segment in held else bit.get(segment, 0)
        for segment in range(k)
    ]
    return FlipCodes(base=base, free=tuple(free), masks=tuple(masks))
