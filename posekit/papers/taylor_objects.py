r"""Comparison with Taylor 2000, Figs. 7 and 8: scale of a closed chain and of a flat chain (§2.1, §3.3).

Taylor prints neither segment lengths nor postures of the two chains; the lengths are those of `urdf/linkages`. The
chains are recovered from views from random directions. The errors of their joint angles are compared with the errors
that image noise explains (`sensitivity`). The unknowns are the point positions :math:`X`, with the first point at depth
0, and the scale :math:`s`. The image points are :math:`u = s\,(X_x, X_y)`. Known lengths and planes are constraints
:math:`c(X) = 0`, so small errors of :math:`(X, s)` are in the null space :math:`N = \ker \partial c`. Image noise
:math:`\sigma` gives :math:`(X, s)` the covariance :math:`N (N^T H^T H N)^{-1} N^T \sigma^2` with :math:`H = \partial u
/ \partial (X, s)`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.geometry import Array, cross, rotation_from_quaternion
from posekit.papers.rows import Row, printed, row
from posekit.recovery.objects import Linkage, LinkageFamily, load_linkage, search

#: Size of an object in its picture, pixels.
SIZE_PIXELS: Final = 600.0

#: Standard deviation of each coordinate, pixels.
NOISE_PIXELS: Final = 1.0

N_PICTURES, N_VIEWS, N_DRAWS = 200, 1000, 1000

SEED: Final = 2000

#: Length of the diagonal from a to c along which the four bars are folded, millimetres.
DIAGONAL: Final = 140.0

TURNS: Final = (50.0, 110.0, 110.0, 80.0)
#: Angles of the flat chain at its points, degrees, and largest random angle; larger angles make segments overlap.
MAX_TURN: Final = 150.0

#: A view counts as solvable if every angle is within the printed bound with at least this probability.
SOLVABLE: Final = 0.95

#: Smallest singular value of the equations, as a fraction of the largest, of a constrained motion.
FREE_RATIO: Final = 1e-9

#: Step of the angles' central differences, as a fraction of the object's size.
ANGLE_STEP: Final = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Constrained:
    """A chain of segments in one posture, with a constraint that determines the scale of its image.

    Parameters
    ----------
    figure : str
        Figure of Taylor 2000 that shows the object.
    constraint : {"closure", "coplanar"}
        The constraint that determines the scale: the chain is closed, or its points are in one plane.
    linkage : Linkage
        Points and lengths.
    points : array (P, 3)
        Positions of the points in the camera frame, in the unit of the lengths.
    """

    figure: str
    constraint: str
    linkage: Linkage
    points: Array

    @property
    def bound(self) -> float:
        """Largest error of a joint angle that Taylor reports for the object, degrees."""
        return float(printed()["taylor"]["angles"][self.constraint])

    @property
    def triples(self) -> list[tuple[int, int, int]]:
        """Indices (a, b, c) of the points before, at and after each joint whose angle is measured."""
        n = len(self.points)
        joints = range(n) if self.constraint == "closure" else range(1, n - 1)
        return [((k - 1) % n, k, (k + 1) % n) for k in joints]

    def random_posture(self, rng: np.random.Generator) -> Array:
        """Draw a flat posture (P, 3): random diagonal of the closed chain, or random angles of the flat chain."""
        lengths = self.linkage.lengths
        if self.constraint == "coplanar":
            return _laid(lengths, rng.uniform(-MAX_TURN, MAX_TURN, len(lengths) - 1))
        ab, bc, cd, da = lengths
        # At both limits a pair of bars is straight, and its height is the square root of zero.
        shortest, longest = max(abs(ab - bc), abs(cd - da)), min(ab + bc, cd + da)
        return _folded(lengths, shortest + rng.uniform(0.05, 0.95) * (longest - shortest))

    def recovered(self, truth: Array, s: float, image: Array) -> Array | None:
        """Return the posture at the best scale, with the true signs of segment depths; None if no scale is found."""
        flips = LinkageFamily(linkage=self.linkage, image=truth[:, :2] * s).flips_of(truth)
        family = LinkageFamily(linkage=self.linkage, image=image)
        found = search(family, {self.constraint: 1.0}, flips)
        if not len(found):
            return None
        return family.points(found.s[0], flips)


def constrained_objects() -> list[Constrained]:
    """Return the closed chain of Fig. 7 and the flat chain of Fig. 8."""
    bars, chain = load_linkage("four_bar"), load_linkage("planar_chain")
    folded = _turned(_folded(bars.lengths, DIAGONAL), tilt=50, spin=220)
    laid = _turned(_laid(chain.lengths, TURNS), tilt=45, spin=60)
    return [
        Constrained(figure="Fig. 7", constraint="closure", linkage=bars, points=folded),
        Constrained(figure="Fig. 8", constraint="coplanar", linkage=chain, points=laid),
    ]


def object_rows() -> Iterator[Row]:
    """Yield a `Row` for each comparison with Figs. 7 and 8."""
    objects = constrained_objects()
    for one in objects:
        yield from _picture_rows(one)
    for posed in (False, True):
        for one in objects:
            yield _views_row(one, posed=posed)


def joint_angles(points: Array, triples: Sequence[tuple[int, int, int]]) -> Array:
    """Return the angle (..., T) at b between the segments to a and c, for each triple (a, b, c), degrees.

    The angle is the arc tangent of cross and dot product, which is accurate for parallel segments, too.
    """
    a, b, c = np.array(triples).T
    u, v = points[..., a, :] - points[..., b, :], points[..., c, :] - points[..., b, :]
    return np.asarray(np.degrees(np.arctan2(np.linalg.norm(cross(u, v), axis=-1), (u * v).sum(axis=-1))))


def _picture_rows(one: Constrained) -> Iterator[Row]:
    """Compare scales that satisfy the constraint, and joint angles from noisy images, with their true values."""
    s, rng = scale_of(one.points), np.random.default_rng(SEED)
    exact = LinkageFamily(linkage=one.linkage, image=one.points[:, :2] * s)
    found = search(exact, {one.constraint: 1.0}, exact.flips_of(one.points))
    zeros = found.s[found.residual < 1e-20] / s
    here = f"zero at {', '.join(f'{zero:.9g}' for zero in zeros) or 'no'} times the true s"
    yield row("zero", here, len(zeros) == 1 and bool(abs(zeros[0] - 1) < 1e-9), figure=one.figure)
    true = joint_angles(one.points, one.triples)
    worst = np.full(N_PICTURES, np.inf)
    for k in range(N_PICTURES):
        image = one.points[:, :2] * s + NOISE_PIXELS * rng.normal(size=(len(one.points), 2))
        if (posture := one.recovered(one.points, s, image)) is not None:
            worst[k] = np.abs(joint_angles(posture, one.triples) - true).max()
    yield row(
        "object",
        f"{(worst <= one.bound).mean():.1%} of {N_PICTURES} pictures; median {np.median(worst):.2f} degrees",
        None,
        off=np.abs(search(exact, {one.constraint: 1.0}).s / s - 1).min(),
        **_words(one),
    )


def _views_row(one: Constrained, *, posed: bool) -> Row:
    """Recover an object in many views from random directions, in its own posture or (`posed`) in random postures."""
    rng = np.random.default_rng(SEED)
    chances, worst = np.empty(N_VIEWS), np.full(N_VIEWS, np.inf)
    for k, quaternion in enumerate(rng.normal(size=(N_VIEWS, 4))):
        posture = one.random_posture(rng) if posed else one.points
        points = posture @ rotation_from_quaternion(quaternion / np.linalg.norm(quaternion)).T
        s = scale_of(points)
        moves = NOISE_PIXELS * sensitivity(one, points, s)
        draws = np.abs(rng.normal(size=(N_DRAWS, moves.shape[1])) @ moves.T).max(axis=1)
        chances[k] = (draws <= one.bound).mean()
        image = points[:, :2] * s + NOISE_PIXELS * rng.normal(size=(len(points), 2))
        if (found := one.recovered(points, s, image)) is not None:
            worst[k] = np.abs(joint_angles(found, one.triples) - joint_angles(posture, one.triples)).max()
    solvable, within = chances >= SOLVABLE, worst <= one.bound
    share = within[solvable].sum() / max(solvable.sum(), 1)
    here = (
        f"{int(solvable.sum())} of {N_VIEWS} views are solvable, of these {share:.1%} are within; of all "
        f"{within.mean():.1%}"
    )
    words = {**_words(one), "posed": ", any posture" if posed else "", "expected": chances.mean()}
    return row("any-view", here, None, **words)


def sensitivity(one: Constrained, points: Array, s: float) -> Array:
    """Return the errors (A, M) of A joint angles, degrees, that M independent image errors of one pixel cause.

    Parameters
    ----------
    one : Constrained
        The object, with its constraint.
    points : array (P, 3)
        The true posture, camera frame, units of length.
    s : float
        Pixels per unit of length.
    """
    X = points - [0.0, 0.0, points[0, 2]]
    gradients = []
    for a, b in one.linkage.segments:
        gradient = np.zeros_like(X)
        gradient[b], gradient[a] = X[b] - X[a], X[a] - X[b]
        gradients.append(gradient)
    planes = [] if one.constraint == "closure" else one.linkage.coplanar
    for a, b, c, d in ((a, b, c, d) for a, b, c, *rest in planes for d in rest):
        first, second, third = X[b] - X[a], X[c] - X[a], X[d] - X[a]
        gradient = np.zeros_like(X)
        gradient[b], gradient[c] = np.cross(second, third), np.cross(third, first)
        gradient[d] = np.cross(first, second)
        gradient[a] = -gradient.sum(axis=0)
        gradients.append(gradient)
    depth = np.zeros_like(X)
    depth[0, 2] = 1.0
    rows = np.stack([each.ravel() for each in (*gradients, depth)])
    rows = np.column_stack([rows / np.linalg.norm(rows, axis=1, keepdims=True), np.zeros(len(rows))])
    _, values, axes = np.linalg.svd(rows)
    free = axes[int((values > FREE_RATIO * values[0]).sum()) :].T
    H = np.zeros((len(X), 2, X.size + 1))
    for k, point in enumerate(X):
        H[k, 0, 3 * k] = H[k, 1, 3 * k + 1] = s
        H[k, :, -1] = point[:2]
    _, sizes, axes = np.linalg.svd(H.reshape(-1, X.size + 1) @ free, full_matrices=False)
    step = ANGLE_STEP * float(np.ptp(X))
    moved = step * np.eye(X.size).reshape(X.size, *X.shape)
    angles = (joint_angles(X + moved, one.triples) - joint_angles(X - moved, one.triples)).T / (2 * step)
    return np.asarray(angles @ (free @ (axes.T / np.maximum(sizes, FREE_RATIO)))[:-1])


def _words(one: Constrained) -> dict[str, object]:
    degrees = "degrees" if one.bound > 1 else "degree"
    return {"figure": one.figure, "constraint": one.constraint, "bound": one.bound, "degrees": degrees}


def scale_of(points: Array) -> float:
    """Return the scale, pixels per unit of length, at which an object's image has the size `SIZE_PIXELS`."""
    return SIZE_PIXELS / float(np.linalg.norm(np.ptp(points[:, :2], axis=0)))


