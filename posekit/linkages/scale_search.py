"""The one-dimensional search for the scale that constraints fix (Taylor 2000, §2.1), over all flips that matter."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.linkages.bound_angle import grid
from posekit.linkages.constraints import Constraints, put_together
from posekit.linkages.flips import Codes
from posekit.linkages.linkage_family import LinkageFamily
from posekit.linkages.roots import find_roots
from posekit.linkages.scale_minima import Minima
from posekit.linkages.scan import Brackets, scan

MAX_LOOP_FLIPS = 1 << 20
"""The most assignments that are tried where one loop must close: 21 segments."""

MAX_FLIPS = 1 << 15
"""The most that are tried for other constraints."""

VANISHED_ANGLE_RADIANS = 2e-6
"""Angle from the bound below which the segment that sets it is foreshortened to nothing."""

SAME_MINIMUM_RADIANS = 1e-9
"""Angle between two minima of one assignment that are one."""

ZERO_DERIVATIVE = 1e-12
"""A derivative at the bound that is zero but for rounding."""

ZERO_RESIDUAL = 1e-24
"""A residual that is zero but for rounding; such minima are ordered by s."""

Rows = NDArray[np.intp]

CHUNK_MINIMA = 1 << 16
"""Minima that are refined at once."""


def search(
    family: LinkageFamily,
    weights: Mapping[str, float],
    *,
    nearer: Mapping[str, str] | None = None,
    limit: int | None = None,
) -> Minima:
    r"""Find every scale at which constraints on the shape come to hold, for all flips.

    A local minimum of the residual over :math:`s \ge s_{min}` counts for each assignment of flips. One at the bound
    counts where the residual grows with s whichever way the segments are flipped that set the bound: else it goes on
    falling on the other side. The open end, where s grows without bound and any object shrinks to a line of sight,
    is none.

    Parameters
    ----------
    family : LinkageFamily
        The linkage in its image.
    weights : mapping
        ``"closure"`` (squared distance of the ends of each loop, cut open), ``"coplanar"`` (sum of squared
        distances to the best plane), ``"perpendicular"`` (squared cosine), ``"collinear"`` (sum of squared distances
        to the best line), each to its weight; lengths count in mean segments.
    nearer : mapping, optional
        Flips given by hand: name of a segment to its nearer end.
    limit : int, optional
        The most assignments to try.

    Returns
    -------
    Minima
        Sorted by residual, then by s.

    Raises
    ------
    InputError
        Where there is nothing to search by, or there are more assignments than the limit.

    Examples
    --------
    >>> from posekit.linkages import Linkage, LinkageFamily
    >>> kite = Linkage.from_names(
    ...     name="kite", segments={("a", "b"): 3.0, ("b", "c"): 3.0, ("c", "d"): 5.0, ("d", "a"): 5.0}
    ... )
    >>> image = np.array([[0.0, 0.0], [120.0, 180.0], [330.0, 90.0], [200.0, -240.0]])
    >>> found = search(LinkageFamily(linkage=kite, image=image), {"closure": 1.0})
    >>> found.n_flips
    8
    """
    constraints = put_together(family, weights, nearer)
    _check_size(constraints, limit)
    psi = grid()
    sampled = scan(constraints, psi)
    parts = [_at_bound(constraints, psi[1], sampled.flat)]
    if (loop := constraints.single_loop) is not None:
        parts += _refine_loop(constraints, loop, sampled.touching, sampled.turning)
    else:
        parts.append(_refine(constraints, sampled.turning))
    codes = np.concatenate([part[0] for part in parts])
    angles = np.concatenate([part[1] for part in parts])
    unit = float(family.linkage.lengths.mean())
    return _collect(
        constraints,
        codes,
        angles,
        curve_s=constraints.angle.scale(psi) / unit,
        envelope=sampled.envelope,
        flat=sampled.flat,
    )


def _check_size(constraints: Constraints, limit: int | None) -> None:
    """Refuse more flips than can be tried."""
    n = constraints.flips.n
    most = limit if limit is not None else MAX_FLIPS if constraints.single_loop is None else MAX_LOOP_FLIPS
    if n > most:
        linkage = constraints.family.linkage
        names = [linkage.segment_names[constraints.segments[column]] for column in constraints.flips.free]
        raise InputError(
            f"linkage {linkage.name}: {len(names)} segments matter and may be flipped, 2^{len(names)} assignments; "
            f"at most {most} are tried: say which end is nearer for some of {', '.join(names[:4])}, …, or search by "
            "fewer constraints"
        )


def _at_bound(constraints: Constraints, first: float, flat: Codes) -> tuple[Codes, Array]:
    """Return the codes with a minimum at the bound: whichever way what sets it is flipped, the residual grows."""
    flips = constraints.flips
    codes = np.arange(flips.n, dtype=np.int64)
    grows = np.zeros(flips.n, dtype=bool)
    for start in range(0, flips.n, CHUNK_MINIMA):
        part = codes[start : start + CHUNK_MINIMA]
        signs = flips.signs(part)
        value, slope = constraints.evaluate(signs, np.array(0.0))
        later, later_slope = constraints.evaluate(signs, np.array(first))
        level = np.abs(slope) <= ZERO_DERIVATIVE
        grows[part] = (slope > ZERO_DERIVATIVE) | (level & (later_slope > 0) & (later > value))
    grows[flat] = False
    # Flips of what has vanished are one posture at the bound: if one of them falls from there, it is no minimum.
    for mask in {flips.masks[column] for column in constraints.bounding}:
        grows &= grows[codes ^ mask]
    # All that differ only in what has vanished are one.
    kept = codes[grows & (flips.regardless(codes, constraints.bounding) == codes)]
    return kept, np.zeros(len(kept))


def _refine(constraints: Constraints, turning: Brackets) -> tuple[Codes, Array]:
    """Find where the derivative is zero in each bracket."""
    angles = np.empty(len(turning.code))
    for start in range(0, len(angles), CHUNK_MINIMA):
        part = slice(start, start + CHUNK_MINIMA)
        signs = constraints.flips.signs(turning.code[part])

        def slope(psi: Array, rows: Rows, signs: Array = signs) -> Array:
            return constraints.evaluate(signs[rows], psi)[1]

        angles[part] = find_roots(slope, turning.low[part], turning.high[part])
    return turning.code, angles


def _refine_loop(
    constraints: Constraints, loop: Array, touching: Brackets, turning: Brackets
) -> list[tuple[Codes, Array]]:
    """Find where the gap of one loop is zero, and where it turns; what turns beyond zero has two roots beside."""
    parts = [(touching.code, _roots(constraints, loop, touching, 0))]
    turn = _roots(constraints, loop, turning, 1)
    start, middle = (_gap(constraints, loop, turning.code, psi, 0) for psi in (turning.low, turn))
    # The gap's extreme is on the other side of zero: it crosses zero before and after it.
    beyond = start * middle < 0
    for low, high in ((turning.low, turn), (turn, turning.high)):
        halves = Brackets(turning.code[beyond], low[beyond], high[beyond])
        parts.append((halves.code, _roots(constraints, loop, halves, 0)))
    return [*parts, (turning.code[~beyond], turn[~beyond])]


def _roots(constraints: Constraints, loop: Array, brackets: Brackets, derivative: int) -> Array:
    """Find the roots of a loop's gap, or of its derivative."""
    angles = np.empty(len(brackets.code))
    for start in range(0, len(angles), CHUNK_MINIMA):
        part = slice(start, start + CHUNK_MINIMA)
        codes = brackets.code[part]

        def gap(psi: Array, rows: Rows, codes: Codes = codes) -> Array:
            return _gap(constraints, loop, codes[rows], psi, derivative)

        angles[part] = find_roots(gap, brackets.low[part], brackets.high[part])
    return angles


