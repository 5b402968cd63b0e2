r"""The scale that constraints fix: a search over one dimension and all flips that matter (Taylor 2000, §2.1).

The scale is an angle, :math:`s = s_{min} / \cos\psi`, in which foreshortenings are smooth: as a function of s, dZ
starts at the bound with a vertical tangent; as a function of :math:`\psi` the segment that sets the bound has
:math:`dZ = l \sin\psi`. Residuals are dimensionless: lengths are in units of the mean segment. A minimum is a root of
the exact derivative, which is known to full precision where the residual, a sum of squares near zero, is known to half.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import nearest, refusal
from posekit.geometry import Array, Record
from posekit.recovery.objects.family import AT_BOUND, LinkageFamily
from posekit.recovery.objects.linkage import read_nearer

CONSTRAINT_KINDS: Final = ("closure", "coplanar", "perpendicular", "collinear")

#: Assignments of flips that are tried one by one; of more, independent blocks are searched together.
MAX_FLIPS: Final = 1 << 15

#: Assignments of one block of segments that share constraints.
MAX_BLOCK_FLIPS: Final = 1 << 20

#: Distance (rad) from the right angle at which the search ends: a thousand times the bound.
RIGHT_ANGLE: Final = 1e-3

#: Angles at which residuals are sampled; the small ones resolve segments that are almost at the bound themselves.
GRID: Final = np.unique(
    np.concatenate([np.linspace(0.0, math.pi / 2 - RIGHT_ANGLE, 240), np.geomspace(1e-5, 0.03, 36)])
)

#: A residual, weighed by the squared sine and cosine of the angle, that is zero but for rounding.
FLAT_RESIDUAL: Final = 1e-23

#: Angle (rad) from the bound below which the segment that sets it is foreshortened to nothing.
VANISHED_ANGLE: Final = 2e-6

#: A derivative and a residual that are zero but for rounding; angles (rad) of one minimum.
ZERO_SLOPE, ZERO_RESIDUAL, SAME_ANGLE = 1e-12, 1e-24, 1e-9

#: Residuals that are evaluated at once.
CHUNK: Final = 1 << 20

#: Signed foreshortenings (..., S) and their derivative, shrinking of the image at the bound and its derivative, to a
#: residual (...) and its derivative.
Residual = Callable[[Array, Array, Array, Array], tuple[Array, Array]]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Minima(Record):
    """Local minima of the constraints' residual over scale and flips, best first.

    Each minimum stands for its mirror image in depth, too, unless flips were given by hand.

    Parameters
    ----------
    s : array (M,)
        Scales, pixels a unit of length.
    residual : array (M,)
        Weighted sum of squares that the constraints leave (dimensionless).
    flips : int array (M, S)
        1 where the first end of a segment is nearer, -1 where its second is, 0 where it does not matter.
    curve_s, curve_residual : array (G,)
        Scales from the bound on, and the least residual over all flips there.
    constraints : Constraints
    """

    s: Array
    residual: Array
    flips: NDArray[np.int8]
    curve_s: Array
    curve_residual: Array
    constraints: Constraints

    def __len__(self) -> int:
        """Count the minima."""
        return len(self.s)

    def curve(self, number: int) -> Array:
        """Return the residual of one minimum's own flips over `curve_s` (Taylor 2000, Figs. 7b and 8b)."""
        signs = self.flips[number].astype(np.float64)
        return self.constraints.evaluate(np.where(signs == 0, 1.0, signs), GRID)[0]


