"""Which files are meant by what is named: files, folders of them, and patterns."""

from __future__ import annotations

import glob
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from posekit.errors import InputError
from posekit.formats.format import Content
from posekit.formats.recognising import recognise
from posekit.safe_io import cut, refusal
from posekit.safe_io.regular_file import unreadable

MANIFEST_NAME: Final = "posekit-manifest.csv"
"""What `posekit validate --keep` writes beside the clips; in a folder it is no input."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What is looked for in folders.

    Parameters
    ----------
    suffixes : collection of str
        The ends of the files' names; others in a folder are somebody else's.
    contents : collection of Content
        What a folder holds that is itself one recording, as a detector's JSON file a picture.
    """

    suffixes: Collection[str]
    contents: Collection[Content]


def listed(given: Sequence[Path], wanted: Wanted, leave_out: Path | None = None) -> list[Path]:
    """List what is meant, each file once.

    Parameters
    ----------
    given : sequence of Path
        Files, folders, and patterns, as ``clips/*.bvh``.
    wanted : Wanted
        What is looked for in folders.
    leave_out : Path, optional
        The output, which is no input.

    Notes
    -----
    A folder that is one recording is one input; of any other its files are, and those of the folders in it. Hidden
    ones and the output are left out.

    Raises
    ------
    InputError
        Where one is not there or cannot be listed, or no file has a name like a pattern.
    """
    output = None if leave_out is None else leave_out.resolve()
    found: dict[Path, Path] = {}
    for one in given:
        for path in _of(one, wanted, output):
            found.setdefault(path.resolve(), path)
    return list(found.values())


def _of(path: Path, wanted: Wanted, output: Path | None) -> Iterator[Path]:
    """List the inputs of one argument."""
    try:
        folder = path.is_dir()
        there = path.exists()
    except (OSError, ValueError) as error:
        raise unreadable(path, error) from None
    if not there and glob.has_magic(str(path)):
        root = Path(path.anchor or ".")
        matched = sorted(root.glob(str(path.relative_to(path.anchor))))
        if not matched:
            raise refusal(
                path, "", "no file of such a name", "a pattern that some match", "check the pattern"
            )
        for one in matched:
            yield from _of(one, wanted, output)
        return
    if not there:
        raise refusal(path, "", "no such file or folder", "an input that is there", "check the name")
    if not folder:
        yield path
    elif path.resolve() != output:
        yield from _of_folder(path, wanted, output)


def _of_folder(folder: Path, wanted: Wanted, output: Path | None) -> Iterator[Path]:
    """List the inputs of a folder: itself, or what is in it."""
    try:
        entries = sorted(one for one in folder.iterdir() if not one.name.startswith("."))
    except OSError as error:
        raise refusal(
            folder, "", cut(error.strerror or str(error)), "a readable folder", "check its permissions"
        ) from None
    if any(one.is_file() for one in entries) and _is_recording(folder, wanted.contents):
        yield folder
        return
    for one in entries:
        if one.is_dir():
            if one.resolve() != output and not one.is_symlink():
                yield from _of_folder(one, wanted, output)
        elif one.suffix.lower() in wanted.suffixes and one.name != MANIFEST_NAME and one.resolve() != output:
            yield one


def _is_recording(folder: Path, contents: Collection[Content]) -> bool:
    """Tell whether a folder is one recording, by its names and the first of its JSON files."""
    try:
        return recognise(folder).holds in contents
    except InputError:
        return False
