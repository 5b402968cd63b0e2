"""Which skeleton map a file's points fit: by their names, or by their number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from posekit.formats.skeleton_maps import (
    SkeletonMap,
    find_by_names,
    find_by_order,
    load_skeleton_map,
    skeleton_map_names,
)
from posekit.formats.skeleton_maps.skeleton_map import plain
from posekit.safe_io import cut, refusal, shown

MIN_FITTING_LANDMARKS = 4
"""Landmarks by name below which it is not said that a map fits in part."""


def by_names(names: Sequence[str], layout: SkeletonMap | None, source: str | Path) -> SkeletonMap:
    """Make the layout of a file that names its points.

    Parameters
    ----------
    names : sequence of str (K,)
        In the file's order.
    layout : SkeletonMap or None
        The user's; the built-in map that places most landmarks if None.

    Returns
    -------
    SkeletonMap
        Its points are the file's names. Where those are all the points of the map in its order, it is the map itself.

    Raises
    ------
    InputError
        Where names come twice, or no map places at least `MIN_FITTING_LANDMARKS` landmarks.
    """
    own = {plain(name): name for name in names}
    if len(own) != len(names):
        twice = next(name for name in names if own[plain(name)] != name or list(names).count(name) > 1)
        raise refusal(source, "points", f"{shown(twice)} twice", "each name once", "rename one of the two")
    candidates = [layout] if layout else find_by_names(names, detectors=True) or _in_part(own)
    for candidate in candidates:
        if [plain(name) for name in candidate.points] == list(own):
            return candidate
        laid = candidate.over(names)
        if len(laid.landmarks) >= MIN_FITTING_LANDMARKS:
            return replace(laid, name=f"{len(names)} points by the names of {candidate.name}")
    fitting = layout.name if layout else "any built-in skeleton map"
    got = f"names as {', '.join(shown(name) for name in list(names)[:4])}"
    expected = f"at least {MIN_FITTING_LANDMARKS} landmarks by the names of {fitting}"
    remedy = "write a skeleton map (TOML) that says which point is what, and give it with --skeleton"
    raise refusal(source, "points", got, expected, remedy)


def _in_part(own: dict[str, str]) -> list[SkeletonMap]:
    """List built-in maps that fit in part, the one with most landmarks first: legs alone, or one side."""
    ranked = []
    for candidate in map(load_skeleton_map, skeleton_map_names()):
        placed = sum(all(plain(part) in own for part in parts) for parts in candidate.landmarks.values())
        ranked.append((-placed, candidate.name, candidate))
    return [
        candidate
        for placed, _, candidate in sorted(ranked, key=lambda one: one[:2])
        if -placed >= MIN_FITTING_LANDMARKS
    ]


def by_count(
    count: int, layout: SkeletonMap | None, source: str | Path, usual: dict[int, SkeletonMap]
) -> SkeletonMap:
    """Find the layout of a file that does not name its points.

    Parameters
    ----------
    count : int
        Points of a person; 0 where the file has nobody, whom any map fits.
    usual : dict
        What the format's models write, by the number of points, the most usual first.

    Raises
    ------
    InputError
        Where the user's map has another number of points, or nothing usual has so many (what has is named).
    """
    if count == 0:
        return layout if layout is not None and layout.points else next(iter(usual.values()))
    if layout is not None:
        if len(layout.points) != count:
            expected = f"{len(layout.points)}, as the skeleton map {cut(layout.name)} has"
            remedy = f"leave the map out, or take {usual[count].name if count in usual else 'one of as many'}"
            raise refusal(source, "points", f"{count} a person", expected, remedy)
        return layout
    if count in usual:
        return usual[count]
    others = ", ".join(one.name for one in find_by_order(count)) or "none that is built in"
    expected = f"{', '.join(str(one) for one in sorted(usual))} points"
    remedy = f"say which with --skeleton (with {count} points: {others})"
    raise refusal(source, "points", f"{count} a person, unnamed", expected, remedy)
