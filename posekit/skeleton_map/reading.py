"""Skeleton maps by name or from TOML files of schema `posekit.skeleton_map/1`."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from posekit.intake import nearest, parse_toml, read_toml, refusal, shown
from posekit.skeleton_map.skeleton_map import LANDMARKS, SkeletonMap

SCHEMA: Final = "posekit.skeleton_map/1"
MAX_BYTES: Final = 1_000_000
MAX_POINTS: Final = 1000
FIELDS: Final = ("schema", "source", "points", "landmarks")


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
    if str(name) in skeleton_map_names():
        text = (resources.files("posekit.urdf") / "skeleton_maps" / f"{name}.toml").read_text("utf-8")
        return parse_skeleton_map(parse_toml(text, str(name)), str(name))
    path = Path(name)
    if path.suffix.lower() != ".toml":
        raise refusal(
            "",
            "skeleton map",
            shown(str(name)),
            "a built-in map or a TOML file",
            nearest(str(name), skeleton_map_names()),
        )
    return parse_skeleton_map(read_toml(path, limit=MAX_BYTES), str(path))


def parse_skeleton_map(table: dict[str, Any], source: str) -> SkeletonMap:
    """Make a skeleton map of a parsed TOML table.

    Raises
    ------
    InputError
        Where it is not what `posekit.skeleton_map/1` says.
    """
    if table.get("schema") != SCHEMA:
        raise refusal(
            source, "schema", shown(table.get("schema")), f'"{SCHEMA}"', "name it in the first line"
        )
    for field in table:
        if field not in FIELDS:
            raise refusal(source, field, "an unknown entry", f"{', '.join(FIELDS)}", "remove it")
    points = table.get("points", [])
    if not isinstance(points, list) or len(points) > MAX_POINTS or not all(map(_is_name, points)):
        raise refusal(
            source,
            "points",
            shown(points),
            f"up to {MAX_POINTS} names, in the format's order",
            "leave it out where files name their points",
        )
    if len(set(points)) != len(points):
        twice = next(name for name in points if points.count(name) > 1)
        raise refusal(source, "points", f"{shown(twice)} twice", "each name once", "rename one of the two")
    entries = table.get("landmarks")
    if not isinstance(entries, dict) or not entries:
        raise refusal(source, "landmarks", shown(entries), "a table", "name the points under [landmarks]")
    landmarks = {name: _parts(name, entry, points, source) for name, entry in entries.items()}
    return SkeletonMap(
        name=source,
        points=tuple(points),
        landmarks=MappingProxyType(landmarks),
        source=str(table.get("source", "")),
    )


def _parts(name: str, entry: object, points: list[str], source: str) -> tuple[str, ...]:
    field = f"landmarks.{name}"
    if name not in LANDMARKS:
        raise refusal(source, field, "an unknown landmark", "a known one", nearest(name, LANDMARKS))
    parts = [entry] if isinstance(entry, str) else entry
    if not isinstance(parts, list) or not parts or len(parts) > MAX_POINTS or not all(map(_is_name, parts)):
        raise refusal(
            source, field, shown(entry), "a point's name, or a list of names for their mean", "correct it"
        )
    for part in parts:
        if points and part not in points:
            raise refusal(source, field, shown(part), "one of the points", nearest(part, points))
    return tuple(parts)


def _is_name(entry: object) -> bool:
    return isinstance(entry, str) and bool(entry.strip())
