r"""Search over the scale and the flips of segments for postures that satisfy constraints (Taylor 2000, §2.1).

The scale is parametrised by an angle, :math:`s = s_{min} / \cos\psi`. As a function of s, the foreshortening dZ has a
vertical tangent at the smallest scale :math:`s_{min}`. As a function of :math:`\psi`, dZ is smooth: :math:`dZ = l
\sin\psi` for the segment that determines :math:`s_{min}`. Residuals are dimensionless: lengths are in units of the mean
segment. A minimum is found as a root of the exact derivative, which determines the angle to full precision. Minimising
the sum of squared residuals itself would determine the angle to half the digits only. The derivative is the imaginary
part of the residual after an imaginary step of the angle (Squire & Trapp 1998).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import refusal
from posekit.geometry import Array, Record
from posekit.recovery.objects.family import AT_BOUND, ZERO_COEFFICIENT, LinkageFamily, off_flat, with_depth

CONSTRAINT_KINDS: Final = ("closure", "coplanar", "perpendicular", "collinear")

#: Largest number of assignments of flips that are tried. If constraints form independent blocks, the smallest blocks
#: determine the scale, as many as have at most this number of assignments together. A single block may have more
#: assignments, up to the second number.
MAX_FLIPS, MAX_BLOCK_FLIPS = 1 << 15, 1 << 20

#: Angle (rad) below a right angle at which the search ends: there the scale is a thousand times the smallest scale.
RIGHT_ANGLE: Final = 1e-3

#: Angles (rad) at which residuals are sampled; small angles resolve segments whose bounds are near the largest bound.
GRID: Final = np.sort(
    np.concatenate([np.linspace(0.0, math.pi / 2 - RIGHT_ANGLE, 240), np.geomspace(1e-5, 0.03, 36)])
)

#: Largest residual, times the squared sine and cosine of the angle, that counts as zero.
FLAT_RESIDUAL: Final = 1e-23

#: Angle (rad) below which the scale is at the bound, where the segment that determines the bound has no depth.
VANISHED_ANGLE: Final = 2e-6

#: Largest derivative and largest residual that count as zero; largest difference of angles (rad) within one minimum.
ZERO_SLOPE, ZERO_RESIDUAL, SAME_ANGLE = 1e-12, 1e-24, 1e-9

#: Number of residuals that are evaluated in one block.
CHUNK: Final = 1 << 20

#: Imaginary step of the angle: its square is negligible relative to any real part.
STEP: Final = 1e-30

#: Function from signed foreshortenings (..., S) and the ratio of the bound to the scale (...), complex, to a residual
#: (...).
Residual = Callable[[Array, Array], Array]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Minima(Record):
    """Local minima of the constraints' residual over scale and flips, sorted by increasing residual.

    If no flips are stated, each minimum also represents its mirror image in depth.

    Parameters
    ----------
    s : array (M,)
        Scales, pixels per unit of length.
    residual : array (M,)
        Weighted sum of squared residuals of the constraints (dimensionless).
    flips : int array (M, S)
        1 if the first end of a segment is nearer, -1 if the second end is nearer, 0 if the residual does not depend on
        it.
    curve_s, curve_residual : array (G,)
        Scales from the smallest possible scale upward, and the least residual over all flips at each of these scales
        (Taylor 2000, figures 7b and 8b).
    """

    s: Array
    residual: Array
    flips: NDArray[np.int8]
    curve_s: Array
    curve_residual: Array

    def __len__(self) -> int:
        """Count the minima."""
        return len(self.s)


class Constraints:
    """Weighted residuals of the constraints on one image, and the combinations of flips to search.

    Parameters
    ----------
    family : LinkageFamily
    weights : mapping
        Weight by kind of constraint: ``closure``, ``coplanar``, ``perpendicular``, ``collinear``.
    given : int array (S,)
        Stated flips; 0 for a segment without a stated flip.

    Attributes
    ----------
    bounding : bool array (S,)
        True for segments that determine the smallest possible scale.
    matter : list of int
        Segments whose flips influence the residual.
    signs : array (K, S)
        Combinations of flips; of two combinations with opposite signs, only one is listed.
    """

    def __init__(self, family: LinkageFamily, weights: Mapping[str, float], given: NDArray[np.int8]) -> None:
        linkage = family.linkage
        self.family, self.given = family, given
        unit = float(linkage.lengths.mean())
        self.minimum = family.minimum_scale * unit
        self.at_scale = np.nan_to_num(family.extent / self.minimum)
        lengths = linkage.lengths / unit
        rest = np.maximum(lengths - self.at_scale, 0.0)
        self.bounding = (rest <= AT_BOUND * lengths) & family.seen
        self.rest = np.where(self.bounding, 0.0, rest * (lengths + self.at_scale))
        every: list[tuple[float, NDArray[np.intp], Residual]] = []
        for kind, weight in weights.items():
            found = self._terms(kind, unit)
            if not found:
                got, remedy = f"nothing of {linkage.name} to search by {kind}", "fix the scale another way"
                raise refusal("", "scale", got, "a constraint whose points are seen", remedy)
            every += [(weight, segments, term) for segments, term in found]
        self.matter: list[int] = []
        self.signs = np.where(self.given == 0, 1.0, self.given)[None]
        for block in sorted(_blocks([segments for _, segments, _ in every], len(lengths)), key=len):
            free = [k for k in block if self.given[k] == 0]
            # The opposite signs of a block mirror the posture in depth and have the same residual. So the sign of one
            # segment is fixed, of a segment that does not determine the bound.
            if len(free) == len(block):
                free.remove(next((k for k in free if not self.bounding[k]), free[0]))
            if self.matter and len(self.signs) << len(free) > MAX_FLIPS:
                break
            if 1 << len(free) > MAX_BLOCK_FLIPS:
                got = f"2^{len(free)} flips of segments that share constraints"
                names = ", ".join(linkage.segment_names[k] for k in free[:4])
                remedy = f"say which end is nearer for some of {names}, …"
                raise refusal("", "scale", got, f"at most {MAX_BLOCK_FLIPS}", remedy)
            for k in reversed(free):
                self.signs = np.repeat(self.signs, 2, axis=0)
                self.signs[1::2, k] = -1.0
            self.matter += block
        self.terms = [(weight, term) for weight, segments, term in every if segments[0] in self.matter]

    def _terms(self, kind: str, unit: float) -> list[tuple[NDArray[np.intp], Residual]]:
        """Return the residuals of one kind of constraint, each with the segments that it depends on."""
        family, linkage, incidence = self.family, self.family.linkage, self.family.incidence
        place = family.place / self.minimum
        found: list[tuple[NDArray[np.intp], Residual]] = []
        if kind == "closure":
            found = [(np.flatnonzero(row), partial(_closure, row)) for row in incidence.loops]
        elif kind == "perpendicular":
            for pair in map(list, linkage.perpendicular):
                if family.seen[pair].all():
                    one, two = (place[b] - place[a] for a, b in np.array(linkage.segments)[pair])
                    size = float((linkage.lengths[pair] / unit).prod())
                    found.append((np.array(pair), partial(_perpendicular, pair, one @ two, size)))
        for group_kind, rank, nodes in family.flat_groups():
            if group_kind == kind:
                depth = incidence.depth[nodes] - incidence.depth[nodes].mean(axis=0)
                segments = np.flatnonzero(np.abs(depth).max(axis=0) > ZERO_COEFFICIENT)
                found.append((segments, partial(_flatness, rank, place[nodes], depth)))
        return found

    def evaluate(self, signs: Array, psi: Array) -> tuple[Array, Array]:
        """Return residuals and their derivatives for flips (..., S) at angles that broadcast to (...)."""
        turned = psi + 1j * STEP
        reach = self.at_scale * np.sin(turned)[..., None]
        dZ = np.where(self.bounding, reach, np.sqrt(self.rest + reach**2))
        parts = [weight * term(signs * dZ, np.cos(turned)) for weight, term in self.terms]
        residual = np.sum(parts, axis=0)
        return residual.real, residual.imag / STEP


def search(
    family: LinkageFamily, weights: Mapping[str, float], given: NDArray[np.int8] | None = None
) -> Minima:
    """Find all local minima of the constraints' residual over the scale and the flips that change the residual.

    Parameters
    ----------
    family : LinkageFamily
        The linkage and its image points.
    weights : mapping
        Positive weight by kind of constraint: ``closure``, ``coplanar``, ``perpendicular``, ``collinear``.
    given : int array (S,), optional
        Stated flips: 1 if the first end of a segment is nearer, -1 if the second end is nearer, 0 if no flip is stated.

    Raises
    ------
    InputError
        If the linkage has no constraint of a kind in `weights`, too few of its points are seen, or too many flips share
        constraints.

    Examples
    --------
    >>> import numpy as np
    >>> from posekit.recovery.objects import Linkage, LinkageFamily, search
    >>> sides = {("a", "b"): 3.0, ("b", "c"): 3.0, ("c", "d"): 5.0, ("d", "a"): 5.0}
    >>> kite = Linkage.from_names(name="kite", segments=sides)
    >>> image = np.array([[0.0, 0.0], [120.0, 180.0], [330.0, 90.0], [200.0, -240.0]])
    >>> len(search(LinkageFamily(linkage=kite, image=image), {"closure": 1.0})) > 0
    True
    """
    if family.minimum_scale == 0:
        got = "all segments seen end on"
        raise refusal("", "scale", got, "an image that determines a scale", "give the scale")
    none = np.zeros(len(family.linkage.segments), dtype=np.int8)
    constraints = Constraints(family, weights, none if given is None else given)
    signs, psi, envelope = _minima(constraints)
    residual, _ = constraints.evaluate(signs, psi)
    psi = np.where(psi <= VANISHED_ANGLE, 0.0, psi)
    flips = np.zeros(signs.shape, dtype=np.int8)
    flips[:, constraints.matter] = signs[:, constraints.matter]
    flips[np.ix_(psi == 0, constraints.bounding)] = 0
    s = family.minimum_scale / np.cos(psi)
    exact = np.where(residual <= ZERO_RESIDUAL, 0.0, residual)
    order = np.lexsort((s, exact))
    # Minima that differ by rounding only are merged.
    key = np.column_stack([flips[order], np.round(psi[order] / SAME_ANGLE)])
    _, first = np.unique(key, axis=0, return_index=True)
    order = order[np.sort(first)]
    return Minima(
        s=s[order],
        residual=residual[order],
        flips=flips[order],
        curve_s=family.minimum_scale / np.cos(GRID),
        curve_residual=envelope,
    )


def _minima(constraints: Constraints) -> tuple[Array, Array, Array]:
    """Return the minima of every combination of flips: roots of the derivative, and minima at the smallest scale.

    Combinations whose residual is zero at every scale have no minimum.

    Returns
    -------
    signs, psi : array (M, S), (M,)
        Combination of flips and angle of each minimum.
    envelope : array (G,)
        Least residual over all combinations at the angles of `GRID`.
    """
    from scipy.optimize import elementwise

    signs = constraints.signs
    envelope, rows, cells, starts = np.full(len(GRID), np.inf), [], [], []
    step = max(1, CHUNK // (len(GRID) * max(1, signs.shape[1])))
    for start in range(0, len(signs), step):
        value, slope = constraints.evaluate(signs[start : start + step, None], GRID)
        envelope = np.minimum(envelope, value.min(axis=0))
        flat = (value * (np.sin(GRID) * np.cos(GRID)) ** 2).max(axis=1) <= FLAT_RESIDUAL
        row, cell = np.nonzero((slope[:, :-1] < 0) & (slope[:, 1:] >= 0) & ~flat[:, None])
        rows.append(row + start)
        cells.append(cell)
        level = np.abs(slope[:, 0]) <= ZERO_SLOPE
        starts.append((np.where(level, slope[:, 1], slope[:, 0]) > 0) & ~flat)
    row, cell = np.concatenate(rows), np.concatenate(cells)

    def slope_at(psi: Array, k: Array) -> Array:
        return constraints.evaluate(signs[row[k]], psi)[1]

    psi = np.empty(0)
    if len(row):
        bracket = (GRID[cell], GRID[cell + 1])
        psi = elementwise.find_root(slope_at, bracket, args=(np.arange(len(row)),)).x
    # At the bound both flips of a segment without depth are one posture. It is a minimum if both residuals increase.
    grows = np.concatenate(starts)
    closed = np.where(constraints.bounding & (constraints.given == 0), 0.0, signs)
    _, same = np.unique(closed, axis=0, return_inverse=True)
    falls = np.bincount(same.reshape(-1), ~grows) > 0
    bound = np.flatnonzero(~falls[same.reshape(-1)])
    return signs[np.concatenate([bound, row])], np.concatenate([np.zeros(len(bound)), psi]), envelope


def _blocks(terms: Sequence[NDArray[np.intp]], count: int) -> list[list[int]]:
    """Return groups of segments; each residual depends on the segments of one group only."""
    from scipy.sparse.csgraph import connected_components

    graph = np.zeros((count, count))
    for segments in terms:
        graph[segments[0], segments] = 1
    _, label = connected_components(graph, directed=False)
    matter = np.unique(np.concatenate(terms))
    return [matter[label[matter] == block].tolist() for block in dict.fromkeys(label[matter].tolist())]


def _closure(loop: Array, signed: Array, shrink: Array) -> Array:
    """Return the squared sum of signed depths around a loop; zero if the loop closes."""
    return np.asarray((signed @ loop) ** 2)


def _flatness(rank: int, place: Array, depth: Array, signed: Array, shrink: Array) -> Array:
    """Return the sum of squared distances of points from their best-fitting plane (rank 2) or line (rank 1)."""
    points = with_depth(shrink[..., None, None] * place, signed @ depth.T)
    return np.asarray((off_flat(points, rank) ** 2).sum(axis=(-1, -2)))


def _perpendicular(pair: list[int], product: float, size: float, signed: Array, shrink: Array) -> Array:
    """Return the squared cosine of the angle between two segments."""
    return np.asarray(((shrink**2 * product + signed[..., pair].prod(axis=-1)) / size) ** 2)
