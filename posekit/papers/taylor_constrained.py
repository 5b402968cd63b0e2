"""The objects of Taylor's Figs. 7 and 8: a closed chain and a flat one, whose shape fixes the scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from posekit.formats.markdown import table_lines
from posekit.geometry import Array
from posekit.linkages import Linkage, LinkageFamily, Minima, load_linkage, name_nearer, search
from posekit.measures import joint_angles

OBJECT_SIZE_PIXELS = 600.0
"""Pixels: how large an object is in its picture."""

NOISE_PIXELS = 1.0
"""Pixels, standard deviation of each coordinate."""

DIAGONAL_MILLIMETRES = 140.0
"""Millimetres between a and c, over which the four bars are folded."""

TURN_DEGREES = (50.0, 110.0, 110.0, 80.0)
"""Degrees by which the flat chain turns at its points of articulation."""


MOST_TURN = 150.0
"""Degrees by which a random chain turns at most: beyond, segments lie on each other."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Constrained:
    """An object like one of the paper's, and what comes out of its pictures.

    The paper prints neither lengths nor postures: these are posekit's own.

    Parameters
    ----------
    figure : str
        The paper's figure.
    constraint : str
        What fixes the scale.
    printed : float
        Degrees: the paper's largest difference between an angle recovered and measured.
    linkage : Linkage
        The object, with its constraint.
    points : array (P, 3)
        The true posture, camera frame.
    worst : array (N,)
        The largest difference (degrees) in each of N pictures with noise.
    found : Minima
        The search in a picture without noise, all flips free.
    s : float
        The true scale of that picture, pixels a unit of length.
    """

    figure: str
    constraint: Literal["closure", "coplanar"]
    printed: float
    linkage: Linkage
    points: Array
    worst: Array
    found: Minima
    s: float


def constrained(pictures: int = 200, seed: int = 2000) -> list[Constrained]:
    """Recover both objects from pictures with a noise of one pixel, flips given by hand as in the paper (§3.3)."""
    four_bar, chain = load_linkage("four_bar"), load_linkage("planar_chain")
    return [
        _measure(
            "Fig. 7",
            "closure",
            1.0,
            four_bar,
            _turn(_folded(four_bar.lengths, DIAGONAL_MILLIMETRES), 50, 220),
            pictures,
            seed,
        ),
        _measure(
            "Fig. 8",
            "coplanar",
            2.0,
            chain,
            _turn(_laid(chain.lengths, TURN_DEGREES), 45, 60),
            pictures,
            seed,
        ),
    ]


def constrained_lines(objects: Sequence[Constrained]) -> list[str]:
    """Lay out what was measured in Markdown."""
    head = (
        "object",
        "constraint",
        "print: always below",
        "median",
        "95 %",
        "within the print's bound",
        "true s off by",
    )
    rows = [
        (
            f"like {one.figure}",
            one.constraint,
            f"{one.printed:g} degree{'s' if one.printed > 1 else ''}",
            f"{np.median(one.worst):.2f}",
            f"{np.percentile(one.worst, 95):.2f}",
            f"{(one.worst <= one.printed).mean():.1%}",
            f"{np.abs(one.found.s / one.s - 1).min():.1g}",
        )
        for one in objects
    ]
    minima = [
        f"- {one.figure}: without noise {len(one.found)} local minima over {one.found.n_flips} flips, "
        f"{int((one.found.residual < 1e-20).sum())} of them with no residual left; the true scale is among these."
        for one in objects
    ]
    return [
        f"The largest difference between the angles at the joints, recovered and true, in {len(objects[0].worst)} "
        f"synthetic pictures, {OBJECT_SIZE_PIXELS:g} pixels large, with {NOISE_PIXELS:g} pixel of noise; "
        "the last column without noise.",
        "",
        *table_lines(head, rows),
        *minima,
        "",
    ]


def _measure(
    figure: str,
    constraint: Literal["closure", "coplanar"],
    printed: float,
    linkage: Linkage,
    points: Array,
    pictures: int,
    seed: int,
) -> Constrained:
    s = OBJECT_SIZE_PIXELS / float(np.linalg.norm(np.ptp(points[:, :2], axis=0)))
    exact = LinkageFamily(linkage=linkage, image=points[:, :2] * s)
    flips = exact.flips_of(points)
    nearer = name_nearer(linkage, flips)
    triples = triples_of(len(points), closed=constraint == "closure")
    true = joint_angles(points, triples)
    rng = np.random.default_rng(seed)
    worst = np.full(pictures, np.inf)
    for k in range(pictures):
        family = LinkageFamily(
            linkage=linkage, image=points[:, :2] * s + NOISE_PIXELS * rng.normal(size=(len(points), 2))
        )
        found = search(family, {constraint: 1.0}, nearer=nearer)
        if len(found):
            recovered = family.points(found.s[0], flips * ~family.vanished(found.s[0]))
            worst[k] = np.abs(joint_angles(recovered, triples) - true).max()
    return Constrained(
        figure=figure,
        constraint=constraint,
        printed=printed,
        linkage=linkage,
        points=points,
        worst=worst,
        found=search(exact, {constraint: 1.0}),
        s=s,
    )


def triples_of(n: int, *, closed: bool) -> list[tuple[int, int, int]]:
    """Return the points before, at and after each joint of a chain."""
    joints = range(n) if closed else range(1, n - 1)
    return [((k - 1) % n, k, (k + 1) % n) for k in joints]


def random_posture(one: Constrained, rng: np.random.Generator) -> Array:
    """Fold or lay the object at random, in a plane: any diagonal that closes it, any turns up to `MOST_TURN`."""
    lengths = one.linkage.lengths
    if one.constraint == "coplanar":
        return _laid(lengths, rng.uniform(-MOST_TURN, MOST_TURN, len(lengths) - 1))
    ab, bc, cd, da = lengths
    # At either end a pair of bars lies straight, and its height is the root of zero.
    shortest, longest = max(abs(ab - bc), abs(cd - da)), min(ab + bc, cd + da)
    return _folded(lengths, shortest + rng.uniform(0.05, 0.95) * (longest - shortest))


def _folded(lengths: Array, diagonal: float) -> Array:
    """Lay the four bars into a plane (4, 3), folded over their diagonal."""
    ab, bc, cd, da = lengths
    b = (ab**2 - bc**2 + diagonal**2) / (2 * diagonal)
    d = (da**2 - cd**2 + diagonal**2) / (2 * diagonal)
    return np.array(
        [
            [0, 0, 0],
            [b, np.sqrt(ab**2 - b**2), 0],
            [diagonal, 0, 0],
            [d, np.sqrt(da**2 - d**2), 0],
        ]
    )


def _laid(lengths: Array, turns: ArrayLike) -> Array:
    """Lay the chain into a plane (6, 3), turning at each point of articulation."""
    heading = np.radians(np.concatenate([[0.0], np.cumsum(turns)]))
    steps = lengths[:, None] * np.stack([np.cos(heading), np.sin(heading), 0 * heading], axis=1)
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def _turn(points: Array, tilt: float, spin: float) -> Array:
    """Spin an object in its plane and tilt the plane away from the image's, by degrees."""
    x, z = np.radians([tilt, spin])
    tilted = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    spun = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    return np.asarray(points @ (tilted @ spun).T)
