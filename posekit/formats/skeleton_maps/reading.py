"""Skeleton maps by name or from TOML files of schema `posekit.skeleton_map/1`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from posekit.formats.skeleton_maps.skeleton_map import LANDMARK_ORDER, SkeletonMap, plain
from posekit.safe_io import nearest, refusal, shown
from posekit.skeleton import FEET_POINTS, other_side

if TYPE_CHECKING:
    from posekit.tables.skeleton_map import SkeletonMapTable

_FOLDER: Final = "skeleton_maps"


def skeleton_map_names() -> tuple[str, ...]:
    """Return the names of the built-in maps."""
    from posekit.tables.reading import built_in_names

    return built_in_names(_FOLDER)


def load_skeleton_map(name: str | Path) -> SkeletonMap:
    """Load a skeleton map by name or from a TOML file.

    Raises
    ------
    InputError
        Where there is no such map, or it is not what `posekit.skeleton_map/1` says.

    Examples
    --------
    >>> load_skeleton_map("coco_17").landmarks["right_wrist"]
    ('right_wrist',)
    """
    from posekit.tables.reading import named_table
    from posekit.tables.skeleton_map import SkeletonMapTable

    return named_table(name, SkeletonMapTable, skeleton_map_of, folder=_FOLDER, what="skeleton map")


def skeleton_map_of(table: SkeletonMapTable, name: str) -> SkeletonMap:
    """Make a skeleton map of its table.

    Parameters
    ----------
    table : SkeletonMapTable
        What a file says.
    name : str
        The file, or the built-in map: what errors call it.

    Raises
    ------
    InputError
        Where a landmark is not known, or a point is not one of the format's, or two are alike.
    """
    points = tuple(table.points)
    known = [plain(point) for point in points]
    alike = [point for point, word in zip(points, known, strict=True) if not word or known.count(word) > 1]
    if alike:
        expected = "names that differ in their letters and digits"
        raise refusal(name, "points", shown(alike[0]), expected, "rename it")
    landmarks = _placed(table.landmarks, "landmarks", LANDMARK_ORDER, points, name)
    feet = _placed(table.feet, "feet", FEET_POINTS, points, name)
    return SkeletonMap(
        name=name,
        points=points,
        landmarks=MappingProxyType(landmarks),
        source=table.source,
        feet=MappingProxyType(feet),
    )


def _placed(
    table: Mapping[str, Sequence[str]], title: str, order: Sequence[str], points: Sequence[str], name: str
) -> dict[str, tuple[str, ...]]:
    landmarks = {landmark: tuple(parts) for landmark, parts in table.items()}
    for landmark, parts in landmarks.items():
        field = f"{title}.{landmark}"
        if landmark not in order:
            raise refusal(name, field, "an unknown landmark", "a known one", nearest(landmark, order))
        if len(set(parts)) != len(parts):
            raise refusal(name, field, shown(parts), "each name once", "remove the repeated one")
        unknown = [part for part in parts if points and part not in points]
        if unknown:
            raise refusal(name, field, shown(unknown[0]), "one of the points", nearest(unknown[0], points))
        if other_side(landmark) != landmark and landmarks.get(other_side(landmark)) == parts:
            got = f"{shown(parts)}, as {other_side(landmark)}"
            raise refusal(name, field, got, "points of its own for each side", "correct one of the two")
    return landmarks