class Constraints:
    """The weighted residuals of one image, block by block of segments that share them.

    Parameters
    ----------
    family : LinkageFamily
    weights : mapping
        ``closure``, ``coplanar``, ``perpendicular``, ``collinear`` to a weight.
    nearer : mapping
        Flips given by hand: segment to its nearer end.
    """

    def __init__(
        self, family: LinkageFamily, weights: Mapping[str, float], nearer: Mapping[str, str]
    ) -> None:
        linkage = family.linkage
        self.family = family
        self.given = read_nearer(linkage, nearer)
        unit = float(linkage.lengths.mean())
        self.minimum = family.minimum_scale * unit
        self.at_scale = np.nan_to_num(family.extent / self.minimum)
        lengths = linkage.lengths / unit
        rest = np.maximum(lengths - self.at_scale, 0.0)
        self.bounding = (rest <= AT_BOUND * lengths) & family.seen
        self.rest = np.where(self.bounding, 0.0, rest * (lengths + self.at_scale))
        self.terms: list[tuple[float, NDArray[np.intp], Residual]] = []
        for kind, weight in weights.items():
            if kind not in CONSTRAINT_KINDS:
                raise refusal("", "scale", kind, "a known constraint", nearest(kind, CONSTRAINT_KINDS))
            found = self._terms(kind, unit)
            if not found:
                got, remedy = f"nothing of {linkage.name} to search by {kind}", "fix the scale another way"
                raise refusal("", "scale", got, "a constraint whose points are seen", remedy)
            self.terms += [(weight, segments, term) for segments, term in found]
        self.blocks = self._blocks()

    def _terms(self, kind: str, unit: float) -> list[tuple[NDArray[np.intp], Residual]]:
        """Make the residuals of one kind, each with the segments that it depends on."""
        family, linkage = self.family, self.family.linkage
        place = family.place / self.minimum
        if kind == "closure":
            return [(np.flatnonzero(row), _closure(row)) for row in family.incidence.loops]
        if kind == "perpendicular":
            return [
                (np.array(pair), _perpendicular(pair, linkage.segments, place, linkage.lengths / unit))
                for pair in linkage.perpendicular
                if family.seen[list(pair)].all()
            ]
        found = []
        groups, rank = (linkage.coplanar, 2) if kind == "coplanar" else (linkage.collinear, 1)
        for group in groups:
            seen = [node for node in group if np.isfinite(family.place[node]).all()]
            part = Counter(family.incidence.part[node] for node in seen).most_common(1)
            nodes = [node for node in seen if family.incidence.part[node] == part[0][0]]
            if len(nodes) >= rank + 2:
                spread = family.incidence.spread(nodes)
                centred = place[nodes] - place[nodes].mean(axis=0)
                found.append((np.flatnonzero(np.abs(spread).max(axis=0)), _flatness(spread, centred, rank)))
        return found

    def _blocks(self) -> list[tuple[list[int], list[tuple[float, Residual]]]]:
        """Group terms that share segments: the segments of each block, and its terms."""
        from scipy.sparse.csgraph import connected_components

        count = len(self.family.linkage.segments)
        graph = np.zeros((count, count))
        for _, segments, _ in self.terms:
            for a, b in pairwise(segments.tolist()):
                graph[a, b] = 1
        _, label = connected_components(graph, directed=False)
        matter = np.unique(np.concatenate([segments for _, segments, _ in self.terms]))
        return [
            (
                [int(k) for k in matter if label[k] == block],
                [(weight, term) for weight, segments, term in self.terms if label[segments[0]] == block],
            )
            for block in dict.fromkeys(label[matter].tolist())
        ]

    def assignments(self, segments: Sequence[int]) -> Array:
        """Return the flips (K, S) of one block's segments: mirror images once, flips given by hand kept.

        Without flips given by hand all signs of the block can be turned round, which mirrors the posture in depth and
        changes no residual: one sign is held, of a segment that does not set the bound.
        """
        free = [k for k in segments if self.given[k] == 0]
        if len(free) == len(segments):
            held = next((k for k in free if not self.bounding[k]), free[0])
            free.remove(held)
        if 1 << len(free) > MAX_BLOCK_FLIPS:
            names = [self.family.linkage.segment_names[k] for k in free[:4]]
            got = f"2^{len(free)} flips of segments that share constraints"
            remedy = f"say which end is nearer for some of {', '.join(names)}, …"
            raise refusal("", "scale", got, f"at most {MAX_BLOCK_FLIPS}", remedy)
        signs = np.tile(np.where(self.given == 0, 1.0, self.given), (1 << len(free), 1))
        codes = np.arange(1 << len(free))
        for bit, segment in enumerate(free):
            signs[:, segment] = 1.0 - 2.0 * ((codes >> bit) & 1)
        return signs

    def evaluate(
        self, signs: Array, psi: Array, terms: Sequence[tuple[float, Residual]] | None = None
    ) -> tuple[Array, Array]:
        """Return residual and derivative of flips (..., S) at angles that broadcast to (...)."""
        sine, cosine = np.sin(psi)[..., None], np.cos(psi)[..., None]
        reach = self.at_scale * sine
        dZ = np.sqrt(self.rest + reach * reach)
        # For the segment that sets the bound the ratio is one, at the bound too.
        slope = np.divide(reach, dZ, out=np.ones_like(dZ), where=dZ > 0) * self.at_scale * cosine
        parts = [
            (weight, term(signs * dZ, signs * slope, np.cos(psi), -np.sin(psi)))
            for weight, term in terms or [(weight, term) for weight, _, term in self.terms]
        ]
        return (
            np.asarray(sum(weight * value for weight, (value, _) in parts)),
            np.asarray(sum(weight * change for weight, (_, change) in parts)),
        )


