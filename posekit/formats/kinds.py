"""What a file is: one of posekit's own, a detector's, motion capture, or a camera's."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final

from posekit.formats.cameras.reading import SUFFIXES
from posekit.formats.keypoints import Given, formats, is_format
from posekit.formats.motion import motion_formats
from posekit.formats.motion.urdf_folder import FIGURE, NPZ
from posekit.formats.structure import (
    LARGEST,
    first_line,
    has_matrix,
    is_camera_npz,
    is_in_space,
    is_survivors,
    schema,
)
from posekit.safe_io import cut, nearest, refusal, shown
from posekit.safe_io.regular_file import check_file, unreadable


class Kind(StrEnum):
    """What a file holds."""

    VIEW = "a view"
    RESULT = "a result"
    POSTURES = "postures"
    CONFIGURATIONS = "configurations"
    SURVIVORS = "a table of survivors"
    KEY_POINTS = "key points"
    MOTION = "motion"
    CAMERA = "cameras"
    OTHER = "another file of posekit"


SCHEMAS: Final = {
    "posekit.view": Kind.VIEW,
    "posekit.result": Kind.RESULT,
    "posekit.postures": Kind.POSTURES,
    "posekit.configurations": Kind.CONFIGURATIONS,
    "posekit.survivors": Kind.SURVIVORS,
}


@dataclass(frozen=True, kw_only=True)
class What:
    """What a file is.

    Parameters
    ----------
    kind : Kind
    formats : tuple of str
        The formats it may be in: one, or several where its structure does not tell; empty for posekit's own.
    schema : str
        The schema that it names, if it does.
    """

    kind: Kind
    formats: tuple[str, ...] = ()
    schema: str = ""


def kind_of(path: str | Path, format: str = "") -> What:
    """Tell what a file or folder is, by its structure, its end, or the format that is said.

    Raises
    ------
    InputError
        Where it cannot be read, or is nothing that is known.
    """
    path = Path(path)
    folder = _is_folder(path)
    if format:
        return _said(path, format)
    if folder:
        return _of_folder(path)
    given = Given(path)
    named = schema(given)
    if named.startswith("posekit."):
        return What(kind=SCHEMAS.get(named.partition("/")[0], Kind.OTHER), schema=named)
    if is_survivors(path):
        return What(kind=Kind.SURVIVORS, formats=(path.suffix.lower().removeprefix("."),))
    if is_camera_npz(path):
        return What(kind=Kind.CAMERA)
    found = [
        *((Kind.KEY_POINTS, name) for name in _suiting(given)),
        *((Kind.MOTION, name) for name in _motions(path)),
    ]
    found = found or _by_name(path)
    if not found:
        return _nothing_known(given)
    kinds = {kind for kind, _ in found}
    names = tuple(dict.fromkeys(name for _, name in found))
    if len(kinds) > 1:
        raise refusal(
            path, "format", f"a file that is {' or '.join(names)}", "one of them", "say which with --format"
        )
    return What(kind=kinds.pop(), formats=names)


def _is_folder(path: Path) -> bool:
    """Tell whether it is a folder; refuse what is not there, a pipe or a device."""
    try:
        if path.is_dir():
            return True
    except (OSError, ValueError) as error:
        raise unreadable(path, error) from None
    check_file(path, limit=LARGEST)
    return False


def _said(path: Path, format: str) -> What:
    if is_format(format):
        return What(kind=Kind.KEY_POINTS, formats=(format,))
    if format in motion_formats():
        return What(kind=Kind.MOTION, formats=(format,))
    near = nearest(format, [*formats(), *motion_formats()])
    raise refusal(path, "--format", shown(format), "a known format", near)


def _of_folder(path: Path) -> What:
    """Tell what a folder is: a person as a robot, COLMAP's cameras, or pictures of key points."""
    if (path / "cameras.txt").is_file():
        return What(kind=Kind.CAMERA)
    if (path / FIGURE).is_file() and (path / NPZ).is_file():
        return What(kind=Kind.MOTION, formats=("urdf",))
    given = Given(path)
    names = tuple(one.name for one in formats().values() if one.suits(given))
    if not names:
        first = given.document
        got = f"a folder whose first file, {cut(given.files[0].name)}, is {shown(first)}"
        raise refusal(path, "", got, f"key points: {', '.join(formats())}", "say which with --format")
    return What(kind=Kind.KEY_POINTS, formats=names)


def _suiting(given: Given) -> list[str]:
    """List the formats of key points that a file looks like."""
    if given.suffix not in (".json", ".csv", ".h5"):
        return []
    names = [one.name for one in formats().values() if one.suits(given)]
    if given.suffix == ".csv" and "mediapipe" in names and is_in_space(first_line(given.path)):
        names.remove("mediapipe")
    return names


def _motions(path: Path) -> list[str]:
    """List the formats of motion by the end of the name, and by the content where the format can be told by it."""
    named = [one for one in motion_formats().values() if path.suffix.lower() in one.suffixes]
    return [one.name for one in named if one.suits is None or one.suits(path)]


def _by_name(path: Path) -> list[tuple[Kind, str]]:
    """List the format of motion that alone has such names: of a damaged file its reader says what is wrong."""
    named = [one for one in motion_formats().values() if path.suffix.lower() in one.suffixes]
    alone = len(named) == 1 and path.suffix.lower() not in (*SUFFIXES, ".csv")
    return [(Kind.MOTION, named[0].name)] if alone else []


def _nothing_known(given: Given) -> What:
    """Take a file for a camera's, where it can be one; else refuse it."""
    path, suffix = given.path, given.suffix
    known = ", ".join([*formats(), *motion_formats()])
    if suffix == ".json":
        if not has_matrix(given.document):
            got = f"JSON of no known format, {shown(given.document)}"
            raise refusal(path, "", got, known, "say which with --format")
    elif suffix == ".npz" and not zipfile.is_zipfile(path):
        raise refusal(
            path, "", "a damaged file: no NPZ", "arrays that NumPy saved", "check how it was written"
        )
    elif suffix not in SUFFIXES:
        raise refusal(path, "", "a file of no known format", known, "say which with --format")
    return What(kind=Kind.CAMERA)
