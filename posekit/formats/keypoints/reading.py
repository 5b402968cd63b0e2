"""Read and write key points: which format a file is in, and the formats by name."""

from __future__ import annotations

from pathlib import Path

from posekit.errors import InputError
from posekit.formats.format import Content
from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints.key_point_format import KeyPointFormat
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.registry import FOLDER_SUFFIX, formats, suffixes_of
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.safe_io import cut, nearest, refusal, shown


def key_point_formats() -> dict[str, KeyPointFormat]:
    """Return the formats of key points by name."""
    return {one.name: one for one in formats(Content.KEY_POINTS) if isinstance(one, KeyPointFormat)}


def read_keypoints(
    path: str | Path, format: str | None = None, layout: SkeletonMap | None = None
) -> KeyPoints:
    """Read a detector's file or folder.

    Parameters
    ----------
    path : path
        A file, a folder of one JSON file a picture, or one with a single file of all pictures.
    format : str, optional
        One of `key_point_formats`, alone or with a layout as ``openpose-body_25b``; recognised by the structure if
        not given.
    layout : SkeletonMap, optional
        What the points are; the format's own if not given.

    Raises
    ------
    InputError
        Where it cannot be read, is in no format that is known, or in several: the candidates are named.
    """
    given = GivenFile(Path(path))
    if format is not None:
        one, named = chosen(format)
        given = given if FOLDER_SUFFIX in suffixes_of(one) else given.alone or given
        return one.read(given, layout if layout is not None else named)
    candidates = _candidates(given)
    if not candidates and given.alone is not None and (inside := _candidates(given.alone)):
        given, candidates = given.alone, inside
    if len(candidates) == 1:
        return candidates[0].read(given, layout)
    if candidates:
        names = " or ".join(one.name for one in candidates)
        raise refusal(path, "format", f"a file that is {names}", "one of them", "say which with --format")
    expected = f"key points as {', '.join(key_point_formats())}"
    remedy = "say which with --format to learn what does not fit"
    raise refusal(path, "format", _described(given), expected, remedy)


def _candidates(given: GivenFile) -> list[KeyPointFormat]:
    """List the formats that a file looks like; the file is parsed here, so that damage is told first."""
    known = list(key_point_formats().values())
    suffix = FOLDER_SUFFIX if given.is_folder else given.suffix
    named = [one for one in known if suffix in suffixes_of(one)]
    return [one for one in named or known if one.looks_like(given)]


def _described(given: GivenFile) -> str:
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


def is_format(name: str) -> bool:
    """Tell whether a name is a format's, alone or with one of its layouts; see `chosen`."""
    return name in key_point_formats() or any(
        name == f"{one.name}-{layout}" for one in key_point_formats().values() for layout in one.skeletons
    )


def chosen(name: str) -> tuple[KeyPointFormat, SkeletonMap | None]:
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
    if name in key_point_formats():
        return key_point_formats()[name], None
    for one in key_point_formats().values():
        layout = name.removeprefix(f"{one.name}-")
        if layout != name and layout in one.skeletons:
            return one, load_skeleton_map(layout)
    raise refusal("--format", "", shown(name), "a known format", nearest(name, _all_names(name)))


def _all_names(name: str) -> list[str]:
    """List what a name could have been: the formats, and those with a layout where one was tried."""
    tried = [one for one in key_point_formats().values() if name.startswith(f"{one.name}-")]
    return [*key_point_formats(), *(f"{one.name}-{layout}" for one in tried for layout in one.skeletons)]
