"""What the points of a COCO-like file are: by the names in it, by their number, or as the user says."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from posekit.formats.skeleton_maps import SkeletonMap, find_by_names, find_by_order
from posekit.formats.skeleton_maps.skeleton_map import plain
from posekit.safe_io import cut, refusal, shown

NEVER_GUESSED: Final = ("h36m_17",)
"""Human3.6M has as many points as COCO, and files that do not name them are COCO's."""


def layout_of(
    source: str | Path, format: str, count: int, names: Sequence[str], given: SkeletonMap | None
) -> SkeletonMap:
    """Choose the layout of a file's points.

    Parameters
    ----------
    source, format : str
        The file and the format's name, for errors.
    count : int
        Points of a person.
    names : sequence of str
        The file's own names for them; empty where it has none.
    given : SkeletonMap, optional
        The user's choice: it counts before the names, the names before the number.

    Returns
    -------
    SkeletonMap
        With `count` points.

    Raises
    ------
    InputError
        Where names and number do not fit together or to the given map, and where no map fits, or several.
    """
    if names and len(names) != count:
        got = f"{len(names)} names for {count} points"
        raise refusal(source, "categories", got, "a name for each", "correct the names")
    if given is not None:
        return _as_given(source, count, names, given)
    if names:
        return _by_names(source, names)
    candidates = [one for one in find_by_order(count) if one.name not in NEVER_GUESSED]
    if len(candidates) == 1:
        return candidates[0]
    if candidates:
        got = f"{count} points that could be of several orders"
        remedy = f"say which with --skeleton, as --skeleton {candidates[0].name}"
        raise refusal(source, "format", got, " or ".join(one.name for one in candidates), remedy)
    expected = "a number that a built-in skeleton map has"
    remedy = "give a map that names them in order with --skeleton"
    raise refusal(source, "points of a person", f"{count} without names", expected, remedy)


def _as_given(source: str | Path, count: int, names: Sequence[str], given: SkeletonMap) -> SkeletonMap:
    known = {plain(name) for name in names}
    if names and all(plain(name) in known for name in given.needed):
        return given.over(names)
    if len(given.points) == count:
        return given
    missing = [name for name in given.needed if plain(name) not in known]
    got = f"{count} points" + (f" without {', '.join(missing[:3])}" if names else " without names")
    expected = f"what skeleton map {cut(given.name)} names ({len(given.points) or len(given.needed)} points)"
    raise refusal(source, "points of a person", got, expected, "choose the map of the detector's model")


def _by_names(source: str | Path, names: Sequence[str]) -> SkeletonMap:
    known = [plain(name) for name in names]
    if len(set(known)) != len(known):
        twice = next(name for name, one in zip(names, known, strict=True) if known.count(one) > 1)
        raise refusal(source, "categories", f"{shown(twice)} twice", "each name once", "rename one of them")
    fitting = find_by_names(names, detectors=True)
    if not fitting:
        raise refusal(
            source,
            "categories",
            f"points named {shown(list(names[:6]))}{', …' if len(names) > 6 else ''}",
            "names of shoulders, elbows, wrists, hips, knees and ankles as a built-in skeleton map has them",
            "give a map with these names with --skeleton",
        )
    best = fitting[0]
    return best if [plain(name) for name in best.points] == known else best.over(names)
