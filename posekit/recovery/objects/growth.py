"""Search tree over the flips of an object's segments; loops, stated flips and shape constraints prune branches."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.errors import refusal
from posekit.geometry import Array
from posekit.recovery.objects.family import LinkageFamily, off_flat, with_depth


class Tolerance(NamedTuple):
    """Allowed errors, units of length: of segments that close loops, of too short segments, of image points."""

    rigid: float
    tangent: float
    beside: float


#: Tolerances relative to the longest segment: for exact points, and for points picked by hand.
EXACT: Final = Tolerance(1e-6, 1e-9, 0.0)
MEASURED: Final = Tolerance(0.01, 0.02, 0.01)

#: Depth of a segment, relative to the longest segment, below which both flips are the same posture.
LEVEL: Final = 1e-6

#: Largest residual of a minimum that satisfies the constraints exactly; other minima are used only if no minimum does.
CLOSED_RESIDUAL: Final = 1e-16

#: Largest number of postures during the growth of a tree.
MAX_POSTURES: Final = 200_000


class Check(NamedTuple):
    """Test of postures; it is applied as soon as all segments that it depends on have a flip.

    Attributes
    ----------
    reason : str
    rows : array (R, S)
        Matrix that maps signed foreshortenings (S,) to the R depths that the test uses.
    measure : callable
        Maps depths (N, R) to errors (N,), units of length.
    most : float
        Largest allowed error.
    """

    reason: str
    rows: Array
    measure: Callable[[Array], Array]
    most: float


def grow_best(
    family: LinkageFamily,
    scales: Array,
    hand: NDArray[np.int8],
    given: Tolerance | None,
    about: dict[str, Any],
) -> tuple[Array, Array, Array]:
    """Grow the tree of one frame with the tolerance for exact points and, if they are not exact, for measured points.

    Returns
    -------
    points, flips, scales : array (N, P, 3), (N, S), (N,)
    """
    linkage, incidence = family.linkage, family.incidence
    apart = np.isfinite(family.place[:, 0]) & ~incidence.placed
    if apart[: len(linkage.points)].any():
        names = [linkage.nodes[np.flatnonzero(which)[0]] for which in (incidence.placed, apart)]
        got = f"{' and '.join(names)} in parts without a seen connection"
        raise refusal(f"linkage {linkage.name}", "image", got, "one connected part", "add image points")
    longest = float(linkage.lengths.max())
    usual = {"exact": EXACT, "measured": MEASURED}
    ways = {name: Tolerance(*(part * longest for part in row)) for name, row in usual.items()}
    fitted = about["family"]["how"].split("+")
    evidence = len(incidence.loops) - (fitted == ["closure"] and len(incidence.loops) == 1)
    evidence += len(linkage.coplanar) * ("coplanar" not in fitted) + len(linkage.collinear)
    closed = any(one["residual"] <= CLOSED_RESIDUAL for one in about["family"].get("minima", ()))
    for judged, allowed in ({"given": given} if given else ways).items():
        rejected: Counter[str] = Counter()
        parts = [grow(family, s, hand, allowed, rejected) for s in scales.tolist()]
        about["judged"] = "closed" if judged == "exact" and evidence <= 0 else judged
        about["rejected"] = dict(rejected)
        if any(len(part[0]) for part in parts) and (evidence > 0 or closed):
            break
    points, flips = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    return points, flips, np.repeat(scales, [len(part[0]) for part in parts])


def grow(
    family: LinkageFamily, s: float, hand: NDArray[np.int8], allowed: Tolerance, rejected: Counter[str]
) -> tuple[Array, Array]:
    """Give each segment of the basis both flips in turn; return postures (N, P, 3) and flips (N, S).

    The rejected leaves of the tree are counted by reason.
    """
    linkage, basis = family.linkage, family.incidence.basis
    extent, lengths, names = family.extent / s, linkage.lengths, linkage.segment_names
    dZ = np.sqrt(np.maximum(lengths**2 - extent**2, 0.0))
    checks = list(_checks(family, s, hand, allowed))
    signed = np.zeros((1, len(lengths)))
    for number, k in enumerate(basis):
        later = len(basis) - number - 1
        if extent[k] > lengths[k] + allowed.tangent:
            rejected[f"length/{names[k]}"] += len(signed) << (later + 1)
            return np.empty((0, len(linkage.points), 3)), np.empty((0, len(lengths)))
        if dZ[k] <= LEVEL * lengths.max():
            signed[:, k] = dZ[k]
            rejected[f"level/{names[k]}"] += len(signed) << later
        else:
            signed = np.repeat(signed, 2, axis=0)
            signed[::2, k], signed[1::2, k] = -dZ[k], dZ[k]
        ready = set(basis[: number + 1])
        for check in checks:
            depends = set(np.flatnonzero(check.rows.any(axis=0)))
            if k in depends and depends <= ready:
                bad = check.measure(signed @ check.rows.T) > check.most
                rejected[check.reason] += int(bad.sum()) << later
                signed = signed[~bad]
        if len(signed) > MAX_POSTURES:
            got = f"over {MAX_POSTURES} postures"
            raise refusal(f"linkage {linkage.name}", "image", got, "fewer", "say which ends are nearer")
    depth = np.where(family.incidence.placed, signed @ family.incidence.tree.T, np.nan)
    points = family.placed(s, depth)
    return points, np.where(family.seen, family.flips_of(np.nan_to_num(points)), 0)


def _checks(family: LinkageFamily, s: float, hand: NDArray[np.int8], allowed: Tolerance) -> Iterator[Check]:
    r"""Yield the tests of one frame: closure of loops, stated flips, and shape constraints.

    If image points have errors of at most p, a segment of length l with an image of length e has a depth between
    :math:`\sqrt{l^2 - (e + 2p)^2}` and :math:`\sqrt{l^2 - (e - 2p)^2}`. The error of the depth between two points is at
    most the sum over the segments between them.
    """
    linkage, tree, beside = family.linkage, family.incidence.tree, allowed.beside
    ends, names, place = np.array(linkage.segments), linkage.segment_names, family.place / s
    extent, lengths = family.extent / s, linkage.lengths
    least, depth, most = (
        np.sqrt(np.maximum(lengths**2 - np.maximum(extent + off, 0.0) ** 2, 0.0))
        for off in (2 * beside, 0.0, -2 * beside)
    )
    off = np.nan_to_num(np.maximum(most - depth, depth - least))
    across = tree[ends[:, 1]] - tree[ends[:, 0]]
    between = np.abs(across) @ off  # error of the depth between the ends of each segment
    for k in np.setdiff1d(np.flatnonzero(family.seen), family.incidence.basis).tolist():
        measure = partial(_gap, extent[k], lengths[k], 2 * beside, between[k])
        yield Check(f"closure/{names[k]}", across[[k]], measure, allowed.rigid)
    for k in np.flatnonzero(hand & family.seen).tolist():
        slack = 1e-6 + float(between[k]) * (k not in family.incidence.basis)
        yield Check(f"nearer/{names[k]}", -hand[k] * across[[k]], np.ravel, slack)
    for kind, rank, nodes in family.flat_groups():
        shifts = np.abs(tree[nodes][:, None] - tree[nodes]) @ off
        most_off = allowed.rigid + beside + float(np.sqrt((shifts**2).mean(axis=1)).min())
        reason = f"{kind}/{'-'.join(linkage.nodes[k] for k in nodes)}"
        yield Check(reason, tree[nodes] - tree[nodes[0]], partial(_bend, place[nodes], rank), most_off)
    for pair in map(list, linkage.perpendicular):
        if family.seen[pair].all():
            most_off = allowed.rigid + float(between[pair].sum()) + 4 * beside
            measure = partial(_skew, *(place[ends[pair, 1]] - place[ends[pair, 0]]))
            yield Check(f"perpendicular/{names[pair[0]]}_{names[pair[1]]}", across[pair], measure, most_off)


def _gap(extent: float, length: float, beside: float, off: float, depths: Array) -> Array:
    """Return the error (N,) of the length of a segment that closes a loop, beyond the errors of its end points."""
    depth = np.abs(depths[:, 0])
    far = np.hypot(extent + beside, depth + off)
    near = np.hypot(max(extent - beside, 0.0), np.maximum(depth - off, 0.0))
    return np.maximum(near - length, length - far)


def _bend(place: Array, rank: int, depths: Array) -> Array:
    """Return the root mean square distance of points from their best-fitting plane (rank 2) or line (rank 1)."""
    off = off_flat(with_depth(place, depths), rank)
    return np.asarray(np.sqrt((off**2).sum(axis=(1, 2)) / len(place)))


def _skew(one: Array, two: Array, depths: Array) -> Array:
    """Return the scalar product of two segments divided by the longer length (N,); zero at a right angle."""
    a, b = depths.T
    longer = np.sqrt(np.maximum(one @ one + a * a, two @ two + b * b))
    return np.asarray(np.abs(one @ two + a * b) / longer)
