"""Which built-in map a file's points fit."""

from __future__ import annotations

from collections.abc import Sequence

from posekit.skeleton_map.reading import load_skeleton_map, skeleton_map_names
from posekit.skeleton_map.skeleton_map import LANDMARKS, SkeletonMap, plain


def find_by_names(names: Sequence[str]) -> list[SkeletonMap]:
    """List the built-in maps that some names fit, the one that places most landmarks first.

    A map fits where it places shoulders, hips, and both ends of every limb; names are compared without case and
    punctuation.
    """
    there = {plain(name) for name in names}
    ranked = []
    for candidate in map(load_skeleton_map, skeleton_map_names()):
        placed = [
            landmark
            for landmark, parts in candidate.landmarks.items()
            if all(plain(part) in there for part in parts)
        ]
        if set(LIMBS) <= set(placed):
            ranked.append((len(placed), candidate))
    return [candidate for _, candidate in sorted(ranked, key=lambda one: (-one[0], one[1].name))]


def find_by_order(count: int) -> list[SkeletonMap]:
    """List the built-in maps of formats with so many points."""
    return [one for one in map(load_skeleton_map, skeleton_map_names()) if len(one.points) == count]


LIMBS = tuple(
    name for name in LANDMARKS if name.startswith(("right_", "left_")) and not name.endswith(("_eye", "_ear"))
)
