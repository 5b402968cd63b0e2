"""Which inputs there are, in which order, and what they are called."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from posekit.formats.format import Content
from posekit.formats.listing import Wanted, listed
from posekit.safe_io import cut, refusal

INPUT_SUFFIXES: Final = (".json", ".csv", ".h5", ".npz", ".parquet", ".pq")
"""Of the files in a folder that are taken; others in it are somebody else's."""


@dataclass(frozen=True, kw_only=True)
class Input:
    """A file, or a folder of one file a picture.

    Parameters
    ----------
    name : str
        What results call it: its path from the run's root.
    path : Path
        The file or folder.
    """

    name: str
    path: Path


@dataclass(frozen=True, kw_only=True)
class Listing:
    """All inputs of a run.

    Parameters
    ----------
    root : Path
        The folder from which they are named.
    inputs : tuple of Input
        Sorted by name, each once.
    """

    root: Path
    inputs: tuple[Input, ...]


def list_inputs(given: Sequence[Path], output: Path, root: Path | None = None) -> Listing:
    """List all inputs.

    Parameters
    ----------
    given : sequence of Path
        Files and folders, as they were named.
    output : Path
        The run's folder.
    root : Path, optional
        Of an earlier run, whose names are kept; else, or where none of the inputs is in it, the innermost folder that
        all are in.

    Notes
    -----
    A folder that is one recording (a JSON file a picture) is one input; of any other its files are, and those of the
    folders in it. Hidden ones and the output are left out.

    Raises
    ------
    InputError
        Where one is not there or cannot be listed, or there is none.
    """
    wanted = Wanted(suffixes=INPUT_SUFFIXES, contents=(Content.KEY_POINTS,))
    found = listed(given, wanted, output)
    if not found:
        names = ", ".join(str(one) for one in given)
        raise refusal(
            cut(names),
            "",
            "no input",
            f"views or key points: {', '.join(INPUT_SUFFIXES)}",
            "name the files, or a folder of them",
        )
    places = sorted(path.resolve() for path in found)
    if root is None or not any(place.is_relative_to(root) for place in places):
        root = Path(os.path.commonpath([place.parent for place in places]))
    named = {Path(os.path.relpath(place, root)).as_posix(): place for place in places}
    return Listing(root=root, inputs=tuple(Input(name=name, path=named[name]) for name in sorted(named)))
