"""Collision: arms, legs, torso and head do not penetrate each other (Lee & Chen 1985, §3.2.C).

The collision bodies of the figure are capsules along its segments. The distance between two capsules is the distance
between their axes minus both radii; it has a closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import numpy as np

from posekit.body import Figure, load_figure
from posekit.body.capsules import CAPSULE_AXES
from posekit.geometry import dot, segment_distance, unit
from posekit.skeleton import JOINTS, POINTS
from posekit.tree.steps import CAPSULES, Step, step
from posekit.validators.body import Body, hips_share
from posekit.validators.check import Judgement

#: Tolerance for rounding, metres.
CONTACT_METRES: Final = 1e-9

#: Number of postures in one batch. It makes the overhead of NumPy small and fits into the processor's cache.
ROWS_AT_ONCE: Final = 512

#: Distance up to which the result is exact, metres. For capsules farther apart, the result is the distance between
#: their bounding spheres, which is a lower bound.
NEAR_METRES: Final = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class Collision:
    """Two parts of the body penetrate each other.

    Parameters
    ----------
    pairs : tuple of (str, str), optional
        Pairs of links; by default all pairs that the SRDF of the figure does not disable.
    """

    name = "collision"
    unit = "m"
    reads = ("joints",)

    pairs: tuple[tuple[str, str], ...] = ()

    @cached_property
    def points(self) -> tuple[str, ...]:
        """Names of the points that determine the positions of the capsules."""
        links = {link for pair in self.pairs or [tuple(CAPSULE_AXES)] for link in pair}
        read = {point for link in links for ends in CAPSULE_AXES[link] for point in ends}
        return tuple(POINTS[point] for point in sorted(read))

    @cached_property
    def parts(self) -> list[Collision]:
        """Return one check for all pairs with the same last joint in tree order; pairs with the head are separate."""
        groups: dict[tuple[bool, int], list[tuple[str, str]]] = {}
        for pair in _pairs(load_figure()):
            read = [point for link in pair for ends in CAPSULE_AXES[link] for point in ends]
            last = max(point for point in read if point < len(JOINTS))
            groups.setdefault(("head" in pair, last), []).append(pair)
        return [Collision(pairs=tuple(pairs)) for pairs in groups.values()]

    def steps(self, body: Body) -> list[Step] | None:
        """Return the check for the C++ tree search; None for pairs with the head and for measured bodies."""
        if body.tolerance is None or any("head" in pair for pair in self.pairs):
            return None
        capsules = {capsule.link: capsule for capsule in body.figure.capsules}
        found = []
        for links in self.pairs:
            pair = [capsules[link] for link in links]
            points = [point for one in pair for point in one.points]
            numbers = [number for one in pair for number in (one.center, one.half_length)]
            numbers += [pair[0].radius + pair[1].radius, body.contact_margin]
            place = "-".join(links)
            found.append(step(CAPSULES, [place], points=points, tolerance=CONTACT_METRES, numbers=numbers))
        return found

    def judge(self, body: Body) -> Judgement:
        """Measure the distances between the collision bodies of all pairs."""
        capsules = body.figure.capsules
        at = {capsule.link: k for k, capsule in enumerate(capsules)}
        head = np.isfinite(body.head).any()
        links = self.pairs or [pair for pair in _pairs(body.figure) if head or "head" not in pair]
        pairs = [(at[a], at[b]) for a, b in links]
        # Row 19 is the mean of the head points.
        points = np.concatenate([body.points, body.head.mean(axis=1, keepdims=True)], axis=1).swapaxes(0, 1)
        tops = [one.start[0] for one in capsules]
        ends = [one.end[0] if len(one.end) == 1 else len(POINTS) for one in capsules]
        axis = unit(points[ends] - points[tops])
        centre = np.array([one.center for one in capsules])[:, None, None]
        half = np.array([one.half_length for one in capsules])[:, None, None] * axis
        middle, count = points[tops] + centre * axis, len(body)
        one, other = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
        radius = [capsule.radius * _slimness(body, capsule.link) for capsule in capsules]
        radii = np.array([radius[a] + radius[b] for a, b in pairs])
        reach = np.array([capsules[a].half_length + capsules[b].half_length for a, b in pairs])
        distance = np.empty((len(pairs), count))
        for start in range(0, count, ROWS_AT_ONCE):
            rows = slice(start, start + ROWS_AT_ONCE)
            gap = middle[other, rows] - middle[one, rows]
            distance[:, rows] = np.sqrt(dot(gap, gap)) - (reach + radii)[:, None]
            near, row = np.nonzero(distance[:, rows] < NEAR_METRES + max(body.contact_margin, 0.0))
            axes = half[one[near], start + row], half[other[near], start + row]
            distance[near, start + row] = segment_distance(gap[near, row], *axes) - radii[near]
        return Judgement(
            ["-".join(pair) for pair in links],
            distance.T,
            lower=body.contact_margin,
            tolerance=CONTACT_METRES,
            scale=NEAR_METRES,
        )


@lru_cache(maxsize=8)
def _pairs(figure: Figure) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links that the SRDF of a figure does not disable."""
    return tuple((figure.capsules[a].link, figure.capsules[b].link) for a, b in figure.capsule_pairs)


def _slimness(body: Body, link: str) -> float:
    """Return a factor that multiplies a capsule's radius: below 1 for the legs of a person with narrow hips."""
    if not body.measured or not link.endswith(("thigh", "shank")):
        return 1.0
    return min(hips_share(body.lengths) / hips_share(body.base_figure.lengths), 1.0)
