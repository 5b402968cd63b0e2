"""Taylor's Figs. 7 and 8 from random directions: which views can be solved at all, and how well these are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.formats.markdown import table_lines
from posekit.geometry import Array, rotation_from_quaternion
from posekit.linkages import LinkageFamily, name_nearer, search
from posekit.measures import joint_angles
from posekit.papers.taylor_constrained import (
    NOISE_PIXELS,
    OBJECT_SIZE_PIXELS,
    Constrained,
    random_posture,
    triples_of,
)
from posekit.papers.taylor_sensitivity import ConstrainedChain

N_VIEWS = 1000
"""Random views of each object."""

N_DRAWS = 1000
"""Draws of the noise from which a view's chance is told."""

CHANCE_CLASSES = ((0.99, 1.0), (0.95, 0.99), (0.5, 0.95), (0.0, 0.5))
"""Chances by which views are told apart, the most certain first."""

SOLVABLE_CHANCE = 0.95
"""Chance of every angle within the print's bound from which a view can be solved."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RandomViews:
    """N views of an object from random directions, with noise.

    Parameters
    ----------
    constrained : Constrained
        The object.
    posed : bool
        Whether each view is of another posture.
    chance : array (N,)
        That every angle is within the print's bound, by the sensitivity at the true posture, to first order.
    deviation : array (N,)
        Standard deviation (degrees) of the least certain angle, likewise.
    by_image, by_scale : array (N,)
        How far depth moves (`ConstrainedChain.depth_factors`).
    worst : array (N,)
        Largest difference (degrees) of an angle, recovered and true; infinite where no scale has a least residual.
    """

    constrained: Constrained
    posed: bool
    chance: Array
    deviation: Array
    by_image: Array
    by_scale: Array
    worst: Array

    @property
    def title(self) -> str:
        """What was looked at."""
        return f"like {self.constrained.figure}{', any posture' if self.posed else ''}"

    @property
    def solvable(self) -> NDArray[np.bool_]:
        """Which views can be solved (N,): in 95 of 100 pictures of them every angle is within the bound."""
        return np.asarray(self.chance >= SOLVABLE_CHANCE)

    def within(self, views: NDArray[np.bool_]) -> float:
        """Return the share of some views of which all angles are within the print's bound."""
        return float((self.worst[views] <= self.constrained.printed).mean())

    def plain(self) -> dict[str, object]:
        """Return the counts as JSON has them."""
        bound = self.constrained.printed
        return {
            "object": self.title,
            "views": len(self.chance),
            "solvable": int(self.solvable.sum()),
            "solvable_within": int((self.worst[self.solvable] <= bound).sum()),
            "within": int((self.worst <= bound).sum()),
            "within_expected": float(self.chance.sum()),
        }


def view_at_random(
    constrained: Constrained, views: int = N_VIEWS, seed: int = 2000, *, posed: bool = False
) -> RandomViews:
    """Look at an object from random directions, uniform over the sphere, flips given by hand (§3.3).

    Parameters
    ----------
    constrained : Constrained
        The object.
    views : int
        How many.
    seed : int
        Of directions, postures and noise.
    posed : bool
        Whether each view is of another posture (`posekit.papers.taylor_constrained.random_posture`).
    """
    one, rng = constrained, np.random.default_rng(seed)
    closed = one.constraint == "closure"
    chain = ConstrainedChain(
        linkage=one.linkage,
        planes=[] if closed else [(a, b, c, d) for a, b, c, *rest in one.linkage.coplanar for d in rest],
        triples=triples_of(len(one.points), closed=closed),
    )
    rows = []
    for quaternion in rng.normal(size=(views, 4)):
        posture = random_posture(one, rng) if posed else one.points
        true = joint_angles(posture, chain.triples)
        points = posture @ rotation_from_quaternion(quaternion / np.linalg.norm(quaternion)).T
        s = OBJECT_SIZE_PIXELS / float(np.linalg.norm(np.ptp(points[:, :2], axis=0)))
        moves = NOISE_PIXELS * chain.sensitivity(points, s)
        draws = np.abs(rng.normal(size=(N_DRAWS, moves.shape[1])) @ moves.T).max(axis=1)
        image = points[:, :2] * s + NOISE_PIXELS * rng.normal(size=(len(points), 2))
        found = _recovered(one, points, s, image)
        worst = np.inf if found is None else np.abs(joint_angles(found, chain.triples) - true).max()
        least_certain = np.linalg.norm(moves, axis=1).max()
        rows.append(((draws <= one.printed).mean(), least_certain, *chain.depth_factors(points), worst))
    columns = np.array(rows).T
    return RandomViews(
        constrained=one,
        posed=posed,
        chance=columns[0],
        deviation=columns[1],
        by_image=columns[2],
        by_scale=columns[3],
        worst=columns[4],
    )


def _recovered(one: Constrained, truth: Array, s: float, image: Array) -> Array | None:
    """Return the posture whose scale has the least residual; None where none has."""
    flips = LinkageFamily(linkage=one.linkage, image=truth[:, :2] * s).flips_of(truth)
    family = LinkageFamily(linkage=one.linkage, image=image)
    found = search(family, {one.constraint: 1.0}, nearer=name_nearer(one.linkage, flips))
    if not len(found):
        return None
    return np.asarray(family.points(found.s[0], flips * ~family.vanished(found.s[0])))


def random_views_lines(studies: Sequence[RandomViews]) -> list[str]:
    """Lay out in Markdown what can be solved, and what was."""
    head = (
        "object",
        "chance by the sensitivity",
        "views",
        "deviation of the worst angle, median",
        "depth by image point, median",
        "depth by scale, median",
        "expected within",
        "within",
    )
    rows = []
    for study in studies:
        bound = study.constrained.printed
        every = (0.0, 1.0)
        for low, high in (*CHANCE_CLASSES, every):
            some = (study.chance >= low) & ((study.chance < high) | (high == 1.0))
            if not some.any():
                continue
            name = "all" if (low, high) == every else f"{low:.0%} to {high:.0%}"
            rows.append(
                (
                    f"{study.title}, {bound:g}°",
                    name,
                    int(some.sum()),
                    f"{np.median(study.deviation[some]):.2f}°",
                    f"{np.median(study.by_image[some]):.1f}",
                    f"{np.median(study.by_scale[some]):.1f}",
                    f"{study.chance[some].mean():.1%}",
                    f"{study.within(some):.1%}",
                )
            )
    said = []
    for study in studies:
        solvable, bound = study.solvable, study.constrained.printed
        said.append(
            f"- {study.title[0].upper()}{study.title[1:]}: {int(solvable.sum())} of {len(solvable)} random views can "
            f"be solved; of these {study.within(solvable):.1%} are within {bound:g}°. Of the others the noise lets "
            f"{study.chance[~solvable].mean():.1%} be so, and {study.within(~solvable):.1%} are."
        )
    return [
        "The same objects from random directions, uniform over the sphere, as they are and in any posture. A view "
        f"can be solved where the sensitivity says that {NOISE_PIXELS:g} pixel of noise leaves every angle within the "
        f"print's bound in {SOLVABLE_CHANCE:.0%} of its pictures. *Depth by image point*: pixels by which one pixel "
        "moves the depth of the worst segment, which lies nearly in the plane of the picture; *by scale*: percent of "
        "its length by which one percent of s moves it.",
        "",
        *table_lines(head, rows),
        *said,
        "",
    ]
