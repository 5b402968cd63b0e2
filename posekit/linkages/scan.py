"""Sampling the residual over the scale for all flips, to find where its local minima are.

Two ways give the same brackets: any constraints, sampled flip by flip; and the closure of one loop, whose gap is a
plain sum over its segments, so that sums over the two halves of the loop make those over all flips.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.linkages.constraints import Constraints
from posekit.linkages.flips import Codes

CHUNK_RESIDUALS = 1 << 20
"""Residuals that are evaluated at once."""

ZERO_RESIDUAL = 1e-23
"""A residual that is nowhere above it is zero but for rounding.

It is weighed by the squared sine and cosine of the angle: near the bound what rounding leaves of a foreshortening grows
as one over the sine, and far from it points on a line of sight hardly tell their plane.
"""

N_SUBCELLS = 16
"""Into how many cells one is cut in which a minimum may be hidden."""


class Brackets(NamedTuple):
    """Cells of the grid that hold a local minimum each.

    Attributes
    ----------
    code : int array (M,)
        Whose curve.
    low, high : array (M,)
        Between which angles.
    """

    code: Codes
    low: Array
    high: Array


class Scan(NamedTuple):
    """What sampling found.

    Attributes
    ----------
    envelope : array (G,)
        The least residual over all flips.
    touching : Brackets
        Minima at which a gap changes sign: the residual is zero there.
    turning : Brackets
        Minima at which the residual's derivative changes sign.
    flat : int array (K,)
        Codes whose residual is zero at every scale: they fix none.
    """

    envelope: Array
    touching: Brackets
    turning: Brackets
    flat: Codes


def scan(constraints: Constraints, psi: Array) -> Scan:
    """Sample all flips at the angles (G,), ascending."""
    loop = constraints.single_loop
    chunks = list(_any(constraints, psi) if loop is None else _single_loop(constraints, loop, psi))
    return Scan(
        envelope=np.min([chunk.envelope for chunk in chunks], axis=0),
        touching=join([chunk.touching for chunk in chunks]),
        turning=join([chunk.turning for chunk in chunks]),
        flat=np.concatenate([chunk.flat for chunk in chunks]),
    )


def join(brackets: list[Brackets]) -> Brackets:
    """Put brackets one after the other."""
    return Brackets(*(np.concatenate(parts) for parts in zip(*brackets, strict=True)))


def no_brackets() -> Brackets:
    """Return an empty set of brackets."""
    return Brackets(np.empty(0, dtype=np.int64), np.empty(0), np.empty(0))


def _any(constraints: Constraints, psi: Array) -> Iterator[Scan]:
    """Sample flips in chunks: minima are where the derivative turns from negative to positive."""
    n = constraints.flips.n
    step = max(1, CHUNK_RESIDUALS // (len(psi) * max(1, len(constraints.residuals))))
    for start in range(0, n, step):
        codes = np.arange(start, min(start + step, n), dtype=np.int64)
        value, slope = constraints.evaluate(constraints.flips.signs(codes)[:, None, :], psi)
        flat = (value * (np.sin(psi) * np.cos(psi)) ** 2).max(axis=1) <= ZERO_RESIDUAL
        row, cell = np.nonzero((slope[:, :-1] < 0) & (slope[:, 1:] >= 0) & ~flat[:, None])
        turning = Brackets(codes[row], psi[cell], psi[cell + 1])
        row, cell = np.nonzero(_suspicious(value, slope, psi) & ~flat[:, None])
        hidden = _look_closer(constraints, codes[row], psi[cell], psi[cell + 1])
        yield Scan(value.min(axis=0), no_brackets(), join([turning, hidden]), codes[flat])


def _suspicious(value: Array, slope: Array, psi: Array) -> NDArray[np.bool_]:
    """Return the cells (K, G - 1) with slopes of one sign whose cubic turns back in between."""
    d0, d1 = slope[:, :-1], slope[:, 1:]
    # The derivative of the cubic through both ends' values and slopes is d0 + b t + a t^2, t from 0 to 1.
    secant = np.diff(value, axis=1) / np.diff(psi)
    b, a = 2 * (3 * secant - 2 * d0 - d1), 3 * (d0 + d1 - 2 * secant)
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = -b / (2 * a)
        extreme = d0 - b * b / (4 * a)
    suspicious: NDArray[np.bool_] = (d0 * d1 > 0) & (turn > 0) & (turn < 1) & (extreme * d0 < 0)
    return suspicious


def _look_closer(constraints: Constraints, codes: Codes, low: Array, high: Array) -> Brackets:
    """Sample some cells again, finer."""
    found = [no_brackets()]
    for start in range(0, len(codes), CHUNK_RESIDUALS // 64):
        part = slice(start, start + CHUNK_RESIDUALS // 64)
        psi = low[part, None] + (high - low)[part, None] * np.linspace(0, 1, N_SUBCELLS + 1)
        _, slope = constraints.evaluate(constraints.flips.signs(codes[part])[:, None, :], psi)
        row, cell = np.nonzero((slope[:, :-1] < 0) & (slope[:, 1:] >= 0))
        found.append(Brackets(codes[part][row], psi[row, cell], psi[row, cell + 1]))
    return join(found)


def _single_loop(constraints: Constraints, loop: Array, psi: Array) -> Iterator[Scan]:
    """Sample the gap of one loop, and its derivative, as sums over two halves of its segments."""
    flips = constraints.flips
    dZ, slope = constraints.angle.foreshortening(psi)
    terms, term_slopes = (loop * values for values in (dZ, slope))  # (G, k)
    free = list(flips.free)
    fixed = [segment for segment in range(len(loop)) if segment not in free]
    # Meet in the middle: 2^(k/2) sums of each half make all 2^k gaps by one addition each.
    low_bits = free[: len(free) // 2]
    high_bits = free[len(free) // 2 :]
    low, low_slope = (_sums(values, low_bits) for values in (terms, term_slopes))
    high, high_slope = (
        _sums(values, high_bits) + values[:, fixed] @ flips.base[fixed] for values in (terms, term_slopes)
    )
    step = max(1, CHUNK_RESIDUALS // (len(psi) * len(low)))
    for start in range(0, len(high), step):
        part = slice(start, start + step)
        gap = (high[part, None] + low).reshape(-1, len(psi))
        change = (high_slope[part, None] + low_slope).reshape(-1, len(psi))
        codes = np.arange(len(gap), dtype=np.int64) + start * len(low)
        yield _crossings(codes, gap, change, psi)


def _sums(terms: Array, bits: list[int]) -> Array:
    """Sum terms (G, k) over all signs of some segments: (2**len(bits), G), the first bit the lowest."""
    sums = np.zeros((1, len(terms)))
    for segment in bits:
        sums = np.concatenate([sums + terms[:, segment], sums - terms[:, segment]])
    return sums


def _crossings(codes: Codes, gap: Array, change: Array, psi: Array) -> Scan:
    """Find where gaps (K, G) change sign, and where they come nearest to zero without."""
    size = np.abs(gap)
    flat = (size * np.sin(psi) * np.cos(psi)).max(axis=1) <= ZERO_RESIDUAL**0.5
    positive, rising = gap > 0, change > 0
    crossing = positive[:, :-1] != positive[:, 1:]
    crossing[flat] = False
    row, cell = np.nonzero(crossing)
    touching = Brackets(codes[row], psi[cell], psi[cell + 1])
    # Of one sign at both ends, toward zero at the first and away from it at the second.
    nearing = (
        ~crossing & (positive[:, :-1] != rising[:, :-1]) & (positive[:, 1:] == rising[:, 1:]) & ~flat[:, None]
    )
    row, cell = np.nonzero(nearing)
    turning = Brackets(codes[row], psi[cell], psi[cell + 1])
    return Scan(size.min(axis=0) ** 2, touching, turning, codes[flat])
