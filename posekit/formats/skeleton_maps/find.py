"""Which built-in map a file's points fit."""

from __future__ import annotations

from collections.abc import Sequence

from posekit.formats.skeleton_maps.reading import load_skeleton_map, skeleton_map_names
from posekit.formats.skeleton_maps.skeleton_map import LANDMARK_ORDER, SkeletonMap, plain


def find_by_names(names: Sequence[str], *, detectors: bool = False) -> list[SkeletonMap]:
    """List the built-in maps that some names fit, best first.

    Parameters
    ----------
    names : sequence of str
        A file's points; compared without case and punctuation.
    detectors : bool
        Whether to look at the maps of detectors alone, which are those with an order. What a detector calls neck is the
        middle of the shoulders, and in motion capture a joint.

    Returns
    -------
    list of SkeletonMap
        Those that place shoulders, hips, and both ends of every limb: first one with just these names, then the one
        that places most landmarks; among equals the one whose points differ least from the names.

    Examples
    --------
    >>> from posekit.formats.skeleton_maps import load_skeleton_map
    >>> [one.name for one in find_by_names(load_skeleton_map("coco_17").points)][:1]
    ['coco_17']
    """
    there = {plain(name) for name in names}
    ranked = []
    for candidate in map(load_skeleton_map, skeleton_map_names()):
        if detectors and not candidate.points:
            continue
        placed = [
            landmark
            for landmark, parts in candidate.landmarks.items()
            if all(plain(part) in there for part in parts)
        ]
        if set(LIMB_LANDMARKS) <= set(placed):
            others = len(there ^ {plain(point) for point in candidate.points})
            ranked.append((others > 0, -len(placed), others, candidate.name, candidate))
    return [candidate for *_, candidate in sorted(ranked, key=lambda one: one[:4])]


def find_by_order(count: int) -> list[SkeletonMap]:
    """List the built-in maps of formats with so many points: several where a number alone does not tell."""
    return [one for one in map(load_skeleton_map, skeleton_map_names()) if len(one.points) == count]


LIMB_LANDMARKS = tuple(
    name
    for name in LANDMARK_ORDER
    if name.startswith(("right_", "left_")) and not name.endswith(("_eye", "_ear"))
)
