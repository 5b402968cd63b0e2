"""Input files from paths, folders and glob patterns; descriptions of their content; names of output files."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from glob import glob
from pathlib import Path
from typing import Any, Final

from posekit.errors import refusal, shown

#: Suffixes of files in folders that hold neither motion nor key points.
SKIPPED: Final = ("", *".md .py .png .jpg .jpeg .gif .mp4 .avi .html .pdf .log .lock".split())


def are_paths(given: Any) -> bool:
    """Return whether the argument is a path, or a list or tuple of paths."""
    several = given if isinstance(given, list | tuple) and given else [given]
    return all(isinstance(one, str | os.PathLike) for one in several)


def files_of(given: Any) -> Iterator[Path]:
    """Yield the input files that paths, folders and glob patterns name.

    Raises
    ------
    InputError
        If a path does not exist, or a folder or pattern has no file.
    """
    for one in [given] if isinstance(given, str | os.PathLike) else given:
        path = Path(one)
        if path.is_file():
            yield path
            continue
        # `Path.glob` refuses patterns with an absolute path.
        matches = glob(str(path), recursive=True)  # noqa: PTH207
        found = list(_below(path)) if str(one) and path.is_dir() else sorted(map(Path, matches))
        if not found:
            what = "a folder without files of motion" if path.is_dir() else "no file"
            remedy = "write them with posekit samples DIR" if str(one) == "samples" else "check the path"
            raise refusal(one, "", what, "a file, a folder of files, or a pattern", remedy)
        yield from found


def _below(folder: Path) -> Iterator[Path]:
    """Yield the input files in a folder and its subfolders; a folder with key points per picture is one input."""
    from posekit.formats.keypoints import looks_like

    inside = [one for one in sorted(folder.iterdir()) if not _is_hidden(one, folder)]
    if inside and all(one.is_file() and one.suffix == ".json" for one in inside) and looks_like(folder):
        yield folder
        return
    for one in inside:
        if one.is_dir():
            yield from _below(one)
        elif one.is_file():
            yield one


def _is_hidden(file: Path, folder: Path) -> bool:
    parts = file.relative_to(folder).parts
    no_motion = file.is_file() and file.suffix.lower() in SKIPPED
    return no_motion or any(part.startswith((".", "__")) for part in parts)


def names_below(files: Iterable[str]) -> dict[str, Path]:
    """Return the path of each file relative to the folder that contains all files."""
    absolute = {file: Path(os.path.normpath(Path(file).absolute())) for file in files}
    common = os.path.commonpath([path.parent for path in absolute.values()]) if absolute else ""
    return {file: path.relative_to(common) for file, path in absolute.items()}


def new_folder(folder: str | os.PathLike[str]) -> Path:
    """Return the path of a folder that does not exist or is empty; raise an error otherwise."""
    path = Path(folder)
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise refusal(path, "", "existing content", "a new or empty folder", "name another folder")
    return path


def kind_of(held: Any) -> str:
    """Describe the content of an opened file in words."""
    words = {"dict": "cameras", "Recovery": "a result", "Detections": "key points", "Motion": "motion"}
    words |= {name: f"a {name.lower()}" for name in ("View", "Report", "Robot", "Figure")}
    name = type(held).__name__
    return words.get(name, shown(name))