def search(
    family: LinkageFamily, weights: Mapping[str, float], *, nearer: Mapping[str, str] | None = None
) -> Minima:
    """Find all local minima of the constraints' residual, over the scale and the flips that matter.

    Parameters
    ----------
    family : LinkageFamily
        The linkage in its image.
    weights : mapping
        ``closure``, ``coplanar``, ``perpendicular``, ``collinear`` to a positive weight.
    nearer : mapping, optional
        Flips given by hand: name of a segment to its nearer end.

    Raises
    ------
    InputError
        If the linkage has no such constraint, too little of it is seen, or too many flips share constraints.

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
        raise refusal("", "scale", got, "an image that fixes a scale", "give the scale")
    constraints = Constraints(family, weights, nearer or {})
    tables = [(constraints.assignments(segments), terms) for segments, terms in constraints.blocks]
    if math.prod(len(signs) for signs, _ in tables) > MAX_FLIPS and len(tables) > 1:
        signs, psi, envelope = _together(constraints, tables)
    else:
        every = tables[0][0]
        for (segments, _), (more, _) in zip(constraints.blocks[1:], tables[1:], strict=True):
            every = np.repeat(every, len(more), axis=0)
            every[:, segments] = np.tile(more[:, segments], (len(every) // len(more), 1))
        signs, psi, envelope = _one_by_one(constraints, every)
    matter = sorted(k for segments, _ in constraints.blocks for k in segments)
    residual, _ = constraints.evaluate(signs, psi)
    at_bound = psi <= VANISHED_ANGLE
    flips = np.zeros(signs.shape, dtype=np.int8)
    flips[:, matter] = signs[:, matter]
    flips[np.ix_(at_bound, constraints.bounding)] = 0
    s = family.minimum_scale / np.cos(np.where(at_bound, 0.0, psi))
    exact = np.where(residual <= ZERO_RESIDUAL, 0.0, residual)
    order = np.lexsort((s, exact))
    # Minima that differ by rounding alone are one.
    key = np.column_stack([flips[order], np.round(np.where(at_bound, 0.0, psi)[order] / SAME_ANGLE)])
    _, first = np.unique(key, axis=0, return_index=True)
    order = order[np.sort(first)]
    return Minima(
        s=s[order],
        residual=residual[order],
        flips=flips[order],
        curve_s=family.minimum_scale / np.cos(GRID),
        curve_residual=envelope,
        constraints=constraints,
    )


def _one_by_one(constraints: Constraints, signs: Array) -> tuple[Array, Array, Array]:
    """Find the minima of every assignment of flips (K, S): roots of the derivative, and minima at the bound.

    Flips whose residual is zero at every scale fix none.
    """
    from scipy.optimize import elementwise

    envelope, rows, cells, starts = np.full(len(GRID), np.inf), [], [], []
    step = max(1, CHUNK // (len(GRID) * max(1, signs.shape[1])))
    for start in range(0, len(signs), step):
        value, slope = constraints.evaluate(signs[start : start + step, None], GRID)
        envelope = np.minimum(envelope, value.min(axis=0))
        flat = (value * (np.sin(GRID) * np.cos(GRID)) ** 2).max(axis=1) <= FLAT_RESIDUAL
        row, cell = np.nonzero((slope[:, :-1] < 0) & (slope[:, 1:] >= 0) & ~flat[:, None])
        level = np.abs(slope[:, 0]) <= ZERO_SLOPE
        later = (slope[:, 1] > 0) & (value[:, 1] > value[:, 0])
        rows.append(row + start)
        cells.append(cell)
        starts.append(((slope[:, 0] > ZERO_SLOPE) | (level & later)) & ~flat)
    row, cell = np.concatenate(rows), np.concatenate(cells)

    def slope_at(psi: Array, k: Array) -> Array:
        return constraints.evaluate(signs[row[k]], psi)[1]

    psi = np.empty(0)
    if len(row):
        bracket = (GRID[cell], GRID[cell + 1])
        psi = elementwise.find_root(slope_at, bracket, args=(np.arange(len(row)),)).x
    # A segment that has vanished at the bound has two flips that are one posture: a minimum if both grow from there.
    grows = np.concatenate(starts)
    closed = np.where(constraints.bounding & (constraints.given == 0), 0.0, signs)
    _, same = np.unique(closed, axis=0, return_inverse=True)
    falls = np.bincount(same.reshape(-1), ~grows) > 0
    bound = np.flatnonzero(~falls[same.reshape(-1)])
    return signs[np.concatenate([bound, row])], np.concatenate([np.zeros(len(bound)), psi]), envelope


def _together(
    constraints: Constraints, tables: Sequence[tuple[Array, Sequence[tuple[float, Residual]]]]
) -> tuple[Array, Array, Array]:
    """Find minima of the sum of the least residuals of independent blocks, where flips are too many to list."""
    from scipy.optimize import minimize_scalar

    psi = np.unique(np.concatenate([GRID, np.linspace(0.0, GRID[-1], 4000)]))

    def least(at: Array) -> Array:
        total = np.zeros(len(at))
        for signs, terms in tables:
            total += np.min([constraints.evaluate(one, at, terms)[0] for one in signs], axis=0)
        return total

    values = least(psi)
    inside = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    found = [0.0] if values[0] < values[1] else []
    for k in inside.tolist():
        bounds = (psi[k - 1], psi[k + 1])
        best = minimize_scalar(lambda x: least(np.array([x]))[0], bounds=bounds, options={"xatol": 1e-13})
        found.append(float(best.x))
    angles = np.array(found)
    signs = np.tile(np.where(constraints.given == 0, 1.0, constraints.given), (len(angles), 1))
    for (segments, _), (options, terms) in zip(constraints.blocks, tables, strict=True):
        at = np.array([constraints.evaluate(one, angles, terms)[0] for one in options]).argmin(axis=0)
        signs[:, segments] = options[at][:, segments]
    return signs, angles, np.interp(GRID, psi, values)


def _closure(loop: Array) -> Residual:
    """Squared distance between the two ends of a loop that was cut open."""

    def evaluate(signed: Array, slope: Array, shrink: Array, shrink_slope: Array) -> tuple[Array, Array]:
        gap = signed @ loop
        return gap * gap, 2 * gap * (slope @ loop)

    return evaluate


def _flatness(spread: Array, place: Array, rank: int) -> Residual:
    """Sum of squared distances of points from their best plane (rank 2) or line (rank 1).

    It is the smallest eigenvalue of their scatter matrix, or the sum of the two smallest. At a minimum over the plane
    the derivative is that with the plane held still.
    """

    def points(signed: Array, shrink: Array) -> Array:
        depth = signed @ spread.T
        flat = shrink[..., None, None] * place
        return np.concatenate([np.broadcast_to(flat, (*depth.shape, 2)), depth[..., None]], axis=-1)

    def evaluate(signed: Array, slope: Array, shrink: Array, shrink_slope: Array) -> tuple[Array, Array]:
        at, change = points(signed, shrink), points(slope, shrink_slope)
        _, axes = np.linalg.eigh(np.swapaxes(at, -1, -2) @ at)
        normals = axes[..., : 3 - rank]
        off = at @ normals
        return (off * off).sum(axis=(-1, -2)), 2 * (off * (change @ normals)).sum(axis=(-1, -2))

    return evaluate


def _perpendicular(
    pair: tuple[int, int], segments: Sequence[tuple[int, int]], place: Array, lengths: Array
) -> Residual:
    """Squared cosine of the angle between two segments."""
    (a, b), (c, d) = (segments[number] for number in pair)
    product = float((place[b] - place[a]) @ (place[d] - place[c]))
    size = float(lengths[list(pair)].prod())

    def evaluate(signed: Array, slope: Array, shrink: Array, shrink_slope: Array) -> tuple[Array, Array]:
        first, second = signed[..., pair[0]], signed[..., pair[1]]
        cosine = (shrink**2 * product + first * second) / size
        change = (
            2 * shrink * shrink_slope * product + slope[..., pair[0]] * second + first * slope[..., pair[1]]
        )
        return cosine * cosine, 2 * cosine * change / size

    return evaluate
