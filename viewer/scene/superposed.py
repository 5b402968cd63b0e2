"""What superposed postures have in common, and what tells their groups apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.geometry import Array
from posekit.skeleton import POINTS, TREE_SEGMENTS
from posekit.viewer.scene.colours import GROUP_RGB, MIDDLE_RGB, Rgb
from posekit.viewer.scene.drawn_posture import Look
from posekit.viewer.scene.drawn_subject import Shown

SAME_POINT_METRES = 1e-3
"""Metres: what is nearer than this in every point is drawn once."""


def superposed_looks(shown: Shown, figure: Figure) -> list[Look]:
    """Return how each of several superposed postures is drawn.

    What several have in common (a limb that points the same way) is drawn with the first of them only: else
    translucent bodies would add up to a solid one. Where the postures are of several groups, a capsule that one
    group has alone is in that group's colour, and one that groups share is grey; where all are shared, sides have
    their colours.

    Parameters
    ----------
    shown : Shown
        N postures.
    figure : Figure
        Whose capsules.

    Returns
    -------
    list of N Look
    """
    count, placed = len(shown), shown.aligned_points
    groups = None if shown.groups is None or len(set(shown.groups.tolist())) < 2 else shown.groups
    without: list[set[str]] = [set() for _ in range(count)]
    colours: list[dict[str, Rgb]] = [{} for _ in range(count)]
    for name, points in _parts(figure):
        first = _first(placed[:, list(points)])
        for k in np.flatnonzero(first != np.arange(count)):
            without[k].add(name)
        if groups is not None:
            for k in np.unique(first):
                owners = set(groups[first == k].tolist())
                colours[k][name] = (
                    GROUP_RGB[owners.pop() % len(GROUP_RGB)] if len(owners) == 1 else MIDDLE_RGB
                )
    if all(colour == MIDDLE_RGB for own in colours for colour in own.values()):
        colours = [{} for _ in range(count)]  # groups that differ in combination alone: sides say more
    return [Look(body=body, without=frozenset(names)) for body, names in zip(colours, without, strict=True)]


def _parts(figure: Figure) -> Sequence[tuple[str, tuple[int, ...]]]:
    """Name all that is drawn of a body, with the points that place it."""
    return [
        *((capsule.link, capsule.points) for capsule in figure.capsules),
        *((point, (index,)) for index, point in enumerate(POINTS)),
        *((f"bone-{POINTS[child]}", (parent, child)) for parent, child in TREE_SEGMENTS),
    ]


def _first(points: Array) -> NDArray[np.intp]:
    """Return for each posture's points (N, K, 3) the first posture that has them in the same place (N,)."""
    # NaN is not equal to itself: unknown points are put at infinity, where all are one.
    steps = np.where(np.isnan(points), np.inf, np.round(points / SAME_POINT_METRES)).reshape(len(points), -1)
    _, first, inverse = np.unique(steps, axis=0, return_index=True, return_inverse=True)
    return np.asarray(first[inverse.reshape(-1)])
