"""Skeleton maps by name or from TOML files of schema `posekit.skeleton_map/1`."""

from __future__ import annotations

from functools import cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from posekit.formats.skeleton_maps.skeleton_map import LANDMARK_ORDER, SkeletonMap, plain
from posekit.safe_io import nearest, refusal, shown
from posekit.skeleton import other_side

if TYPE_CHECKING:
    from posekit.tables.skeleton_map import SkeletonMapTable


@cache
def skeleton_map_names() -> tuple[str, ...]:
    """Return the names of the built-in maps."""
    folder = resources.files("posekit.urdf") / "skeleton_maps"
    return tuple(
        sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))
    )


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
    from posekit.tables.reading import read_table
    from posekit.tables.skeleton_map import SkeletonMapTable

    if str(name) in skeleton_map_names():
        return _built_in(str(name))
    path = Path(name)
    if path.suffix.lower() != ".toml":
        raise refusal(
            "",
            "skeleton map",
            shown(str(name)),
            "a built-in map or a TOML file",
            nearest(str(name), skeleton_map_names()),
        )
    return skeleton_map_of(read_table(path, SkeletonMapTable), str(path))


@cache
def _built_in(name: str) -> SkeletonMap:
    from posekit.tables.reading import read_built_in
    from posekit.tables.skeleton_map import SkeletonMapTable

    return skeleton_map_of(read_built_in("skeleton_maps", name, SkeletonMapTable), name)


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
    landmarks = {landmark: tuple(parts) for landmark, parts in table.landmarks.items()}
    for landmark, parts in landmarks.items():
        field = f"landmarks.{landmark}"
        if landmark not in LANDMARK_ORDER:
            raise refusal(
                name, field, "an unknown landmark", "a known one", nearest(landmark, LANDMARK_ORDER)
            )
        if len(set(parts)) != len(parts):
            raise refusal(name, field, shown(parts), "each name once", "remove the repeated one")
        unknown = [part for part in parts if points and part not in points]
        if unknown:
            raise refusal(name, field, shown(unknown[0]), "one of the points", nearest(unknown[0], points))
        if other_side(landmark) != landmark and landmarks.get(other_side(landmark)) == parts:
            got = f"{shown(parts)}, as {other_side(landmark)}"
            raise refusal(name, field, got, "points of its own for each side", "correct one of the two")
    return SkeletonMap(name=name, points=points, landmarks=MappingProxyType(landmarks), source=table.source)