def _folded(lengths: Array, diagonal: float) -> Array:
    """Return the points (4, 3) of a planar chain of four bars, whose first and third points are `diagonal` apart."""
    ab, bc, cd, da = lengths
    b = (ab**2 - bc**2 + diagonal**2) / (2 * diagonal)
    d = (da**2 - cd**2 + diagonal**2) / (2 * diagonal)
    heights = np.sqrt(ab**2 - b**2), np.sqrt(da**2 - d**2)
    return np.array([[0, 0, 0], [b, heights[0], 0], [diagonal, 0, 0], [d, heights[1], 0]])


def _laid(lengths: Array, turns: Sequence[float] | Array) -> Array:
    """Return the points (6, 3) of the flat chain; `turns` are the angles between successive segments, degrees."""
    heading = np.radians(np.concatenate([[0.0], np.cumsum(turns)]))
    steps = lengths[:, None] * np.stack([np.cos(heading), np.sin(heading), 0 * heading], axis=1)
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def _turned(points: Array, *, tilt: float, spin: float) -> Array:
    """Rotate a flat object by `spin` in its plane, and tilt the plane relative to the image by `tilt`, degrees."""
    x, z = np.radians([tilt, spin])
    tilted = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    spun = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    return np.asarray(points @ (tilted @ spun).T)