def _gap(constraints: Constraints, loop: Array, codes: Codes, psi: Array, derivative: int) -> Array:
    """Return the gap of one loop, or its derivative, at one angle for each code."""
    terms = constraints.flips.signs(codes) * constraints.angle.foreshortening(psi)[derivative]
    gap: Array = terms @ loop
    return gap


def _collect(
    constraints: Constraints, codes: Codes, psi: Array, *, curve_s: Array, envelope: Array, flat: Codes
) -> Minima:
    """Count what is one once, and sort."""
    family = constraints.family
    signs = constraints.flips.signs(codes)
    residual = np.empty(len(codes))
    for start in range(0, len(codes), CHUNK_MINIMA):
        part = slice(start, start + CHUNK_MINIMA)
        residual[part], _ = constraints.evaluate(signs[part], psi[part])
    at_bound = psi <= VANISHED_ANGLE_RADIANS
    flips = np.zeros((len(codes), len(family.linkage.segments)), dtype=np.int8)
    flips[:, constraints.segments] = signs
    vanished = constraints.segments[list(constraints.bounding)]
    flips[np.ix_(np.flatnonzero(at_bound), vanished)] = 0
    s = family.minimum_scale / np.cos(np.where(at_bound, 0.0, psi))
    one = np.where(at_bound, constraints.flips.regardless(codes, constraints.bounding), codes)
    kept = _distinct(one, psi, at_bound)
    exact = np.where(residual <= ZERO_RESIDUAL, 0.0, residual)
    order = kept[np.lexsort((s[kept], exact[kept]))]
    flat_flips = np.zeros((len(flat), len(family.linkage.segments)), dtype=np.int8)
    flat_flips[:, constraints.segments] = constraints.flips.signs(flat)
    return Minima(
        constraints=constraints,
        s=s[order],
        residual=residual[order],
        flips=flips[order],
        at_bound=at_bound[order],
        curve_s=curve_s,
        curve_residual=envelope,
        flat=flat_flips,
        segments=tuple(family.linkage.segment_names[number] for number in constraints.segments),
        n_flips=constraints.flips.n,
    )


def _distinct(codes: Codes, psi: Array, at_bound: NDArray[np.bool_]) -> Rows:
    """Return the places of minima that differ in their flips or, by more than rounding, in their angle."""
    place = np.where(at_bound, 0.0, psi)
    order = np.lexsort((place, at_bound, codes))
    new = np.ones(len(order), dtype=bool)
    new[1:] = (
        (np.diff(codes[order]) != 0)
        | (np.diff(at_bound[order]) != 0)
        | (np.diff(place[order]) > SAME_MINIMUM_RADIANS)
    )
    return order[new]
