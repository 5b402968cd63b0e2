"""Skeleton maps by name or from TOML files of schema `posekit.skeleton_map/1`."""

from __future__ import annotations

from functools import cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from posekit.formats.skeleton_maps.skeleton_map import LANDMARKS, SkeletonMap, plain
from posekit.safe_io import nearest, parse_toml, read_toml, refusal, shown
from posekit.skeleton import other_side

SCHEMA: Final = "posekit.skeleton_map/1"
MAX_BYTES: Final = 1_000_000
MAX_POINTS: Final = 1000
FIELDS: Final = ("schema", "source", "points", "landmarks")


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
    return parse_skeleton_map(read_toml(path, limit=MAX_BYTES), str(path))


@cache
def _built_in(name: str) -> SkeletonMap:
    text = (resources.files("posekit.urdf") / "skeleton_maps" / f"{name}.toml").read_text("utf-8")
    return parse_skeleton_map(parse_toml(text, name), name)


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
    known = [plain(point) for point in points]
    if len(set(known)) != len(known) or "" in known:
        same = next(
            point for point, name in zip(points, known, strict=True) if not name or known.count(name) > 1
        )
        raise refusal(
            source, "points", shown(same), "names that differ in their letters and digits", "rename it"
        )
    entries = table.get("landmarks")
    if not isinstance(entries, dict) or not entries:
        raise refusal(source, "landmarks", shown(entries), "a table", "name the points under [landmarks]")
    landmarks = {name: _parts(name, entry, points, source) for name, entry in entries.items()}
    for name, parts in landmarks.items():
        if other_side(name) != name and landmarks.get(other_side(name)) == parts:
            raise refusal(
                source,
                f"landmarks.{name}",
                f"{shown(list(parts))}, as {other_side(name)}",
                "points of its own for each side",
                "correct one of the two",
            )
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
    if len(set(parts)) != len(parts):
        raise refusal(source, field, shown(parts), "each name once", "remove the repeated one")
    for part in parts:
        if points and part not in points:
            raise refusal(source, field, shown(part), "one of the points", nearest(part, points))
    return tuple(parts)


def _is_name(entry: object) -> bool:
    return isinstance(entry, str) and bool(entry.strip())
