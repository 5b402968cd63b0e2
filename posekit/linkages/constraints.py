"""The constraints of one search, put together: what is judged, which segments matter, which flips to try."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.linkages.bound_angle import BoundAngle
from posekit.linkages.consistency import components
from posekit.linkages.flips import FlipCodes, number_flips
from posekit.linkages.linkage_family import AT_BOUND, LinkageFamily, read_nearer
from posekit.linkages.residuals import Flatness, LoopClosure, Perpendicularity, Residual, Slice

CONSTRAINT_KINDS: Final = ("closure", "coplanar", "perpendicular", "collinear")

MIN_CONSTRAINT_POINTS: Final = {"coplanar": 4, "collinear": 3}
"""Three points always lie in a plane, and two on a line: fewer seen points say nothing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Constraints:
    """A weighted sum of residuals over the family of one image.

    Parameters
    ----------
    family : LinkageFamily
        The linkage in its image.
    segments : int array (k,)
        The segments that matter: the residuals depend on no other.
    angle : BoundAngle
        Their foreshortenings.
    residuals : tuple of (float, Residual)
        Each with its weight.
    flips : FlipCodes
        Their flips.
    bounding : tuple of int
        Which of the k set the bound.
    """

    family: LinkageFamily
    segments: NDArray[np.intp]
    angle: BoundAngle
    residuals: tuple[tuple[float, Residual], ...]
    flips: FlipCodes
    bounding: tuple[int, ...]

    def evaluate(self, signs: Array, psi: Array) -> tuple[Array, Array]:
        """Return the residual and its derivative by the angle.

        Parameters
        ----------
        signs : array (..., k)
            The flips of the segments that matter, -1 or 1.
        psi : array broadcastable to (...)
            The angle that stands for the scale, radians.
        """
        dZ, slope = self.angle.foreshortening(psi)
        return self.of(Slice(signs * dZ, signs * slope, np.cos(psi), -np.sin(psi)))

    def of(self, postures: Slice) -> tuple[Array, Array]:
        """Return the residual and its derivative of postures whose foreshortenings are known (...)."""
        shape = postures.signed.shape[:-1]
        residual, slope = np.zeros(shape), np.zeros(shape)
        for weight, term in self.residuals:
            value, change = term.evaluate(postures)
            residual += weight * value
            slope += weight * change
        return residual, slope

    @property
    def single_loop(self) -> Array | None:
        """The only constraint where it is the closure of one loop: its row of C, with the root of its weight (k,)."""
        if len(self.residuals) > 1:
            return None
        weight, only = self.residuals[0]
        return math.sqrt(weight) * only.loop if isinstance(only, LoopClosure) else None


def put_together(
    family: LinkageFamily, weights: Mapping[str, float], nearer: Mapping[str, str] | None = None
) -> Constraints:
    """Collect the constraints of a linkage that an image lets judge.

    Parameters
    ----------
    family : LinkageFamily
        The linkage in its image.
    weights : mapping
        ``"closure"``, ``"coplanar"``, ``"perpendicular"``, ``"collinear"`` to a weight above zero.
    nearer : mapping, optional
        Flips given by hand: name of a segment to its nearer end.

    Raises
    ------
    InputError
        Where a kind is not known, a weight is no finite number above zero, the linkage has no such constraint, or too
        little of it is seen; and where all segments are seen end on, so that there is no bound.
    """
    linkage = family.linkage
    where = f"linkage {linkage.name}"
    if not weights:
        raise InputError(
            f"{where}: no constraint to search by; expected some of {', '.join(CONSTRAINT_KINDS)}"
        )
    if family.minimum_scale == 0:
        raise InputError(f"{where}: all its segments are seen end on, at one pixel; the image fixes no scale")
    given = read_nearer(linkage, nearer or {})
    # Lengths count in mean segments, so that residuals and their thresholds do not depend on the object's size.
    unit = float(linkage.lengths.mean())
    minimum = family.minimum_scale * unit  # pixels a mean segment
    found: list[tuple[float, NDArray[np.intp], Residual]] = []
    for kind, weight in weights.items():
        if kind not in CONSTRAINT_KINDS:
            raise InputError(
                f"{where}: constraint {kind!r} is not known; expected {', '.join(CONSTRAINT_KINDS)}"
            )
        if not (math.isfinite(weight) and weight > 0):
            raise InputError(f"{where}: weight of {kind} is {weight:g}; expected a finite number above zero")
        terms = _terms(family, kind, minimum, unit)
        if not terms:
            raise InputError(f"{where}: {_nothing(family, kind)}")
        found += [(weight, segments, term) for segments, term in terms]
    matter = np.unique(np.concatenate([segments for _, segments, _ in found]))
    at_scale = family.extent[matter] / minimum
    lengths = linkage.lengths[matter] / unit
    rest = np.maximum(lengths - at_scale, 0.0)
    bounding = rest <= AT_BOUND * lengths
    column = {int(segment): place for place, segment in enumerate(matter)}
    return Constraints(
        family=family,
        segments=matter,
        angle=BoundAngle(
            minimum_scale=minimum,
            at_scale=at_scale,
            squared_rest=np.where(bounding, 0.0, rest * (lengths + at_scale)),
        ),
        residuals=tuple((weight, _narrow(term, segments, column)) for weight, segments, term in found),
        flips=number_flips(
            len(matter),
            components(
                len(matter),
                [(column[int(a)], column[int(b)]) for _, segments, _ in found for a, b in pairwise(segments)],
            ),
            given[matter].astype(np.float64),
            bounding,
        ),
        bounding=tuple(np.flatnonzero(bounding).tolist()),
    )


