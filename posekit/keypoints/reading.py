"""Read and write key points: which format a file is in, and the formats by name."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pathlib import Path

from posekit.errors import InputError
from posekit.intake import nearest, refusal, shown
from posekit.keypoints.format import Format
from posekit.keypoints.given import Given
from posekit.keypoints.keypoints import KeyPoints
from posekit.skeleton_map import SkeletonMap

_MODULES = (
    "openpose",
    "coco",
    "coco_results",
    "wholebody",
    "mediapipe",
    "mmpose",
    "mmpose_list",
    "alphapose",
    "deeplabcut",
)


@cache
def formats() -> dict[str, Format]:
    """Return the formats by name; each module has its own as `FORMAT`."""
    found = [import_module(f"posekit.keypoints.{name}").FORMAT for name in _MODULES]
    return {one.name: one for one in found}


def suiting(path: str | Path) -> list[str]:
    """List the formats that a file or folder looks like."""
    given = Given(Path(path))
    return [one.name for one in formats().values() if one.suits(given)]


def read_keypoints(
    path: str | Path, format: str | None = None, layout: SkeletonMap | None = None
) -> KeyPoints:
    """Read a detector's file or folder.

    Parameters
    ----------
    path : path
        A file, or a folder of one JSON file a picture.
    format : str, optional
        One of `formats`; recognised by the structure if not given.
    layout : SkeletonMap, optional
        What the points are; the format's own if not given.

    Raises
    ------
    InputError
        Where it cannot be read, is in no format that is known, or in several: the candidates are named.
    """
    given = Given(Path(path))
    if format is not None:
        return by_name(format).read(given, layout)
    candidates = [one for one in formats().values() if one.suits(given)]
    if len(candidates) == 1:
        return candidates[0].read(given, layout)
    if candidates:
        names = " or ".join(one.name for one in candidates)
        raise refusal(path, "format", f"a file that is {names}", "one of them", "say which with --format")
    raise refusal(
        path,
        "format",
        "a file of no format of key points that is known",
        ", ".join(formats()),
        "say which with --format to learn what does not fit",
    )


def write_keypoints(path: str | Path, keypoints: KeyPoints, format: str) -> None:
    """Write key points in a format by name.

    Raises
    ------
    InputError
        Where there is no such format, it is only read, or the file cannot be written.
    """
    one = by_name(format)
    if one.write is None:
        raise InputError(f"{path}: format {format} is read, not written; choose another")
    one.write(Path(path), keypoints)


def by_name(name: str) -> Format:
    """Return a format by its name."""
    if name not in formats():
        raise refusal("--format", "", shown(name), "a known format", nearest(name, formats()))
    return formats()[name]
