"""Recognise what a file or folder holds: by the schema it names, the end of its name, and its structure."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from posekit.errors import InputError
from posekit.formats.format import Content, Format
from posekit.formats.given_file import ANY_SIZE, GivenFile
from posekit.formats.own_files import OWN_FORMATS
from posekit.formats.registry import FOLDER_SUFFIX, formats, names, with_suffix
from posekit.safe_io import cut, nearest, refusal, shown
from posekit.safe_io.regular_file import check_file, unreadable

PICTURE_SUFFIXES: Final = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".bmp", ".gif", ".heic")
VIDEO_SUFFIXES: Final = (".mp4", ".mov", ".avi", ".mkv", ".webm", ".m4v")
"""The ends of names of what detectors look at."""
PICKLE_SUFFIXES: Final = (".pkl", ".pickle", ".p", ".pt", ".pth", ".joblib")
"""The ends of names of Python's pickles, which are never opened."""


@dataclass(frozen=True, kw_only=True)
class Recognised:
    """What a file or folder is.

    Parameters
    ----------
    holds : Content
        What it holds.
    formats : tuple of Format
        The formats it may be in: one, or several where its structure does not tell; none where only its schema is
        known.
    schema : str
        The schema that it names, as ``posekit.view/1``; empty where it names none.
    said : str
        The name of the format, as the user said it, perhaps with a layout, or as the end of a table's name says it;
        empty where it was recognised.
    """

    holds: Content
    formats: tuple[Format, ...] = ()
    schema: str = ""
    said: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the formats that other programs' files may be in; none for posekit's own."""
        if self.said:
            return (self.said,)
        return tuple(dict.fromkeys(one.name for one in self.formats if one not in OWN_FORMATS))

    @property
    def title(self) -> str:
        """What the file is, for people: ``motion (trc)``, ``a view (posekit.view/1)``."""
        named = self.schema or " or ".join(() if self.holds is Content.CAMERAS else self.names)
        return f"{self.holds.value} ({named})" if named else self.holds.value

    def only(self, path: str | Path) -> Format:
        """Return the format, or refuse a file that may be in several or whose schema alone is known.

        Parameters
        ----------
        path : path
            The file, for the message.

        Raises
        ------
        InputError
            Where there is not one format: those that the file may be in are named.
        """
        if len(self.formats) == 1:
            return self.formats[0]
        several = " or ".join(self.names) or self.title
        raise refusal(path, "format", f"a file that is {several}", "one of them", "say which with --format")


def recognise(path: str | Path, format: str = "") -> Recognised:
    """Tell what a file or folder holds, and in which format.

    Parameters
    ----------
    path : path
        The file or folder.
    format : str
        The name of the format, where it is said; recognised if empty. A format of key points may have one of its
        layouts behind it: ``openpose-body_25b``.

    Raises
    ------
    InputError
        Where it cannot be read, or is nothing that is known, or may hold different things.
    """
    path = Path(path)
    is_folder = _is_folder(path)
    if format:
        one = _of_name(path, format)
        return Recognised(holds=one.holds, formats=(one,), said=format)
    given = GivenFile(path)
    for own in OWN_FORMATS:
        if (own.folder if is_folder else given.suffix in own.suffixes) and own.looks_like(given):
            table = given.suffix.removeprefix(".") if own.holds is Content.SURVIVORS else ""
            return Recognised(holds=own.holds, formats=(own,), schema=given.schema, said=table)
    if is_folder:
        return _of_folder(given)
    if given.schema.startswith("posekit."):
        return Recognised(holds=Content.OTHER, schema=given.schema)
    named = tuple(with_suffix(given.suffix))
    found = tuple(one for one in named if one.looks_like(given))
    if not found and len(named) == 1:
        found = named  # damaged, or another program's: its reader says what is wrong
    if not found:
        raise _nothing_known(given)
    contents = {one.holds for one in found}
    if len(contents) > 1:
        several = " or ".join(one.name for one in found)
        raise refusal(path, "format", f"a file that is {several}", "one of them", "say which with --format")
    return Recognised(holds=contents.pop(), formats=found)


def _is_folder(path: Path) -> bool:
    """Tell whether it is a folder; refuse what is not there, a pipe or a device."""
    try:
        if path.is_dir():
            return True
    except (OSError, ValueError) as error:
        raise unreadable(path, error) from None
    check_file(path, limit=ANY_SIZE)
    return False


def _of_name(path: Path, format: str) -> Format:
    from posekit.formats.keypoints import chosen, is_format

    if is_format(format):
        return chosen(format)[0]
    for one in formats():
        if one.name == format:
            return one
    near = nearest(format, names(Content.KEY_POINTS, Content.MOTION))
    raise refusal(path, "--format", shown(format), "a known format", near)


def _of_folder(given: GivenFile) -> Recognised:
    """Tell what a folder is: cameras or a person as a robot by the names in it, else key points by its first file."""
    known = list(with_suffix(FOLDER_SUFFIX))
    for content in sorted({one.holds for one in known}, key=lambda one: one is Content.KEY_POINTS):
        found = tuple(one for one in known if one.holds is content and one.looks_like(given))
        if found:
            return Recognised(holds=content, formats=found)
    if given.alone is not None and (inside := _inside(given.alone)) is not None:
        return inside
    got = f"a folder whose first file, {cut(given.files[0].name)}, is {shown(given.document)}"
    expected = f"key points: {', '.join(names(Content.KEY_POINTS))}"
    raise refusal(given.path, "", got, expected, "say which with --format")


def _inside(given: GivenFile) -> Recognised | None:
    """Tell what the one file of a folder is, where it is a detector's of all pictures."""
    found = tuple(one for one in with_suffix(given.suffix) if one.looks_like(given))
    if not found or any(one.holds is not Content.KEY_POINTS for one in found):
        return None
    return Recognised(holds=Content.KEY_POINTS, formats=found)


def _nothing_known(given: GivenFile) -> InputError:
    """Word the refusal of a file that no format looks like."""
    known = ", ".join(names(Content.KEY_POINTS, Content.MOTION))
    for suffixes, what in ((PICTURE_SUFFIXES, "a picture"), (VIDEO_SUFFIXES, "a video")):
        if given.suffix in suffixes:
            expected = "the key points that a detector found in it, or a view"
            remedy = "run a pose detector (OpenPose, MediaPipe, MMPose, …) on it, and give what it writes"
            return refusal(given.path, "", what, expected, remedy)
    if given.suffix == ".json":
        if isinstance(given.document, dict) and {"images", "annotations"} <= given.document.keys():
            got, expected = "a COCO file without key points", 'annotations with "keypoints"'
            return refusal(given.path, "annotations", got, expected, "give the file of its key points")
        got = f"JSON of no known format, {shown(given.document)}"
        return refusal(given.path, "", got, known, "say which with --format")
    if given.suffix in PICKLE_SUFFIXES:
        remedy = "where you trust it, save its arrays: numpy.savez(path, **dictionary)"
        return refusal(given.path, "", "a pickle, which can run any program", "an NPZ of its arrays", remedy)
    if given.suffix == ".npz" and not zipfile.is_zipfile(given.path):
        got, expected = "a damaged file: no NPZ", "arrays that NumPy saved"
        return refusal(given.path, "", got, expected, "check how it was written")
    return refusal(given.path, "", "a file of no known format", known, "say which with --format")