def _terms(
    family: LinkageFamily, kind: str, minimum: float, unit: float
) -> list[tuple[NDArray[np.intp], Residual]]:
    """Make the residuals of one kind over all S segments, each with the segments that it depends on."""
    linkage, place = family.linkage, family.place / minimum
    terms: list[tuple[NDArray[np.intp], Residual]] = []
    if kind == "closure":
        return [(np.flatnonzero(row), LoopClosure(loop=row)) for row in family.incidence.loops]
    if kind == "perpendicular":
        for pair in linkage.perpendicular:
            if family.seen[list(pair)].all():
                (a, b), (c, d) = (linkage.segments[number] for number in pair)
                terms.append(
                    (
                        np.array(pair),
                        Perpendicularity(
                            pair=pair,
                            product=float((place[b] - place[a]) @ (place[d] - place[c])),
                            lengths=float(linkage.lengths[list(pair)].prod()) / unit**2,
                        ),
                    )
                )
        return terms
    groups: Sequence[Sequence[int]] = linkage.coplanar if kind == "coplanar" else linkage.collinear
    for group in groups:
        nodes = _together(family, group)
        if len(nodes) >= MIN_CONSTRAINT_POINTS[kind]:
            spread = family.incidence.spread(nodes)
            terms.append(
                (
                    np.flatnonzero(np.abs(spread).max(axis=0)),
                    Flatness(
                        spread=spread,
                        place=place[nodes] - place[nodes].mean(axis=0),
                        rank=2 if kind == "coplanar" else 1,
                    ),
                )
            )
    return terms


def _together(family: LinkageFamily, group: Sequence[int]) -> list[int]:
    """Return the nodes of a group that are seen, of the piece that most of them belong to."""
    seen = [node for node in group if np.isfinite(family.place[node]).all()]
    if not seen:
        return []
    part, _ = Counter(family.incidence.part[node] for node in seen).most_common(1)[0]
    return [node for node in seen if family.incidence.part[node] == part]


def _nothing(family: LinkageFamily, kind: str) -> str:
    """Say why there is nothing of a kind to judge."""
    linkage = family.linkage
    thing = {
        "closure": "loop",
        "coplanar": "coplanar set",
        "perpendicular": "perpendicular pair",
        "collinear": "collinear triple",
    }[kind]
    missing = [
        point for point, place in zip(linkage.points, family.image, strict=True) if np.isnan(place).any()
    ]
    if missing:
        return (
            f"too little is seen of any {thing} to search by {kind}: {', '.join(missing[:6])} "
            f"{'is' if len(missing) == 1 else 'are'} not seen; use another way to fix the scale"
        )
    return f"it has no {thing} to search by {kind}; give it one, or use another way to fix the scale"


def _narrow(term: Residual, segments: NDArray[np.intp], column: Mapping[int, int]) -> Residual:
    """Let a residual over all S segments read the k that matter."""
    kept = list(column)
    if isinstance(term, LoopClosure):
        return LoopClosure(loop=term.loop[kept])
    if isinstance(term, Flatness):
        return Flatness(spread=np.ascontiguousarray(term.spread[:, kept]), place=term.place, rank=term.rank)
    if isinstance(term, Perpendicularity):
        pair = (column[int(segments[0])], column[int(segments[1])])
        return Perpendicularity(pair=pair, product=term.product, lengths=term.lengths)
    return term
