"""Read and write key points: which format a file is in, and the formats by name."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pathlib import Path

from posekit.errors import InputError
from posekit.formats.keypoints.format import Format
from posekit.formats.keypoints.given import Given
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.safe_io import cut, nearest, one_line, refusal, shown

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
    found = [import_module(f"posekit.formats.keypoints.{name}").FORMAT for name in _MODULES]
    return {one.name: one for one in found}


def suiting(path: str | Path) -> list[str]:
    """List the formats that a file or folder looks like."""
    return [one.name for one in _candidates(Given(Path(path)))]


def read_keypoints(
    path: str | Path, format: str | None = None, layout: SkeletonMap | None = None
) -> KeyPoints:
    """Read a detector's file or folder.

    Parameters
    ----------
    path : path
        A file, or a folder of one JSON file a picture.
    format : str, optional
        One of `formats`, or one with a layout as ``openpose-body_25b``; recognised by the structure if not given.
    layout : SkeletonMap, optional
        What the points are; the format's own if not given.

    Raises
    ------
    InputError
        Where it cannot be read, is in no format that is known, or in several: the candidates are named.
    """
    given = Given(Path(path))
    if format is not None:
        one, named = chosen(format)
        return one.read(given, layout if layout is not None else named)
    candidates = _candidates(given)
    if len(candidates) == 1:
        return candidates[0].read(given, layout)
    if candidates:
        names = " or ".join(one.name for one in candidates)
        raise refusal(path, "format", f"a file that is {names}", "one of them", "say which with --format")
    raise refusal(
        path,
        "format",
        _described(given),
        f"key points as {', '.join(formats())}",
        "say which with --format to learn what does not fit",
    )


def _candidates(given: Given) -> list[Format]:
    """List the formats that a file looks like; the file is parsed here, so that damage is told first."""
    return [one for one in formats().values() if one.suits(given)]


def _described(given: Given) -> str:
    """Say what a file of no known format is: its top level, or its first line."""
    if given.is_folder:
        document = given.document
        return f"a folder whose first file, {cut(given.files[0].name)}, is {_entry(document)}"
    if given.is_json:
        return _entry(given.document)
    try:
        line = given.text.lstrip().partition("\n")[0].rstrip()
    except InputError:  # not a text
        return "a file that is neither JSON nor text"
    return f"a text that begins with {shown(line)}"


def _entry(document: object) -> str:
    if isinstance(document, list) and document and isinstance(document[0], dict):
        return f"a list of {len(document)} entries, the first {shown(document[0])}"
    return shown(document)


def write_keypoints(path: str | Path, keypoints: KeyPoints, format: str) -> None:
    """Write key points in a format by name.

    Parameters
    ----------
    path : path
        The file, or a new folder where the format is one.
    keypoints : KeyPoints
    format : str
        One of `formats`, or one with a layout to convert to, as ``openpose-body_25``.

    Raises
    ------
    InputError
        Where there is no such format, it is only read, or the file cannot be written.
    """
    one, layout = chosen(format)
    if one.write is None:
        raise InputError(one_line(f"{path}: format {one.name} is read, not written; choose another"))
    one.write(Path(path), keypoints if layout is None else keypoints.in_layout(layout))


def is_format(name: str) -> bool:
    """Tell whether a name is a format's, alone or with one of its layouts; see `chosen`."""
    return name in formats() or any(
        name == f"{one.name}-{layout}" for one in formats().values() for layout in one.skeletons
    )


def by_name(name: str) -> Format:
    """Return a format by its name, which may have a layout's behind it; see `chosen`."""
    return chosen(name)[0]


def chosen(name: str) -> tuple[Format, SkeletonMap | None]:
    """Return a format by its name, and the layout that is named with it.

    Parameters
    ----------
    name : str
        As ``openpose``, or with one of the format's skeleton maps as ``openpose-body_25b``.

    Raises
    ------
    InputError
        Where there is none: the nearest names are given.

    Examples
    --------
    >>> one, layout = chosen("coco-results-h36m_17")
    >>> one.name, layout.name
    ('coco-results', 'h36m_17')
    """
    if name in formats():
        return formats()[name], None
    for one in formats().values():
        layout = name.removeprefix(f"{one.name}-")
        if layout != name and layout in one.skeletons:
            return one, load_skeleton_map(layout)
    raise refusal("--format", "", shown(name), "a known format", nearest(name, _all_names(name)))


def _all_names(name: str) -> list[str]:
    """List what a name could have been: the formats, and those with a layout where one was tried."""
    tried = [one for one in formats().values() if name.startswith(f"{one.name}-")]
    return [*formats(), *(f"{one.name}-{layout}" for one in tried for layout in one.skeletons)]
