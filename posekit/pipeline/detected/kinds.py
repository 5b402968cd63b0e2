"""What a file is: one of posekit's own, a detector's, motion capture, or a camera's."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final

from posekit.errors import InputError
from posekit.files.npz import open_npz
from posekit.files.result_npz import MAX_PADDED
from posekit.intake import read_toml, refusal
from posekit.keypoints import Given, formats, is_format
from posekit.motion import motion_formats

CAMERA_ENDS: Final = (".yml", ".yaml", ".xml", ".txt", ".jpg", ".jpeg")
"""Ends of files that can only be cameras'."""


class Kind(StrEnum):
    """What a file holds."""

    VIEW = "a view"
    RESULT = "a result"
    POSTURES = "postures"
    CONFIGURATIONS = "configurations"
    SURVIVORS = "a table of survivors"
    KEY_POINTS = "key points"
    MOTION = "motion"
    CAMERA = "a camera"
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
    if format:
        return _said(path, format)
    schema = _schema(path)
    if schema.startswith("posekit."):
        return What(kind=SCHEMAS.get(schema.partition("/")[0], Kind.OTHER), schema=schema)
    found = [
        *((Kind.KEY_POINTS, name) for name in _suiting(path)),
        *((Kind.MOTION, name) for name in _motions(path)),
    ]
    if not found and path.suffix.lower() in (*CAMERA_ENDS, ".toml", ".json", ".npz"):
        return What(kind=Kind.CAMERA)
    if not found:
        known = ", ".join([*formats(), *motion_formats()])
        raise refusal(path, "", "a file of no known format", known, "say which with --format")
    kinds = {kind for kind, _ in found}
    names = tuple(dict.fromkeys(name for _, name in found))
    if len(kinds) > 1:
        raise refusal(
            path, "format", f"a file that is {' or '.join(names)}", "one of them", "say which with --format"
        )
    return What(kind=kinds.pop(), formats=names)


def _said(path: Path, format: str) -> What:
    if is_format(format):
        return What(kind=Kind.KEY_POINTS, formats=(format,))
    if format in motion_formats():
        return What(kind=Kind.MOTION, formats=(format,))
    known = ", ".join([*formats(), *motion_formats()])
    raise refusal(path, "--format", format, known, "choose one of them")


def _schema(path: Path) -> str:
    """Return the schema that a file names; empty where it names none."""
    suffix = path.suffix.lower()
    if suffix == ".npz" and path.is_file() and zipfile.is_zipfile(path):
        with open_npz(path, limit=MAX_PADDED) as archive:
            return str(archive.array("schema", "U", ())) if "schema" in archive.names else ""
    if suffix == ".toml" and path.is_file():
        return str(read_toml(path, limit=10_000_000).get("schema", ""))
    given = Given(path)
    if suffix == ".json" and not given.is_folder:
        document = given.document
        return str(document.get("schema", "")) if isinstance(document, dict) else ""
    return ""


def _suiting(path: Path) -> list[str]:
    given = Given(path)
    if not given.is_folder and given.suffix not in (".json", ".csv", ".h5"):
        return []
    try:
        return [one.name for one in formats().values() if one.suits(given)]
    except InputError:
        if given.is_folder:  # a folder without key points may be another's
            return []
        raise


def _motions(path: Path) -> list[str]:
    """List the formats of motion by the end of the name, and by the content where several share it."""
    named = [one for one in motion_formats().values() if path.suffix.lower() in one.suffixes]
    if path.is_dir():
        return [
            one.name
            for one in motion_formats().values()
            if not one.suffixes and one.suits and one.suits(path)
        ]
    return [one.name for one in named if one.suits is None or one.suits(path)]
